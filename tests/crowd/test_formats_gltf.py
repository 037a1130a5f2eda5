"""Animated glTF files are sampled on the joints of their skin."""

import json
import struct
from pathlib import Path

import numpy as np
import pytest

from crowd.errors import MotionError
from crowd.motion.formats import read_motions
from tests.crowd.motion_samples import gltf


def test_joints_turn_under_the_nodes_above_them(tmp_path: Path) -> None:
    path = tmp_path / "toy.gltf"
    path.write_text(gltf())
    motion = read_motions(path, frame_rate=10.0)[0]
    assert motion.name == "bend"
    assert motion.skeleton.joint_names == ("hips", "leg", "foot")
    assert motion.skeleton.is_animated.tolist() == [False, True, False]
    assert (motion.frame_rate, motion.frame_count) == (10.0, 11)
    _, position = motion.world()
    # The armature turns y to z and z to -y.
    np.testing.assert_allclose(position[0], [[0, -1, 0], [0, -1, 2], [0, -1, 5]], atol=1e-6)
    half = 3 * 0.5**0.5
    np.testing.assert_allclose(position[5, 2], [-half, -1, 2 + half], atol=1e-6)
    np.testing.assert_allclose(position[10, 2], [-3, -1, 2], atol=1e-6)


def test_a_glb_holds_the_same(tmp_path: Path) -> None:
    (tmp_path / "toy.gltf").write_text(gltf())
    text = gltf().encode()
    text += b" " * (-len(text) % 4)
    content = (
        struct.pack("<III", 0x46546C67, 2, 20 + len(text)) + struct.pack("<II", len(text), 0x4E4F534A) + text
    )
    (tmp_path / "toy.glb").write_bytes(content)
    expected = read_motions(tmp_path / "toy.gltf")[0]
    np.testing.assert_array_equal(
        read_motions(tmp_path / "toy.glb")[0].rotation_local, expected.rotation_local
    )
    (tmp_path / "toy.glb").write_bytes(content[:-9])
    with pytest.raises(MotionError, match=r"toy\.glb: byte 12: a chunk is cut short"):
        read_motions(tmp_path / "toy.glb")


@pytest.mark.parametrize(
    ("place", "value", "message"),
    [
        (("nodes", 2, "children"), [1], "impossible child|circle"),
        (("nodes", 3, "children"), [0], "circle"),
        (("nodes", 3, "children"), [99], "impossible child"),
        (("skins", 0, "joints"), [1, 99], "joints that are not there"),
        (("accessors", 0, "count"), 10**10, "outside its buffer"),
        (("accessors", 1, "count"), 1, "do not fit"),
        (("bufferViews", 1, "byteOffset"), -8, "outside its buffer"),
        (("buffers", 0, "uri"), "data:;base64,AAA", "cannot be decoded"),
        (("buffers", 0, "uri"), "../../etc/passwd", "outside the folder"),
        (("nodes", 1, "translation"), [0, "x", 0], "malformed transform"),
        (("animations",), [], "holds no animation"),
    ],
)
def test_a_broken_file_is_refused_in_one_line(
    tmp_path: Path, place: tuple[str | int, ...], value: object, message: str
) -> None:
    document = json.loads(gltf())
    part = document
    for key in place[:-1]:
        part = part[key]
    part[place[-1]] = value
    path = tmp_path / "toy.gltf"
    path.write_text(json.dumps(document))
    with pytest.raises(MotionError, match=message) as caught:
        read_motions(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "count", "joints", "duration"),
    [
        ("robot/robot.glb", 14, 43, 3.33),
        ("greenman/greenman.glb", 4, 12, 0.17),
        ("cesium_man/cesium_man.gltf", 1, 19, 2.0),
    ],
)
def test_published_characters_are_read(
    shared_data: Path, name: str, count: int, joints: int, duration: float
) -> None:
    motions = read_motions(shared_data / "gltf" / name)
    assert len(motions) == count
    assert motions[0].skeleton.joint_count == joints
    assert motions[0].duration == pytest.approx(duration, abs=0.05)
    for motion in motions:
        np.testing.assert_allclose(np.linalg.norm(motion.rotation_local, axis=-1), 1.0, atol=1e-6)
        height = np.ptp(motion.world()[1][0, :, 1])
        assert 0.5 < height < 6.0
