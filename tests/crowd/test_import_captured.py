"""Captured sets come in whole: parameters, contacts, jumps and reaches as published tables have them.

The figures are those measured on the same files for the collection that the files come from.
"""

import math
import re
from dataclasses import astuple, replace
from pathlib import Path

import numpy as np
import pytest

import crowd
from crowd.bench.reachers import Reachers, random_targets
from crowd.bench.sweep import sweep
from crowd.cli import exit_code
from crowd.motion.body import build_skeleton
from crowd.motion.clip import ClipKind
from crowd.motion.formats import find_motion_files, read_motions
from crowd.motion.importing.folder import Request, import_motions
from crowd.motion.importing.importer import import_clip
from crowd.motion.importing.labels import write_labels
from crowd.motion.library_file import load_library, save_library
from crowd_kernels.reach_state import REACHED

DATA = Path(__file__).parents[2].parent / "shared" / "data"
SMARTBODY = DATA / "smartbody"
TABLES = DATA.parent / "reference" / "locomotion-examples.md"
pytestmark = [
    pytest.mark.skipif(not SMARTBODY.is_dir(), reason="needs the captured motion of ../shared/data"),
    pytest.mark.xdist_group("captured"),
]

LOCOMOTION_SETS = ("MaleLocomotion", "MaleMocapLocomotion", "FemaleLocomotion")
PARAMETERS = {
    "ChrUtah_Walk001": (1.349, 0, 0),
    "ChrUtah_Idle01_ToWalk01_Turn360Lf01": (0, 168.8, 0),
    "ChrUtah_Idle01_ToWalk01_Turn360Rt01": (0, -168.8, 0),
    "ChrUtah_Meander01": (0.938, 0, 0),
    "ChrUtah_Shuffle01": (0.422, 0, 0),
    "ChrUtah_Jog001": (2.875, 0, 0),
    "ChrUtah_Run001": (4.125, 0, 0),
    "ChrUtah_WalkInCircleLeft001": (1.413, 72.2, 0),
    "ChrUtah_WalkInCircleRight001": (1.392, -76.9, 0),
    "ChrUtah_WalkInTightCircleLeft001": (1.105, 168.8, 0),
    "ChrUtah_WalkInTightCircleRight001": (1.064, -168.8, 0),
    "ChrUtah_RunInCircleLeft001": (3.959, 67.5, 0),
    "ChrUtah_RunInCircleRight001": (3.882, -60, 0),
    "ChrUtah_RunInTightCircleLeft01": (3.12, 270, 0),
    "ChrUtah_RunInTightCircleRight01": (3.166, -270, 0),
    "ChrUtah_StrafeSlowRt01": (0, 0, -1.003),
    "ChrUtah_StrafeSlowLf01": (0, 0, 1.003),
    "ChrUtah_StrafeFastRt01": (0, 0, -2.125),
    "ChrUtah_StrafeFastLf01": (0, 0, 2.375),
    "ChrMarine@Jog01": (2.105, 0, 0),
    "ChrMarine@Meander01": (0.844, 0, 0),
    "ChrMarine@Run01": (3.911, 0, 0),
    "ChrMarine@RunCircleRt01": (2.271, -78.8, 0),
    "ChrMarine@RunTightCircleRt01": (1.631, -144.3, 0),
    "ChrMarine@StrafeSlowRt01": (0, 0, -0.346),
    "ChrMarine@Walk01": (1.105, 0, 0),
    "ChrMarine@WalkCircleRt01": (0.793, -44.3, 0),
    "ChrMarine@WalkTightCircleRt01": (0.539, -94.9, 0),
    "ChrMarine@Turn360Rt01": (0, -168.8, 0),
    "ChrMarine@StrafeFastRt01": (0, 0, -2.041),
    "ChrHarmony@Walk01": (0.549, 0, 0),
    "ChrHarmony@WalkCircleRt01": (0.437, -47.7, 0),
    "ChrHarmony@WalkTightCircleRt01": (0.359, -87.4, 0),
    "ChrHarmony@StrafeSlowRt01": (0, 0, -0.22),
}
STRIKES = {
    "ChrUtah_Walk001": ((0.0, 1.07), (0.53, 1.60)),
    "ChrUtah_Meander01": ((0.0, 1.53), (0.77, 2.30)),
    "ChrUtah_Run001": ((0.0, 0.67), (0.33, 1.00)),
    "ChrUtah_StrafeSlowLf01": ((0.53, 1.60), (0.0, 1.10)),
    "ChrUtah_WalkInTightCircleRight001": ((0.0, 1.07), (0.57, 1.60)),
    "ChrMarine@Walk01": ((0.53, 1.57), (0.0, 1.07)),
    "ChrMarine@Run01": ((0.27, 0.80), (0.0, 0.53)),
    "ChrMarine@Jog01": ((0.33, 1.03), (0.0, 0.70)),
    "ChrMarine@WalkCircleRt01": ((0.70, 1.97), (0.0, 1.30)),
    "ChrHarmony@Walk01": ((0.0, 1.33), (0.67, 2.00)),
    "ChrHarmony@WalkTightCircleRt01": ((0.0, 1.33), (0.63, 2.00)),
}
"""Landings of the left and of the right foot, s."""
JUMPS = {
    "JumpForwardHighMid01": (3.03, 3.60, 0.389, 1.894, -2),
    "JumpForwardLowFar01": (3.10, 3.50, 0.078, 2.509, 0),
    "JumpForwardLowNear01": (2.67, 2.87, 0.100, 1.057, 0),
    "JumpLeft45HighMid01": (3.03, 3.50, 0.289, 1.982, 48),
    "JumpLeft90LowMid01": (2.47, 2.80, 0.124, 1.511, 89),
    "JumpUpHigh01": (3.43, 3.97, 0.455, 0.039, 0),
}
"""Take-off and landing s, rise m, length m, direction deg."""


@pytest.fixture(scope="module")
def reports():
    return {
        name: import_motions(Request([SMARTBODY / name], name))
        for name in (*LOCOMOTION_SETS, "jumping", "reaching", "MocapReaching")
    }


@pytest.fixture(scope="module")
def imported(reports):
    return {entry.clip.name: entry for report in reports.values() for entry in report.imported}


def test_every_set_comes_in_without_a_table(reports):
    for name, report in reports.items():
        assert report.unusable == (), name
        assert len(report.imported) == len(find_motion_files([SMARTBODY / name]))
        licence = report.examples.library.licence
        assert "LESSER GENERAL PUBLIC LICENSE" in licence


@pytest.mark.parametrize("folder", ["cmu35", "cmu_humanoid3d", "hdm05"])
def test_every_other_clip_comes_in_without_a_table(folder):
    report = import_motions(Request([DATA / folder], folder))
    assert report.unusable == ()
    assert len(report.imported) == len(find_motion_files([DATA / folder]))


@pytest.mark.parametrize("name", PARAMETERS)
def test_parameters_are_those_of_the_tables(imported, name):
    entry = imported[name]
    forward, turn, side = PARAMETERS[name]
    assert entry.clip.kind is ClipKind.LOCOMOTION
    assert entry.captured[0] == pytest.approx(forward, rel=0.02, abs=0.005)
    assert math.degrees(entry.captured[1]) == pytest.approx(turn, abs=2.0)
    assert entry.captured[2] == pytest.approx(side, rel=0.02, abs=0.005)


@pytest.mark.parametrize("name", STRIKES)
def test_feet_land_when_the_tables_say(imported, name):
    clip = imported[name].clip
    left, right = STRIKES[name]
    found = {
        event: np.array([time for time, kind in clip.foot_events if kind.name == event])
        for event in ("RHS", "LHS")
    }
    # Clips start with a right landing; the tables count from the first frame of the file.
    assert found["RHS"] == pytest.approx(np.array(right) - right[0], abs=0.05)
    expected = np.sort(np.mod(np.array(left) - right[0], clip.duration))
    assert found["LHS"] == pytest.approx(expected, abs=0.05)


@pytest.mark.skipif(not TABLES.is_file(), reason="needs the tables of ../shared/reference")
def test_every_foot_lands_and_lifts_when_the_tables_say(imported):
    errors = {"strike": [], "leaves": []}
    for prefix, name, duration, columns in published_contacts():
        entry = imported.get(f"{prefix}{name}")
        if entry is None or entry.clip.kind is not ClipKind.LOCOMOTION:
            continue
        for foot, stances in enumerate(columns):
            for begin, end in stances:
                if end - begin < 0.08:
                    continue

                def away(time, other, period=duration):
                    return abs(math.remainder(time - other, period))

                own = [stance for stance in entry.stances if stance.foot == foot]
                nearest = min(own, key=lambda stance: away(stance.strike, begin))
                errors["strike"].append(away(nearest.strike, begin))
                errors["leaves"].append(away(nearest.leaves, end))
    for found in errors.values():
        assert len(found) > 120
        assert max(found) < 0.05


def published_contacts():
    """Prefix, clip, duration and stances of the right and the left foot in the published tables."""
    prefix = ""
    for line in TABLES.read_text("utf-8").splitlines():
        heading = re.match(r"### 3\.\d (Chr\w+)", line)
        if heading:
            prefix = heading[1] + ("_" if heading[1] == "ChrUtah" else "@")
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if line.startswith("## 4"):
            return
        if prefix and len(cells) == 7 and cells[0].isdigit() and "always" not in cells[4]:
            left, right = (
                [tuple(map(float, part.split("-"))) for part in cell.split(", ")] for cell in cells[4:6]
            )
            yield prefix, cells[1].removesuffix("_smooth"), float(cells[3]), (right, left)


@pytest.mark.parametrize(
    ("name", "left", "right"),
    [("WalkUp01", (0.533, 1.600), (0.0, 1.067, 2.067)), ("WalkUp02", (0.70, 2.17), (0.0, 1.43, 2.90))],
)
def test_tags_of_the_source_are_used(imported, name, left, right):
    events = imported[f"ChrMarine@{name}"].clip.foot_events
    for kind, expected in (("LHS", left), ("RHS", right)):
        found = [time for time, event in events if event.name == kind]
        for time in expected[:2]:
            assert min(abs(time - other) for other in found) < 0.05


@pytest.mark.parametrize("name", JUMPS)
def test_jumps_are_labelled_as_the_tables_have_them(imported, name):
    entry = imported[f"ChrGarza@IdleStand01_{name}"]
    take_off, landing, rise, length, direction = JUMPS[name]
    jump = entry.clip.jump
    assert entry.clip.kind is ClipKind.JUMP
    assert jump.take_off == pytest.approx(take_off, abs=0.05)
    assert jump.landing == pytest.approx(landing, abs=0.05)
    assert jump.rise / entry.scale == pytest.approx(rise, abs=0.01)
    assert jump.length / entry.scale == pytest.approx(length, rel=0.02, abs=0.01)
    assert math.degrees(jump.direction) == pytest.approx(direction, abs=4.0)
    assert 6.5 < entry.clip.quality.flight_gravity / entry.scale < 11.5


def test_reaches_are_recognised_with_their_apex(imported):
    far = imported["ChrGarza@IdleStand01_ReachForwardMediumFar01"].clip
    assert far.kind is ClipKind.REACH
    assert far.reach.side == "right"
    assert far.reach.hand_position[2] > 0.7
    floor = imported["ChrGarza@IdleStand01_ReachRight30Floor01"].clip.reach
    assert floor.hand_position[1] < 0.3
    high = imported["ChrHarmony_Relax001_ArmReachMiddleHigh"].clip.reach
    assert high.hand_position[1] > 1.8


@pytest.mark.parametrize(
    ("name", "apex", "up"),
    [
        ("HDM_bk_depositFloorR_007_120", 1.6, 0.05),
        ("HDM_bk_depositFloorR_011_120", 1.15, 0.07),
        ("HDM_bk_grabHighR_005_120", 1.05, 1.51),
        ("HDM_bk_grabHighR_008_120", 0.7, 1.49),
    ],
)
def test_reaches_without_tags_have_their_apex_where_the_hand_rests(name, apex, up):
    (motion,) = read_motions(DATA / "hdm05" / f"{name}.bvh")
    reach = import_clip(motion, build_skeleton()).clip.reach
    assert reach.apex == pytest.approx(apex, abs=0.15)
    assert reach.hand_position[1] == pytest.approx(up, abs=0.06)


def test_found_apexes_agree_with_the_tags():
    errors = []
    for file in find_motion_files([SMARTBODY / "MocapReaching" / "motions"]):
        (motion,) = read_motions(file)
        tagged = dict(motion.tags).get("emphasis", 0.0)
        if "Reach" not in file.name or "Jump" in file.name or tagged < 0.2:
            continue
        untold = import_clip(replace(motion, tags=()), build_skeleton())
        errors.append(abs(untold.clip.reach.apex - tagged))
    assert len(errors) > 25
    assert np.mean(errors) < 0.1
    assert np.max(errors) < 0.35


@pytest.mark.parametrize("name", ["MaleLocomotion", "jumping", "MocapReaching"])
def test_written_labels_change_nothing(reports, tmp_path, name):
    path = tmp_path / "labels.toml"
    write_labels(path, reports[name].imported)
    again = import_motions(Request([SMARTBODY / name], name, labels=path))
    for first, second in zip(reports[name].imported, again.imported, strict=True):
        one, other = first.clip, second.clip
        assert (one.name, one.kind) == (other.name, other.kind)
        assert one.parameters == pytest.approx(other.parameters, abs=1e-4)
        for label in ("jump", "reach"):
            pair = getattr(one, label), getattr(other, label)
            assert (pair[0] is None) == (pair[1] is None)
            if pair[0] is not None:
                for value, told in zip(astuple(pair[0]), astuple(pair[1]), strict=True):
                    assert value == told if isinstance(value, str) else value == pytest.approx(told, abs=1e-3)
        assert [event for _, event in one.foot_events] == [event for _, event in other.foot_events]
        for (time, _), (told, _) in zip(one.foot_events, other.foot_events, strict=True):
            assert time == pytest.approx(told, abs=1e-3)


def test_transitions_are_not_taken_for_gaits(imported):
    kinds = {name.split("@")[-1]: entry.clip.kind for name, entry in imported.items()}
    assert kinds["ChrUtah_Idle01_StepForwardLf01"] is ClipKind.STEP
    assert kinds["ChrUtah_Turn180Lf01"] is ClipKind.TURN
    assert kinds["ChrUtah_Walk001_ToIdle001"] is ClipKind.STOP
    assert kinds["Idle01_ToWalk01_Turn90Rt01"] is ClipKind.START
    assert kinds["WalkUp01"] is ClipKind.OTHER
    assert kinds["ChrUtah_WalkJumpWalk01"] is ClipKind.JUMP
    assert kinds["Run01_JumpHigh01"] is ClipKind.JUMP
    assert kinds["IdleHandOnHip01"] is ClipKind.IDLE


@pytest.mark.parametrize("name", LOCOMOTION_SETS)
def test_a_crowd_runs_on_the_set_and_its_feet_stay(reports, name, tmp_path):
    path = tmp_path / "set.h5"
    save_library(path, reports[name].examples.library)
    simulation = crowd.Simulation(crowd.load_scenario("plaza"), seed=1, motions=load_library(path))
    for _ in simulation.run(seconds=8.0):
        pass
    figures = simulation.metrics.as_dict()
    assert figures["foot_slip.mean_m"] < 0.02
    assert figures["locomotion.speed_rms_relative"] < 0.03
    assert figures["locomotion.turn_rms_deg_s"] < 1.5
    assert figures["overlap.max_depth_m"] <= 0.05


@pytest.mark.parametrize("name", LOCOMOTION_SETS)
def test_what_is_asked_is_realised_over_the_whole_space(reports, name):
    result = sweep(120, reports[name].examples.library)
    assert result.speed_rms_relative < 0.03
    assert result.turn_rms_deg_s < 1.5
    assert result.drift_mean_m < 0.02


@pytest.mark.parametrize(("name", "fewest"), [("reaching", 25), ("MocapReaching", 40)])
def test_people_reach_by_captured_reaches(name, fewest, tmp_path, rng):
    out = tmp_path / "reaches.h5"
    assert exit_code(["motions", "import", str(SMARTBODY / name), "--out", str(out), "--no-calibrate"]) == 0
    library = load_library(out)
    sides = [clip.reach.side for clip in library.of_kind(ClipKind.REACH)]
    assert min(sides.count("right"), sides.count("left")) >= fewest
    for hand in (0, 1):
        reachers = Reachers(200, 3, library)
        reachers.step()
        wanted = random_targets(reachers, hand, rng, is_far=False)
        reachers.reach(hand, wanted)
        # People take as long as the captured ones, up to five seconds.
        for _ in range(360):
            reachers.step()
        state = reachers.simulation.state
        assert np.isfinite(state.pose_rotation).all()
        assert (state.reach_status[:, hand] == REACHED).all()
        assert np.linalg.norm(reachers.hand(hand)[0] - wanted, axis=1).max() < 1e-3
    simulation = crowd.Simulation(crowd.load_scenario("seated_desk"), motions=library)
    for _ in simulation.run(seconds=45.0):
        if simulation.is_finished:
            break
    figures = simulation.metrics.as_dict()
    assert figures["tasks.failed"] == 0
    assert figures["reach.error_mm.max"] < 1.0


def test_sides_that_a_set_lacks_are_mirrored(reports):
    origin = {entry.need: entry.origin for entry in reports["MaleMocapLocomotion"].examples.coverage}
    assert origin["sidestep to the right"] == "captured"
    assert origin["sidestep to the left"] == "mirrored"
    assert origin["turning left on the spot"] == "mirrored"
    assert origin["walking backward"] == "built-in library"


def test_a_clip_and_its_other_format_say_the_same():
    skeleton = build_skeleton()
    (text,) = read_motions(DATA / "cmu35" / "35_01_120fps.amc")
    (other,) = read_motions(DATA / "cmu35" / "35_01_120fps.bvh")
    first, second = (import_clip(motion, skeleton) for motion in (text, other))
    assert first.captured == pytest.approx(second.captured, abs=2e-3)
    assert first.clip.kind is second.clip.kind is ClipKind.LOCOMOTION
    assert first.captured[0] == pytest.approx(1.28, rel=0.03)
