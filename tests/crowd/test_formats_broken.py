"""Motion files are found in folders, and broken ones are refused, whatever is wrong with them."""

import random
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from crowd.errors import MotionError
from crowd.motion.formats import EXTENSIONS, find_motion_files, read_motions
from tests.crowd.motion_samples import contents

SKELETONS = {"toy.amc": "toy.asf", "toy.skm": "toy.sk", "toy.skmb": "toy.sk"}
NUMBERS = (
    b"nan",
    b"-inf",
    b"1e999",
    b"10000000000",
    b"-1",
    b"0",
    b"",
    b"x",
    b"1e-320",
    b"\xff\xfe",
    b"{",
    b"}",
)


def broken(content: bytes, rng: random.Random) -> bytes:
    """Break a file once: cut, flip, repeat, swap, delete, replace."""
    lines, at = content.split(b"\n"), rng.randrange(len(content))
    one, two = rng.randrange(len(lines)), rng.randrange(len(lines))
    match rng.randrange(7):
        case 0:
            return content[:at]
        case 1:
            return content[:at] + bytes([content[at] ^ 1 << rng.randrange(8)]) + content[at + 1 :]
        case 2:
            return b"\n".join([*lines[:one], lines[two], *lines[one:]])
        case 3:
            lines[one], lines[two] = lines[two], lines[one]
            return b"\n".join(lines)
        case 4:
            return b"\n".join(lines[:one] + lines[one + 1 :])
        case 5:
            words = lines[one].split(b" ")
            words[rng.randrange(len(words))] = rng.choice(NUMBERS)
            return b"\n".join([*lines[:one], b" ".join(words), *lines[one + 1 :]])
        case _:
            return content[:at] + rng.randbytes(4) + content[at + 4 :]


@pytest.mark.parametrize("name", sorted(contents()))
@given(seed=st.integers(0, 2**32), times=st.integers(1, 3))
@settings(max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_broken_file_is_read_or_refused_in_one_line(
    tmp_path: Path, name: str, seed: int, times: int
) -> None:
    rng = random.Random(seed)
    whole = contents()
    content = whole[name]
    for _ in range(times):
        content = broken(content, rng) or b" "
    for other in whole:
        (tmp_path / other).write_bytes(content if other == name else whole[other])
    for motion in [motion for motion, skeleton in SKELETONS.items() if skeleton == name] or [name]:
        skeleton = tmp_path / SKELETONS[motion] if motion in SKELETONS else None
        refusal = ""
        try:
            motions = read_motions(tmp_path / motion, skeleton=skeleton)
            assert all(found.frame_count > 0 for found in motions)
        except MotionError as error:
            refusal = str(error)
        assert "\n" not in refusal
        assert not refusal or name in refusal or motion in refusal


@pytest.mark.parametrize("suffix", EXTENSIONS)
@pytest.mark.parametrize("content", [b"", b"\0" * 100, b"\xff\xfeH\0", bytes(range(256)) * 8, b"[" * 100_000])
def test_what_is_no_motion_is_refused(tmp_path: Path, suffix: str, content: bytes) -> None:
    (tmp_path / "toy.asf").write_bytes(contents()["toy.asf"])
    (tmp_path / "toy.sk").write_bytes(contents()["toy.sk"])
    path = tmp_path / f"toy{suffix}"
    path.write_bytes(content)
    with pytest.raises(MotionError, match=r"toy\."):
        read_motions(path)


def test_folders_are_searched_to_the_bottom_in_order(tmp_path: Path) -> None:
    for name in ("b/two.SKM", "b/c/three.bvh", "a/one.amc", "a/readme.txt", "a/one.asf"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("")
    found = find_motion_files([tmp_path, tmp_path / "a" / "one.amc"])
    assert [path.name for path in found] == ["one.amc", "three.bvh", "two.SKM"]


@pytest.mark.parametrize("name", ["clip.fbx", "clip", "clip.asf", "missing.bvh", "empty"])
def test_what_cannot_be_a_motion_is_refused_with_what_can(tmp_path: Path, name: str) -> None:
    (tmp_path / "empty").mkdir()
    for file in ("clip.fbx", "clip", "clip.asf"):
        (tmp_path / file).write_text("")
    with pytest.raises(MotionError) as caught:
        find_motion_files([tmp_path / name])
    assert str(caught.value).startswith(str(tmp_path / name))
    assert name == "missing.bvh" or ".bvh, .amc, .skm, .skmb, .gltf, .glb" in str(caught.value)
