"""ASF skeletons with AMC frames are read as bones that turn about their start."""

from pathlib import Path

import numpy as np
import pytest

from crowd.errors import MotionError
from crowd.motion.formats import read_motions
from tests.crowd.motion_samples import AMC, ASF


def read(folder: Path, amc: str = AMC, asf: str = ASF) -> object:
    """Write and read one pair."""
    (folder / "toy.asf").write_bytes(asf.encode("latin-1"))
    path = folder / "toy_01.amc"
    path.write_bytes(amc.encode("latin-1"))
    return read_motions(path)[0]


def test_bones_turn_about_their_start_in_their_own_axes(tmp_path: Path) -> None:
    motion = read(tmp_path, AMC.replace("#!OML:ASF", "#!OML:ASF X:\\für Bonn"))
    assert motion.skeleton.joint_names == ("root", "hip", "leg", "leg_end")
    assert motion.frame_rate == 120.0
    assert motion.metres_per_unit == pytest.approx(0.0564444, abs=1e-7)
    _, position = motion.world()
    np.testing.assert_allclose(position[0], [[0, 10, 0], [0, 10, 0], [2, 10, 0], [2, 6, 0]], atol=1e-12)
    # The root's quarter about y takes +x to -z; the leg's quarter about z takes -y to +x first, so to -z too.
    np.testing.assert_allclose(position[1], [[1, 10, 2], [1, 10, 2], [1, 10, 0], [1, 10, -4]], atol=1e-12)


def test_a_stated_frame_rate_is_taken(tmp_path: Path) -> None:
    read(tmp_path)
    assert read_motions(tmp_path / "toy_01.amc", frame_rate=60.0)[0].frame_rate == 60.0


def test_radians_are_understood(tmp_path: Path) -> None:
    turned = AMC.replace(" 90", " 1.5707963267948966").replace(":DEGREES", ":RADIANS")
    upright = ASF.replace("axis 0 0 90", "axis 0 0 1.5707963267948966").replace("angle deg", "angle rad")
    expected = read(tmp_path).world()[1]
    np.testing.assert_allclose(read(tmp_path, turned, upright).world()[1], expected, atol=1e-12)


@pytest.mark.parametrize(
    ("found", "replacement", "line", "message"),
    [
        ("leg 0 90", "leg 0 inf", 9, "finite number"),
        ("leg 0 90", "leg 0", 9, "leg has 2 values; got 1"),
        ("leg 0 90", "arm 0 90", 9, "another bone should stand here"),
        ("leg 0 90", "", 8, "ends within frame 2"),
        ("leg 0 0", "arm 0 0", 6, "no such bone"),
        ("2\nroot", "5\nroot", 7, "the number of frame 2 should stand here"),
        ("1\nroot", "root", 4, "the number of a frame"),
    ],
)
def test_broken_frames_are_refused_with_their_line(
    tmp_path: Path, found: str, replacement: str, line: int, message: str
) -> None:
    assert found in AMC
    with pytest.raises(MotionError) as caught:
        read(tmp_path, AMC.replace(found, replacement))
    assert str(caught.value).startswith(f"{tmp_path / 'toy_01.amc'}:{line}: ")
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("found", "replacement", "line", "message"),
    [
        ("    hip leg\n", "    hip hip\n", 33, "does not hang on the root|two parents"),
        ("root hip\n    hip leg", "root root\n    leg hip\n    hip leg", 32, "two parents"),
        ("root hip\n    hip leg", "leg hip\n    hip leg", 13, "does not hang on the root"),
        ("name leg", "name hip", 20, "used twice"),
        ("dof rx rz", "dof rx rq", 26, "unknown channel"),
        ("length 0.45", "length 0", 5, "must be positive"),
        ("direction 1 0 0", "direction 1 nan 0", 16, "finite number"),
    ],
)
def test_broken_skeletons_are_refused_with_their_line(
    tmp_path: Path, found: str, replacement: str, line: int, message: str
) -> None:
    assert found in ASF
    with pytest.raises(MotionError, match=message) as caught:
        read(tmp_path, asf=ASF.replace(found, replacement))
    assert str(caught.value).startswith(f"{tmp_path / 'toy.asf'}:{line}: ")


def test_the_skeleton_is_found_by_name_and_doubt_is_told(tmp_path: Path) -> None:
    motion = read(tmp_path)
    for name in ("one.asf", "two.asf"):
        (tmp_path / name).write_text(ASF)
    assert read_motions(tmp_path / "toy_01.amc")[0].skeleton.joint_names == motion.skeleton.joint_names
    (tmp_path / "toy.asf").unlink()
    with pytest.raises(MotionError, match=r"one\.asf.*two\.asf"):
        read_motions(tmp_path / "toy_01.amc")
    assert read_motions(tmp_path / "toy_01.amc", skeleton=tmp_path / "two.asf")[0].frame_count == 2


def test_published_clips_equal_their_conversions(shared_data: Path) -> None:
    files = sorted(shared_data.rglob("*.amc"))
    assert len(files) == 19
    for path in files:
        folder = path.parent.parent if path.parent.name == "amc" else path.parent
        motion, other = read_motions(path)[0], read_motions(folder / f"{path.stem}.bvh")[0]
        order = [other.skeleton.joint_names.index(name) for name in motion.skeleton.joint_names]
        metres = motion.metres_per_unit * motion.world()[1]
        # The conversions are printed with four digits.
        np.testing.assert_allclose(metres, 0.01 * other.world()[1][:, order], atol=1e-5, err_msg=path.name)


def test_joints_stand_where_they_were_measured(shared_data: Path) -> None:
    motion = read_motions(shared_data / "cmu35" / "35_01_120fps.amc")[0]
    place = motion.skeleton.joint_names.index
    # The end of a bone is the start of the next.
    joints = [place("root"), place("lfoot"), place("ltoes"), place("head_end")]
    expected = [
        [0.2484, 1.0100, -1.1909],
        [0.3232, 0.0870, -0.8792],
        [0.3134, 0.0886, -0.7505],
        [0.2648, 1.6420, -1.1309],
    ]
    np.testing.assert_allclose(motion.metres_per_unit * motion.world()[1][0, joints], expected, atol=6e-5)
