"""`crowd motions`: what an import and a library say, on clips that the engine itself exported."""

import json

import pytest

import crowd
from crowd.cli import exit_code
from crowd.export import Selection, export
from crowd.motion.clip import ClipKind
from crowd.motion.library_file import load_library
from crowd.recording import Recorder, Recording
from crowd.scenario.load import scenario_from
from crowd.scenario.source import ScenarioSource

pytestmark = pytest.mark.xdist_group("export")
WALK = {
    "world": {"bounds": {"x": [-20, 20], "z": [-20, 20]}},
    "characters": [{"position": [0, -12], "facing": 0, "goals": [{"position": [0, 12]}]}],
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """BVH of somebody who walks ahead, a licence beside it, and a file that is no motion."""
    place = tmp_path_factory.mktemp("clips")
    simulation = crowd.Simulation(scenario_from(WALK, ScenarioSource()), seed=1)
    simulation.commands.set_locomotion(0, (1.3, 0.0, 0.0))
    for _ in simulation.run(seconds=3.0):
        pass
    with Recorder(place / "run.h5", simulation) as recorder:
        for frame in simulation.run(seconds=4.0):
            recorder.record(frame)
    with Recording(place / "run.h5") as recording:
        export(Selection(recording), "bvh", place / "clips")
    clip = place / "clips" / "a_clip_whose_name_is_so_long_that_no_narrow_terminal_shows_it_all.bvh"
    (place / "clips" / "person_0000.bvh").rename(clip)
    (place / "clips" / "LICENSE.txt").write_text("Free for all.")
    (place / "clips" / "broken.bvh").write_text("HIERARCHY\nROOT")
    return place


def test_an_import_prints_what_it_found_and_the_library_shows_it(folder, tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "60")
    out, picture, labels = tmp_path / "mine.h5", tmp_path / "mine.png", tmp_path / "labels.toml"
    options = ["--out", str(out), "--write-labels", str(labels)]
    has_plots = True
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        has_plots = False
    options += ["--picture", str(picture)] if has_plots else []
    assert exit_code(["motions", "import", str(folder / "clips"), *options]) == 0
    printed = capsys.readouterr().out
    assert "joints named like crowd engine" in printed
    assert "\u2026" not in printed
    (row,) = [line for line in printed.splitlines() if line.strip().startswith("a_clip")]
    assert float(row.split()[2]) == pytest.approx(1.3, rel=0.03)
    assert "strikes" in printed
    assert "walking backward" in printed
    assert "not usable: broken.bvh" in printed
    assert "realised against asked motion at 1" in printed
    assert picture.is_file() == has_plots
    library = load_library(out)
    assert library.licence.strip().endswith("Free for all.")
    assert library.calibration.speed_rms_relative < 0.03
    assert library.calibration.turn_rms_deg_s < 1.5
    assert library.calibration.drift_mean_m < 0.02
    assert exit_code(["motions", "show", str(out), "--licence"]) == 0
    shown = capsys.readouterr().out
    assert "Free for all." in shown
    assert "\u2026" not in shown
    assert "realised against asked motion at 1" in shown
    assert exit_code(["motions", "import", str(folder / "clips"), *options, "--labels", str(labels)]) == 0
    metrics = tmp_path / "m.json"
    run = ["run", "plaza", "--motions", str(out), "--seconds", "2", "--metrics", str(metrics)]
    assert exit_code([*run, "--characters", "20"]) == 0
    assert json.loads(metrics.read_text())["characters"] == 20


def test_a_folder_of_clips_is_a_library_too(folder, tmp_path):
    metrics = tmp_path / "m.json"
    run = ["run", "plaza", "--motions", str(folder / "clips"), "--seconds", "1", "--metrics", str(metrics)]
    assert exit_code([*run, "--characters", "10"]) == 0
    assert exit_code(["run", "plaza", "--motions", str(tmp_path), "--seconds", "1"]) == 2


def test_labels_choose_what_a_clip_serves(folder, tmp_path, capsys):
    clip = next(path.stem for path in (folder / "clips").iterdir() if path.stem.startswith("a_clip"))
    labels = tmp_path / "labels.toml"
    labels.write_text(f"[{clip}]\nkind = 'gesture'\nbegin = 0.5\nend = 2.5\n")
    out = tmp_path / "mine.h5"
    options = ["--out", str(out), "--labels", str(labels), "--no-calibrate", "--no-fill"]
    assert exit_code(["motions", "import", str(folder / "clips"), *options]) == 0
    (found,) = load_library(out).clips
    assert found.kind is ClipKind.GESTURE
    assert found.duration == pytest.approx(2.0, abs=0.05)
    assert load_library(out).calibration is None
    assert "not measured" not in capsys.readouterr().out


def test_a_strict_import_stops_at_the_first_bad_file(folder, tmp_path, capsys):
    out = tmp_path / "mine.h5"
    assert exit_code(["motions", "import", str(folder / "clips"), "--out", str(out), "--strict"]) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert "broken.bvh:2: ends where" in line
    assert not out.exists()
