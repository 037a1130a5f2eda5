"""SmartBody clips stand on their skeletons as measured, and text and binary twins are equal."""

from pathlib import Path

import numpy as np
import pytest

from crowd.errors import MotionError
from crowd.motion.formats import read_motions
from crowd.motion.source import SourceMotion
from tests.crowd.motion_samples import SK, SKM, skmb


def read(folder: Path, skm: str = SKM, sk: str = SK) -> SourceMotion:
    """Write and read one pair."""
    (folder / "toy.sk").write_text(sk)
    path = folder / "toy.skm"
    path.write_text(skm)
    return read_motions(path)[0]


def test_channels_add_to_offsets_and_turn_after_the_fixed_rotation(tmp_path: Path) -> None:
    motion = read(tmp_path)
    assert motion.name == "toy clip"
    assert motion.skeleton.joint_names == ("base", "left leg", "tip")
    assert motion.skeleton.is_animated.tolist() == [True, True, False]
    assert motion.frame_rate == pytest.approx(30.0)
    assert motion.metres_per_unit == 0.01
    assert motion.tags == (("ready", 0.01), ("strokeStart", 0.02), ("heelStrikeLf", 0.033333))
    _, position = motion.world()
    np.testing.assert_allclose(position[0], [[0, 10, 0], [1, 6, 0], [1, 11, 0]], atol=1e-12)
    # The base turns a quarter about y; the leg half a turn about z, fixed quarter included.
    np.testing.assert_allclose(position[1], [[2, 10, 0], [2, 6, -1], [2, 6, 4]], atol=1e-12)


def test_the_binary_twin_is_the_same_motion(tmp_path: Path) -> None:
    expected = read(tmp_path)
    path = tmp_path / "twin.skmb"
    path.write_bytes(skmb())
    motion = read_motions(path)[0]
    assert motion.name == "toy clip"
    assert motion.frame_rate == expected.frame_rate
    assert dict(motion.tags) == pytest.approx(dict(expected.tags), abs=1e-6)
    np.testing.assert_allclose(motion.world()[1], expected.world()[1], atol=1e-5)


def test_uneven_keys_are_sampled_at_even_times(tmp_path: Path) -> None:
    end = SKM[SKM.index("kt 0.033333") : SKM.index("\n\nready")].replace("0.033333", "0.0712")
    motion = read(tmp_path, SKM.replace("frames 2", "frames 3").replace("\n\nready", f"\n{end}\n\nready"))
    assert motion.frame_rate == 30.0
    assert motion.frame_count == 3
    np.testing.assert_allclose(motion.position_local[:, 0, 0], [0, 2, 2], atol=1e-3)


@pytest.mark.parametrize(
    ("found", "replacement", "line", "message"),
    [
        ("frames 2", "frames 10000000000", 9, "2 records follow"),
        ("frames 2", "frames two", 9, "must be a count"),
        ("fr 2 0 1.57", "fr 2 nan 1.57", 11, "finite number"),
        ("fr 2 0 1.57", "fr 2 1.57", 11, "must hold 11 numbers; got 10"),
        ("kt 0.033333", "kt 0", 11, "must increase"),
        ("base Quat", "base Quad", 6, "unknown channel"),
        ("base Quat", "base XPos", 6, "listed twice"),
        ("SkMotion", "Motion", 2, "starts with SkMotion"),
        ("ready time: 0.01", "ready ti", 14, "should stand here"),
        ("ready time: 0.01", "ready time: soon", 14, "finite number"),
    ],
)
def test_broken_clips_are_refused_with_their_line(
    tmp_path: Path, found: str, replacement: str, line: int, message: str
) -> None:
    assert found in SKM
    with pytest.raises(MotionError) as caught:
        read(tmp_path, SKM.replace(found, replacement))
    assert str(caught.value).startswith(f"{tmp_path / 'toy.skm'}:{line}: ")
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("found", "replacement", "line", "message"),
    [
        ("joint tip", "joint base", 12, "same name"),
        ("prerot axis 0 0 1 ang 90", "prerot axis 0 0 ang 90", 10, "finite number"),
        ("channel YPos", "channel WPos", 7, "unknown channel"),
        ("offset 0 10 0", "ofset 0 10 0", 5, "unknown item"),
        ("  }\n}\nend\n", "", 13, "ends where"),
    ],
)
def test_broken_skeletons_are_refused_with_their_line(
    tmp_path: Path, found: str, replacement: str, line: int, message: str
) -> None:
    assert found in SK
    with pytest.raises(MotionError) as caught:
        read(tmp_path, sk=SK.replace(found, replacement))
    assert f"toy.sk:{line}: " in str(caught.value)
    assert message in str(caught.value)


@pytest.mark.parametrize("share", np.linspace(0.05, 0.75, 8))
def test_a_message_that_is_cut_short_is_refused(tmp_path: Path, share: float) -> None:
    read(tmp_path)
    path = tmp_path / "twin.skmb"
    content = skmb()
    path.write_bytes(content[: int(share * content.index(b"heelStrikeLf"))])
    with pytest.raises(MotionError, match=r"twin\.skmb"):
        read_motions(path)


def test_the_skeleton_with_most_channels_is_found_and_doubt_is_told(tmp_path: Path) -> None:
    folder = tmp_path / "alone" / "set"
    clips, skeletons = folder / "motions", folder / "skeletons"
    clips.mkdir(parents=True)
    skeletons.mkdir()
    clip = clips / "walk.skm"
    clip.write_text(SKM)
    with pytest.raises(MotionError, match=r"no \.sk file"):
        read_motions(clip)
    (skeletons / "other.sk").write_text(SK.replace("base", "stem").replace("left leg", "left branch"))
    with pytest.raises(MotionError, match=r"finds no skeleton.*other\.sk"):
        read_motions(clip)
    (skeletons / "right.sk").write_text(SK)
    assert "left leg" in read_motions(clip)[0].skeleton.joint_names
    (skeletons / "longer.sk").write_text(SK.replace("offset 5", "offset 6"))
    with pytest.raises(MotionError, match=r"longer\.sk.*right\.sk"):
        read_motions(clip)
    assert read_motions(clip, skeleton=skeletons / "longer.sk")[0].skeleton.offset[2, 0] == 6.0


COMMON = ("base", "l_ankle", "r_wrist", "skullbase")
JT = ("JtRoot", "JtAnkleLf", "JtWristRt", "JtSkullA")


@pytest.mark.parametrize(
    ("folder", "clip", "names", "frame", "expected", "yaw"),
    [
        ("MaleLocomotion", "ChrUtah_Walk001", COMMON, 0,
         [[0, 1.0116, 0], [0.0784, 0.1179, 0.2274], [-0.2209, 0.9535, 0.1124],
          [-0.0044, 1.6568, 0.0495]], -2.44),
        ("MaleLocomotion", "ChrUtah_Walk001", COMMON, 20,
         [[-0.0320, 1.0056, 0.8992], [0.0759, 0.3752, 0.5654], [-0.3209, 0.9604, 0.8264],
          [-0.0229, 1.6494, 0.9620]], 3.68),
        ("MaleMocapLocomotion", "ChrMarine@Walk01", JT, 0,
         [[0.0177, 0.9299, 0.1143], [0.0842, 0.1416, -0.0551], [-0.2764, 0.8565, 0.1448],
          [-0.0005, 1.5818, 0.1808]], 4.86),
        ("MaleMocapLocomotion", "ChrMarine@Walk01", JT, 20,
         [[0.0148, 0.8932, 0.8668], [0.0814, 0.1185, 1.0754], [-0.3131, 0.9108, 1.1545],
          [0.0174, 1.5466, 0.9149]], -1.63),
        ("FemaleLocomotion", "ChrHarmony@StrafeSlowRt01", JT, 0,
         [[-0.0880, 0.9800, 0.0434], [0.0080, 0.1183, 0.0879], [-0.2706, 0.8886, 0.1316],
          [-0.0995, 1.5297, 0.0388]], -38.44),
        ("FemaleLocomotion", "ChrHarmony@StrafeSlowRt01", JT, 20,
         [[-0.2345, 0.9800, 0.0695], [-0.2651, 0.1082, 0.0823], [-0.4560, 0.8675, -0.0419],
          [-0.2333, 1.5299, 0.0761]], -18.58),
    ],
)  # fmt: skip
def test_joints_stand_where_they_were_measured(
    shared_data: Path,
    folder: str,
    clip: str,
    names: tuple[str, ...],
    frame: int,
    expected: list[list[float]],
    yaw: float,
) -> None:
    motion = read_motions(shared_data / "smartbody" / folder / "motions" / f"{clip}.skm")[0]
    rotation, position = motion.world()
    joints = [motion.skeleton.joint_names.index(name) for name in names]
    for joint, point in zip(joints, expected, strict=True):
        np.testing.assert_allclose(motion.metres_per_unit * position[frame, joint], point, atol=6e-5)
    w, _, y, _ = rotation[frame, joints[0]]
    assert np.degrees(2 * np.arctan2(y, w)) == pytest.approx(yaw, abs=0.006)


def test_published_twins_are_equal(shared_data: Path) -> None:
    folder = shared_data / "smartbody" / "reaching"
    twins = [
        path for path in sorted(folder.glob("*/*.skmb")) if (folder / "motions" / f"{path.stem}.skm").exists()
    ]
    assert len(twins) == 28
    for path in twins:
        binary = read_motions(path)[0]
        text = read_motions(folder / "motions" / f"{path.stem}.skm")[0]
        assert binary.skeleton.joint_names == text.skeleton.joint_names
        assert dict(binary.tags) == pytest.approx(dict(text.tags), abs=1e-6)
        assert binary.frame_rate == text.frame_rate == 30.0
        dots = np.einsum("fjc,fjc->fj", binary.rotation_local, text.rotation_local)
        turned = binary.rotation_local * np.sign(dots)[..., None]
        np.testing.assert_allclose(turned, text.rotation_local, atol=1e-6, err_msg=path.name)
        np.testing.assert_allclose(0.01 * binary.world()[1], 0.01 * text.world()[1], atol=1e-6)


def test_every_clip_is_read(shared_data: Path) -> None:
    files = sorted((shared_data / "smartbody").rglob("*.skm"))
    assert len(files) == 221
    for path in files:
        motion = read_motions(path)[0]
        assert motion.frame_rate == 30.0
        assert np.isfinite(motion.world()[1]).all()
