"""The command line's own parts: options, messages, files that appear whole, verdicts."""

import json
import os
import signal
from pathlib import Path

import pytest

from crowd.cli import exit_code
from crowd.cli.expectations import judge, metric
from crowd.cli.output import write_json
from crowd.cli.run import StopRequest
from crowd.errors import SettingsError
from crowd.scenario.schema import Bound


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["run"], "crowd: Missing argument"),
        (["run", "plaza", "--seconds", "soon"], "crowd: Invalid value for '--seconds'"),
        (["run", "plaza", "--seconds", "-1"], "--seconds: is out of range; got -1.0; allowed > 0 to 86400"),
        (["run", "plaza", "--seconds", "nan"], "--seconds: is out of range; got nan; allowed > 0 to 86400"),
        (["run", "plaza", "--seed", "9" * 20], f"seed: is out of range; got {'9' * 20}; allowed -922"),
        (["run", "plaza", "--characters", "0"], "crowd: Invalid value for '--characters'"),
        (["run", "plaza", "--threads", "0"], "crowd: Invalid value for '--threads'"),
        (["run", "plaza", "--motionz", "x"], "crowd: No such option: --motionz"),
        (["rum", "plaza"], "crowd: No such command 'rum'"),
        (
            ["run", "plazza"],
            "scenario: unknown name; got 'plazza'; allowed a .toml or .xml file, or \"plaza\"",
        ),
        (
            ["run", "plaza", "--motions", "here"],
            "here: no such motion library; `crowd motions import` makes one",
        ),
        (["run", "plaza", "--record", "/"], "--record: is a folder; got '/'"),
        (["run", "plaza", "--metrics", "/no/m.json"], "--metrics: there is no such folder; got '/no'"),
    ],
)
def test_bad_options_give_one_line_and_code_2(
    capsys: pytest.CaptureFixture[str], arguments: list[str], expected: str
) -> None:
    assert exit_code(arguments) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    (line,) = printed.err.splitlines()
    assert line.startswith(expected)


def test_every_problem_of_a_scenario_is_a_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(
        "[world]\nbounds = { x = [-5.0, 5.0], z = [-5.0, 5.0] }\n"
        "[[characters]]\nposition = [0.0, 0.0]\nradius = -1\nspede = 2\n"
    )
    assert exit_code(["run", str(path), "--metrics", str(tmp_path / "m.json")]) == 2
    assert [line.split("; ")[0] for line in capsys.readouterr().err.splitlines()] == [
        "bad.toml: line 5: characters[0].radius: is out of range",
        "bad.toml: line 6: characters[0].spede: unknown key",
    ]
    assert sorted(tmp_path.iterdir()) == [path]


def test_bundled_scenarios_are_listed(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    assert exit_code(["list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    (plaza,) = [line for line in lines if line.startswith("plaza")]
    assert "200" in plaza
    assert "Two hundred people" in plaza


def test_json_appears_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "m.json"
    write_json(path, {"a": 1})
    assert json.loads(path.read_text()) == {"a": 1}

    def no_room(self: Path, text: str, encoding: str) -> int:
        self.touch()
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_text", no_room)
    with pytest.raises(SettingsError, match=r"m\.json: cannot be written; got 'No space left on device'"):
        write_json(path, {"a": 2})
    monkeypatch.undo()
    assert json.loads(path.read_text()) == {"a": 1}
    assert list(tmp_path.iterdir()) == [path]


def test_expectations_are_judged_by_their_bounds() -> None:
    measured = {"finished": 0.9, "overlap": {"max_depth_m": 0.04}, "wall.max_depth_m": 0.0}
    expected = {
        "finished": Bound(min=1.0),
        "overlap.max_depth_m": Bound(max=0.05),
        "wall.max_depth_m": Bound(min=0.0, max=0.001),
        "foot_slip.mean_m": Bound(max=0.01),
    }
    verdicts = judge(expected, measured)
    assert [verdict.is_met for verdict in verdicts] == [False, True, True, False]
    assert [verdict.value for verdict in verdicts] == [0.9, 0.04, 0.0, None]
    assert [verdict.allowed for verdict in verdicts] == [">= 1", "<= 0.05", "0 to 0.001", "<= 0.01"]
    assert metric(measured, "overlap.p99_depth_m") is None


def test_the_first_ctrl_c_asks_and_the_second_stops() -> None:
    request = StopRequest()
    before = signal.getsignal(signal.SIGINT)
    with request.watching():
        os.kill(os.getpid(), signal.SIGINT)
        assert request.is_made
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is before


def test_benchmarks_are_part_of_the_command_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert exit_code(["bench", "--help"]) == 0
    assert "--compare" in capsys.readouterr().out
    assert exit_code(["bench", "--scenes", "nowhere"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "'nowhere'" in line


@pytest.mark.parametrize(
    ("arguments", "option"),
    [
        (["bench", "--plot", "fps.png"], "--plot"),
        (["motions", "import", "clips", "--out", "mine.h5", "--picture", "mine.png"], "--picture"),
    ],
)
def test_a_missing_matplotlib_is_told_before_the_work(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, arguments: list[str], option: str
) -> None:
    monkeypatch.setattr("crowd.bench.plot.find_spec", lambda name: None)
    monkeypatch.setattr("crowd.bench.frames.compile_kernels", lambda threads: pytest.fail("it has begun"))
    assert exit_code(arguments) == 2
    expected = f'{option}: matplotlib is not installed; allowed pip install "crowd-engine[bench]"\n'
    assert capsys.readouterr().err == expected


def test_help_names_every_option(capsys: pytest.CaptureFixture[str]) -> None:
    assert exit_code(["run", "--help"]) == 0
    text = capsys.readouterr().out
    options = "characters seconds seed motions view video picture record metrics threads check"
    assert all(f"--{option}" in text for option in options.split())
