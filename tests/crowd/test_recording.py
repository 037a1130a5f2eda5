"""Recordings: what is written is read back, also after the writer was killed or the disk was full."""

import errno
import os
import subprocess
import sys
import textwrap
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import h5py
import numpy as np
import pytest

from crowd.characters import Cast
from crowd.errors import RecordingError, SettingsError
from crowd.motion.skeleton import Segment, Skeleton
from crowd.recording import STATE_FIELDS, Recorder, Recording
from crowd.scenario import load_scenario
from crowd.state import State
from crowd.world.objects import Objects

REPOSITORY = Path(__file__).resolve().parents[2]
COUNT = 5
JOINTS = 4


def small_skeleton() -> Skeleton:
    """Pelvis, spine, head and one leg."""
    segment = np.array([Segment.PELVIS, Segment.TORSO, Segment.NECK_HEAD, Segment.LEG], np.int32)
    offset = np.array([[0, 0.9, 0], [0, 0.3, 0], [0, 0.4, 0.1], [0.1, -0.1, 0]])
    parent = np.array([-1, 0, 1, 0], np.int32)
    limit = np.ones((JOINTS, 3))
    return Skeleton(("pelvis", "spine_1", "head", "left_thigh"), parent, offset, segment, -limit, limit, 1.7)


class SmallRun:
    """As much of a simulation as a recorder reads, with random state."""

    def __init__(self, seed: int = 0, count: int = COUNT, bodies: str = "people") -> None:
        self.rng = np.random.default_rng(seed)
        self.scenario = load_scenario("corridor")
        self.bodies, self.seed, self.dt, self.count = bodies, seed, 1 / 60, count
        self.state = State.create(count)
        self.rotation = np.zeros((count, JOINTS, 4), np.float32)
        self.pelvis = np.zeros((count, 3), np.float32)
        people = SimpleNamespace(
            radius=np.full(count, 0.25),
            preferred_speed=np.full(count, 1.3),
            stature=np.full(count, 1.7),
            segment_scale=self.rng.uniform(0.9, 1.1, (count, len(Segment))).astype(np.float32),
        )
        placed = SimpleNamespace(name=tuple(f"person {row}" for row in range(count)))
        self.model = SimpleNamespace(
            skeleton=small_skeleton(),
            people=people,
            placed=placed,
            cast=Cast.of_nobody(count),
            objects=Objects.none(),
        )

    def frame(self, index: int) -> Any:
        """Draw a new state."""
        for name, field in STATE_FIELDS.items():
            array = getattr(self.state, name)
            array[...] = self.rng.uniform(-3, 3, array.shape) if field.dtype != np.bool_ else True
        rotation = self.rng.normal(size=(self.count, JOINTS, 4))
        self.rotation = (rotation / np.linalg.norm(rotation, axis=2, keepdims=True)).astype(np.float32)
        self.pelvis = self.rng.uniform(-1, 1, (self.count, 3)).astype(np.float32)
        return SimpleNamespace(index=index, time=(index + 1) * self.dt, simulation=self)

    def joint_rotations_local(self) -> Any:
        return self.rotation

    def pelvis_positions_root(self) -> Any:
        return self.pelvis


def matrix(quaternion: Any) -> Any:
    w, x, y, z = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def test_every_field_is_read_back(tmp_path: Path) -> None:
    run = SmallRun()
    kept: dict[str, list[Any]] = {name: [] for name in STATE_FIELDS}
    rotations = []
    with Recorder(tmp_path / "a.h5", run, every=2) as recorder:  # type: ignore[arg-type]
        for index in range(150):
            recorder.record(run.frame(index))
            if index % 2:
                rotations.append(run.rotation)
                for name in kept:
                    kept[name].append(getattr(run.state, name).copy())
    with Recording(tmp_path / "a.h5") as recording:
        assert recording.frame_count == 75
        assert recording.path.stat().st_size < 200_000
        assert np.allclose(recording.time, np.arange(1, 76) / 30)
        for name, values in kept.items():
            read = recording.read(name)
            assert read.shape == np.shape(values)
            tolerance = 1e-6 if read.dtype == np.float32 else 0.0
            assert np.abs(read.astype(float) - np.array(values, float)).max() <= tolerance, name
        for frame in (0, 40, 74):
            difference = recording.joint_rotations_local(frame) - rotations[frame]
            angle = 2 * np.linalg.norm(difference, axis=2)
            assert angle.max() < 1e-4


def test_what_stays_the_same_is_read_back(tmp_path: Path) -> None:
    run = SmallRun()
    with Recorder(tmp_path / "a.h5", run):  # type: ignore[arg-type]
        pass
    with Recording(tmp_path / "a.h5") as recording:
        assert recording.frame_count == 0
        assert recording.scenario_name == "corridor"
        assert "Two streams of sixty" in recording.scenario_text
        assert (recording.seed, recording.every, recording.bodies) == (0, 2, "people")
        assert recording.frame_seconds == pytest.approx(1 / 30)
        assert recording.names[3] == "person 3"
        assert np.array_equal(recording.segment_scale, run.model.people.segment_scale)
        assert recording.skeleton.joint_names == run.model.skeleton.joint_names
        assert np.array_equal(recording.skeleton.offset, run.model.skeleton.offset)
        assert recording.walls.tolist() == [
            [[-2.5, 0, -25], [-2.5, 0, 25]],
            [[2.5, 0, -25], [2.5, 0, 25]],
        ]
        assert np.isinf(recording.wall_disappear_at).all()


def test_joint_positions_follow_from_pose_and_proportions(tmp_path: Path) -> None:
    run = SmallRun(seed=4)
    with Recorder(tmp_path / "a.h5", run, every=1) as recorder:  # type: ignore[arg-type]
        recorder.record(run.frame(0))
    skeleton, state = run.model.skeleton, run.state
    with Recording(tmp_path / "a.h5") as recording:
        found = recording.joint_positions_world(0)
    for row in range(COUNT):
        scale = run.model.people.segment_scale[row]
        half = state.yaw[row] / 2
        root = matrix((np.cos(half), 0, np.sin(half), 0))
        rotation, position = {}, {}
        for joint in range(JOINTS):
            local = matrix(run.rotation[row, joint].astype(float))
            if joint == 0:
                rotation[joint] = root @ local
                position[joint] = state.position_world[row] + root @ run.pelvis[row]
            else:
                parent = int(skeleton.parent[joint])
                rotation[joint] = rotation[parent] @ local
                offset = skeleton.offset[joint] * scale[skeleton.segment[joint]]
                position[joint] = position[parent] + rotation[parent] @ offset
            assert np.allclose(found[row, joint], position[joint], atol=2e-4)


def test_frames_are_read_by_number_and_slice(tmp_path: Path) -> None:
    run = SmallRun()
    with Recorder(tmp_path / "a.h5", run, every=1) as recorder:  # type: ignore[arg-type]
        for index in range(10):
            recorder.record(run.frame(index))
    with Recording(tmp_path / "a.h5") as recording:
        whole = recording.read("position_world")
        assert np.array_equal(recording.read("position_world", -1), whole[-1])
        assert np.array_equal(recording.read("position_world", slice(2, 8, 3)), whole[2:8:3])
        assert [round(time * 60) for time, _ in recording.frames()] == list(range(1, 11))
        with pytest.raises(RecordingError, match=r"has no such frame; got 10; allowed 0 to 9"):
            recording.read("position_world", 10)
        with pytest.raises(
            RecordingError, match=r"holds no such quantity; got 'position'; allowed .*position_world"
        ):
            recording.read("position")


def test_plain_discs_have_no_pose(tmp_path: Path) -> None:
    run = SmallRun(bodies="discs")
    with Recorder(tmp_path / "a.h5", run, every=1) as recorder:  # type: ignore[arg-type]
        recorder.record(run.frame(0))
    with Recording(tmp_path / "a.h5") as recording:
        assert "position_world" in recording.fields
        assert "rotation_local" not in recording.fields


def test_a_recording_is_read_while_it_is_written(tmp_path: Path) -> None:
    run = SmallRun()
    with Recorder(tmp_path / "a.h5", run, every=1) as recorder:  # type: ignore[arg-type]
        for index in range(130):
            recorder.record(run.frame(index))
        script = (
            "import sys; from crowd.recording import Recording; print(Recording(sys.argv[1]).frame_count)"
        )
        reader = subprocess.run(
            [sys.executable, "-c", script, str(tmp_path / "a.h5")],
            capture_output=True,
            text=True,
            env=environment(),
            check=False,
        )
        assert reader.stdout.strip() == "120", reader.stderr


def environment() -> dict[str, str]:
    paths = [str(REPOSITORY), str(REPOSITORY / "kernels"), str(REPOSITORY / "tests" / "crowd")]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}


def run_writer(body: str, path: Path) -> subprocess.CompletedProcess[str]:
    """Run a writer of its own process, which ends as `body` says."""
    script = textwrap.dedent(
        """
        import os, resource, signal, sys
        from test_recording import SmallRun
        from crowd.errors import RecordingError
        from crowd.recording import Recorder
        run = SmallRun(count=40)
        recorder = Recorder(sys.argv[1], run, every=1)
        """
    ) + textwrap.dedent(body)
    return subprocess.run(
        [sys.executable, "-c", script, str(path)],
        capture_output=True,
        text=True,
        env=environment(),
        check=False,
        timeout=60,
    )


def test_a_killed_writer_leaves_a_readable_file(tmp_path: Path) -> None:
    path = tmp_path / "killed.h5"
    ended = run_writer(
        """
        for index in range(200):
            recorder.record(run.frame(index))
        os.kill(os.getpid(), signal.SIGKILL)
        """,
        path,
    )
    assert ended.returncode == -9
    run = SmallRun(count=40)
    positions = []
    for index in range(180):
        run.frame(index)
        positions.append(run.state.position_world.copy())
    with Recording(path) as recording:
        assert recording.frame_count == 180
        assert np.array_equal(recording.read("position_world"), np.array(positions))
        assert np.isfinite(recording.joint_positions_world(179)).all()


def test_a_full_disk_gives_one_line_and_keeps_what_was_written(tmp_path: Path) -> None:
    path = tmp_path / "full.h5"
    ended = run_writer(
        """
        limit = os.path.getsize(sys.argv[1]) + 3_000_000
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
        try:
            for index in range(5000):
                recorder.record(run.frame(index))
        except RecordingError as error:
            print(error)
            recorder.close()
            sys.exit(2)
        """,
        path,
    )
    assert ended.returncode == 2, ended.stderr
    assert ended.stderr == ""
    (line,) = ended.stdout.splitlines()
    assert "full.h5: cannot be written any further; the first " in line
    assert line.endswith("frames are kept; got 'File too large'")
    kept = int(line.split("the first ")[1].split()[0])
    assert kept >= 60
    with Recording(path) as recording:
        assert recording.frame_count == kept
        for name in recording.fields:
            assert len(recording.read(name)) == kept
        assert np.isfinite(recording.joint_positions_world(kept - 1)).all()


def test_a_disk_that_fills_during_a_write_keeps_the_blocks_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = SmallRun()
    recorder = Recorder(tmp_path / "a.h5", run, every=1)  # type: ignore[arg-type]
    for index in range(119):
        recorder.record(run.frame(index))
    resize = h5py.Dataset.resize

    def fail_late(dataset: h5py.Dataset, *args: Any, **named: Any) -> None:
        if dataset.name == "/frames/yaw":
            raise OSError("Can't write data (file write failed: error message = 'No space left on device')")
        resize(dataset, *args, **named)

    monkeypatch.setattr(h5py.Dataset, "resize", fail_late)
    with pytest.raises(RecordingError) as caught:
        recorder.record(run.frame(119))
    assert str(caught.value).endswith("the first 60 frames are kept; got 'No space left on device'")
    recorder.close()
    with Recording(tmp_path / "a.h5") as recording:
        assert recording.frame_count == 60
        assert all(len(recording.read(name)) == 60 for name in recording.fields)


def test_a_recording_that_cannot_begin_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_room(*args: Any) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "posix_fallocate", no_room)
    with pytest.raises(RecordingError, match="cannot be written; got 'No space left on device'"):
        Recorder(tmp_path / "a.h5", SmallRun())  # type: ignore[arg-type]
    assert list(tmp_path.iterdir()) == []


def test_what_is_no_recording_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="no such recording"):
        Recording(tmp_path / "absent.h5")
    (tmp_path / "text.h5").write_text("hello")
    with pytest.raises(RecordingError, match="is not a recording"):
        Recording(tmp_path / "text.h5")
    with h5py.File(tmp_path / "other.h5", "w", libver="latest") as file:
        file["x"] = 1
    with pytest.raises(RecordingError, match="is not a recording"):
        Recording(tmp_path / "other.h5")
    with pytest.raises(RecordingError, match="cannot be written"):
        Recorder(tmp_path / "no folder" / "a.h5", SmallRun())  # type: ignore[arg-type]
    with pytest.raises(SettingsError, match="every: must be positive; got 0"):
        Recorder(tmp_path / "a.h5", SmallRun(), every=0)  # type: ignore[arg-type]
