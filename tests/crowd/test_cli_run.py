"""Whole runs from the command line: results, refusals, Ctrl-C, kills and full disks."""

import json
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from crowd.cli import exit_code
from crowd.cli.run import measured_facts
from crowd.errors import RecordingError
from crowd.recording import Recorder, Recording
from crowd.scenario import load_scenario
from crowd.scenario.checks import METRIC_KEYS
from crowd.simulation import Simulation

REPOSITORY = Path(__file__).resolve().parents[2]
START_SECONDS = 240.0
"""Enough for a first run that compiles everything, s."""

WALK = """
[world]
bounds = { x = [-10.0, 10.0], z = [-10.0, 10.0] }

[[regions]]
count = 12
area = { x = [-9.0, -4.0], z = [-6.0, 6.0] }
goals = [{ area = { x = [2.0, 8.0], z = [-6.0, 6.0] } }, { area = { x = [-8.0, -2.0], z = [-6.0, 6.0] } }]
repeat = true
"""


def command(*arguments: object) -> list[str]:
    script = "from crowd.cli import main; main()"
    return [sys.executable, "-c", script, *map(str, arguments)]


def environment() -> dict[str, str]:
    paths = [str(REPOSITORY), str(REPOSITORY / "kernels"), str(REPOSITORY / "viewer")]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths), "COLUMNS": "200"}


def crowd(*arguments: object) -> int:
    """Run the command line in this process, where everything is compiled once; returns the exit code."""
    return exit_code([str(argument) for argument in arguments])


def started(*arguments: object) -> subprocess.Popen[str]:
    return subprocess.Popen(
        command(*arguments), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment()
    )


def wait_for_frames(path: Path, process: subprocess.Popen[str], wanted: int) -> None:
    """Wait until another process has recorded some frames."""
    end = time.monotonic() + START_SECONDS
    while time.monotonic() < end:
        assert process.poll() is None, process.communicate()
        try:
            with Recording(path) as recording:
                if recording.frame_count >= wanted:
                    return
        except RecordingError:
            pass
        time.sleep(0.05)
    process.kill()
    pytest.fail("nothing was recorded")


@pytest.fixture
def walk(tmp_path: Path) -> Path:
    path = tmp_path / "walk.toml"
    path.write_text(WALK, encoding="utf-8")
    return path


def test_a_run_writes_metrics_and_a_recording_and_a_summary(
    tmp_path: Path, walk: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    metrics, record = tmp_path / "m.json", tmp_path / "r.h5"
    code = crowd("run", walk, "--seconds", 2, "--seed", 3, "--metrics", metrics, "--record", record)
    printed = capsys.readouterr().out
    assert code == 0
    measured = json.loads(metrics.read_text())
    assert measured["scenario"] == "walk"
    assert (measured["characters"], measured["frames"], measured["seed"]) == (12, 120, 3)
    assert measured["seconds"] == pytest.approx(2.0)
    assert measured["real_time_factor"] == pytest.approx(2.0 / measured["wall_seconds"])
    assert "stopped" not in measured
    assert "real_time_factor" in printed
    assert str(metrics) in printed
    with Recording(record) as recording:
        assert recording.frame_count == 60
        assert recording.time[-1] == pytest.approx(2.0)
        assert np.abs(recording.read("position_world")).max() <= 10.0
        distance = recording.read("position_world", -1) - recording.read("position_world", 0)
        assert np.linalg.norm(distance, axis=1).max() > 0.5
        joints = recording.joint_positions_world(59)
        assert joints.shape == (12, 56, 3)
        assert 1.4 < joints[:, :, 1].max() < 2.2
    assert sorted(path.name for path in tmp_path.iterdir()) == ["m.json", "r.h5", "walk.toml"]


def test_a_recording_holds_the_joints_of_the_run(tmp_path: Path, walk: Path) -> None:
    simulation = Simulation(load_scenario(walk), seed=3)
    joints = []
    with Recorder(tmp_path / "r.h5", simulation) as recorder:
        for frame in simulation.run(seconds=1.0):
            recorder.record(frame)
            if frame.index % 2:
                joints.append(simulation.joint_positions_world())
    with Recording(tmp_path / "r.h5") as recording:
        for index in (0, 14, 29):
            assert np.abs(recording.joint_positions_world(index) - joints[index]).max() < 3e-4


def test_all_metrics_of_a_run_can_be_expected(walk: Path) -> None:
    simulation = Simulation(load_scenario(walk))
    for _ in simulation.run(seconds=4.0):
        pass
    measured = measured_facts(simulation, 1.0, 0.0, was_stopped=False)
    numbers = {key for key, value in measured.items() if not isinstance(value, str)}
    assert {"foot_slip.mean_m", "overlap.max_depth_m", "finished"} <= numbers
    assert numbers <= set(METRIC_KEYS)


def test_the_number_of_people_can_be_chosen(tmp_path: Path, walk: Path) -> None:
    metrics = tmp_path / "m.json"
    assert crowd("run", walk, "--seconds", 0.1, "--characters", 30, "--threads", 1, "--metrics", metrics) == 0
    assert json.loads(metrics.read_text())["characters"] == 30


def test_check_fails_a_run_that_is_not_as_expected(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "hopeless.toml"
    path.write_text(WALK + "\n[expect]\nfinished = { min = 1.0 }\n", encoding="utf-8")
    assert crowd("run", path, "--seconds", 0.5) == 0
    assert "not met" in capsys.readouterr().out
    assert crowd("run", path, "--seconds", 0.5, "--check") == 1


def test_a_run_without_a_length_ends_when_all_have_arrived(tmp_path: Path) -> None:
    path, metrics = tmp_path / "short.toml", tmp_path / "m.json"
    path.write_text(
        "seconds = 60.0\n[world]\nbounds = { x = [-5.0, 5.0], z = [-5.0, 5.0] }\n"
        "[[characters]]\nposition = [0.0, 0.0]\ngoals = [{ position = [0.0, 2.0] }]\n",
        encoding="utf-8",
    )
    assert crowd("run", path, "--metrics", metrics) == 0
    measured = json.loads(metrics.read_text())
    assert measured["finished"] == 1.0
    assert 1.0 < measured["seconds"] < 6.0


def test_a_goal_that_cannot_be_reached_stops_before_anything_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(
        """
[world]
bounds = { x = [-10.0, 10.0], z = [-10.0, 10.0] }
walls = [{ points = [[2.0, 2.0], [6.0, 2.0], [6.0, 6.0], [2.0, 6.0], [2.0, 2.0]] }]

[[characters]]
position = [0.0, 0.0]
goals = [{ position = [4.0, 4.0] }]
""",
        encoding="utf-8",
    )
    assert crowd("run", path, "--record", tmp_path / "r.h5", "--metrics", tmp_path / "m.json") == 2
    (line,) = [line for line in capsys.readouterr().err.splitlines() if line.strip()]
    assert line.startswith(
        "cell.toml: line 8: characters[0].goals[0]: goal cannot be reached; got [4.0, 4.0]"
    )
    assert sorted(tmp_path.iterdir()) == [path]


def test_an_unknown_clip_is_named_with_its_key(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "clip.toml"
    path.write_text(WALK + 'gestures = ["wawe"]\n', encoding="utf-8")
    assert crowd("run", path) == 2
    (line,) = [line for line in capsys.readouterr().err.splitlines() if line.strip()]
    assert line.startswith(
        "clip.toml: line 10: regions[0].gestures[0]: unknown clip; got 'wawe'; allowed \"wave\""
    )


def test_ctrl_c_closes_the_recording_and_writes_what_was_measured(tmp_path: Path, walk: Path) -> None:
    metrics, record = tmp_path / "m.json", tmp_path / "r.h5"
    process = started("run", walk, "--seconds", 80_000, "--metrics", metrics, "--record", record)
    wait_for_frames(record, process, wanted=30)
    process.send_signal(signal.SIGINT)
    output, errors = process.communicate(timeout=60)
    assert process.returncode == 130, errors
    assert "Traceback" not in errors
    measured = json.loads(metrics.read_text())
    assert measured["stopped"] is True
    assert measured["frames"] >= 60
    assert "real_time_factor" in output
    with Recording(record) as recording:
        assert recording.frame_count == measured["frames"] // 2
        assert np.isfinite(recording.joint_positions_world(-1)).all()


def test_a_killed_run_leaves_a_readable_recording(tmp_path: Path, walk: Path) -> None:
    record = tmp_path / "r.h5"
    process = started("run", walk, "--seconds", 80_000, "--record", record)
    wait_for_frames(record, process, wanted=60)
    process.kill()
    process.communicate(timeout=60)
    with Recording(record) as recording:
        assert recording.frame_count >= 60
        assert np.isfinite(recording.joint_positions_world(recording.frame_count - 1)).all()
        assert np.abs(recording.read("position_world")).max() <= 10.0


def test_a_full_disk_ends_the_run_with_one_line(tmp_path: Path, walk: Path) -> None:
    record, metrics = tmp_path / "r.h5", tmp_path / "m.json"
    limit = 4 << 20
    ended = subprocess.run(
        command("run", walk, "--seconds", 80_000, "--record", record, "--metrics", metrics),
        capture_output=True,
        text=True,
        env=environment(),
        check=False,
        timeout=START_SECONDS,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)),
    )
    assert ended.returncode == 2, ended.stderr
    lines = [line for line in ended.stderr.splitlines() if str(record) in line]
    assert len(lines) == 1
    assert "cannot be written any further; the first " in lines[0]
    assert "Traceback" not in ended.stderr
    assert not metrics.exists()
    kept = int(lines[0].split("the first ")[1].split()[0])
    with Recording(record) as recording:
        assert recording.frame_count == kept > 0
        assert np.isfinite(recording.joint_positions_world(kept - 1)).all()
