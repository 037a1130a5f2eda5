"""BVH files are read as they are written, and as another library reads them."""

import time
from pathlib import Path

import numpy as np
import pytest

from crowd.errors import MotionError
from crowd.motion.formats import read_motions
from tests.crowd.motion_samples import BVH


def read(folder: Path, text: str) -> object:
    """Write and read one file."""
    path = folder / "clip.bvh"
    path.write_text(text, "utf-8")
    return read_motions(path)[0]


def test_channels_turn_and_move_joints_in_their_listed_order(tmp_path: Path) -> None:
    motion = read(tmp_path, BVH)
    assert motion.skeleton.joint_names == ("Hips", "Left Leg", "Left Leg_end")
    assert motion.skeleton.parent.tolist() == [-1, 0, 1]
    assert motion.skeleton.is_animated.tolist() == [True, True, False]
    assert motion.frame_rate == 30.0
    assert motion.metres_per_unit is None
    _, position = motion.world()
    np.testing.assert_allclose(position[0], [[0, 9, 0], [1, 5, 0], [1, 0, 0]], atol=1e-12)
    # A quarter about y takes +x to -z; a further quarter of the leg about its own x takes -y to -z, then -x.
    np.testing.assert_allclose(position[1], [[1, 9, 2], [1, 5, 1], [-4, 5, 1]], atol=1e-12)


@pytest.mark.parametrize("ending", ["\r\n", "\r"], ids=["windows", "old mac"])
def test_line_ends_tabs_and_latin_letters_do_not_matter(tmp_path: Path, ending: str) -> None:
    expected = read(tmp_path, BVH).world()[1]
    path = tmp_path / "other.bvh"
    changed = BVH.replace(" ", "\t").replace("Left\tLeg", "Jambe gauché").replace("\n", ending)
    path.write_bytes(changed.encode("latin-1"))
    motion = read_motions(path)[0]
    assert motion.skeleton.joint_names[1] == "Jambe gauché"
    np.testing.assert_array_equal(motion.world()[1], expected)


@pytest.mark.parametrize("declared", [1, 2, 3])
def test_a_frame_count_that_is_off_by_one_gives_way_to_the_rows(tmp_path: Path, declared: int) -> None:
    assert read(tmp_path, BVH.replace("Frames: 2", f"Frames: {declared}")).frame_count == 2


@pytest.mark.parametrize(
    ("found", "replacement", "line", "message"),
    [
        ("Frames: 2", "Frames: 10000000000", 17, "10000000000, but 2 rows"),
        ("Frames: 2", "Frames: -2", 17, "must be a count"),
        ("0.0333333", "0", 18, "out of range"),
        ("1 9 2 0", "1 nan 2 0", 20, "finite number"),
        ("1 9 2 0", "1 1e400 2 0", 20, "finite number"),
        ("1 9 2 0", "1 9,5 2 0", 20, "finite number"),
        ("1 9 2 0 0 90 90 0 0", "1 9 2", 20, "must hold 9 numbers; got 3"),
        ("Zrotation Xrotation Y", "Zrotation Wrotation Y", 5, "unknown channel"),
        ("Zrotation Xrotation Y", "Zrotation Zrotation Y", 5, "listed twice"),
        ("JOINT Left Leg", "JOINT Hips", 6, "same name"),
        ("OFFSET 1 -4 0", "OFFSET 1 x 0", 8, "finite number"),
        ("OFFSET 1 -4 0", "OFFSETS 1 -4 0", 8, "unknown word"),
        ("  }\n}\nMOTION", "  }\nMOTION", 15, "not closed"),
        ("HIERARCHY\n", "", 1, "starts with HIERARCHY"),
        ("    }\n", "    \0\n", 13, "zero byte"),
    ],
)
def test_a_broken_file_is_refused_with_its_line(
    tmp_path: Path, found: str, replacement: str, line: int, message: str
) -> None:
    assert found in BVH
    with pytest.raises(MotionError) as caught:
        read(tmp_path, BVH.replace(found, replacement))
    assert str(caught.value).startswith(f"{tmp_path / 'clip.bvh'}:{line}: ")
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_bones_without_any_length_are_refused(tmp_path: Path) -> None:
    text = BVH.replace("OFFSET 1 -4 0", "OFFSET 0 0 0").replace("OFFSET 0 -5 0", "OFFSET 0 0 0")
    with pytest.raises(MotionError, match="zero length"):
        read(tmp_path, text)


def test_every_cut_is_refused_or_read(tmp_path: Path) -> None:
    path = tmp_path / "cut.bvh"
    for size in range(len(BVH) - 25):
        path.write_text(BVH[:size])
        if size < BVH.index("0 9 0 0 0 0 0 0 0") + 17:
            with pytest.raises(MotionError, match=r"cut\.bvh:\d+: "):
                read_motions(path)


def test_joints_stand_where_pybvh_puts_them(shared_data: Path) -> None:
    pybvh = pytest.importorskip("pybvh")
    files = sorted(shared_data.rglob("*.bvh"))
    assert len(files) == 85
    for path in files:
        motion = read_motions(path)[0]
        peer = pybvh.read_bvh_file(str(path))
        expected = peer.node_positions()
        position = motion.world()[1]
        assert position.shape == expected.shape, path
        np.testing.assert_allclose(position, expected, atol=1e-6, err_msg=str(path))
        assert motion.frame_rate == pytest.approx(1.0 / peer.frame_time, rel=1e-4)


def test_a_thousand_frames_of_sixty_joints_take_at_most_fifty_milliseconds(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    joints = [
        f"JOINT j{joint}\n{{\nOFFSET 0 1 0\nCHANNELS 3 Zrotation Yrotation Xrotation\n" for joint in range(60)
    ]
    hierarchy = "HIERARCHY\n" + "".join(joints).replace("JOINT", "ROOT", 1) + "}\n" * 60
    rows = "\n".join(" ".join(f"{value:.4f}" for value in row) for row in rng.normal(0, 50, (1000, 180)))
    path = tmp_path / "long.bvh"
    path.write_text(f"{hierarchy}MOTION\nFrames: 1000\nFrame Time: 0.00833333\n{rows}\n")
    best = np.inf
    # Other work on the machine is not what is measured.
    for _ in range(20):
        begin = time.perf_counter()
        motion = read_motions(path)[0]
        best = min(best, time.perf_counter() - begin)
    assert motion.frame_count == 1000
    assert best <= 0.05
