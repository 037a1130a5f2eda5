"""What can go wrong is told in a line that says what to do, and nothing else breaks."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import crowd
from crowd.cli import exit_code
from crowd.recording import Recorder

REPOSITORY = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A recording of three seconds."""
    path = tmp_path_factory.mktemp("recorded") / "run.h5"
    simulation = crowd.Simulation(crowd.load_scenario("plaza"), seed=3, characters=30, threads=1)
    with Recorder(path, simulation) as recorder:
        for _ in range(180):
            recorder.record(simulation.step())
    return path


@pytest.mark.parametrize("share", [0.999, 0.9, 0.5, 0.2, 0.01, 0.0])
def test_a_recording_cut_short_is_shown_as_far_as_it_goes_or_refused(
    drawing, recorded, tmp_path, capsys, share
):
    content = recorded.read_bytes()
    path = tmp_path / "cut.h5"
    path.write_bytes(content[: int(share * len(content))])
    code = exit_code(["view", str(path), "--picture", str(tmp_path / "cut.png")])
    told = capsys.readouterr().err
    if code == 0:
        assert (tmp_path / "cut.png").stat().st_size > 1000
    else:
        assert code == 2
        (line,) = told.splitlines()
        assert line.startswith(f"{path}: ")
        assert not (tmp_path / "cut.png").exists()


def test_a_shader_that_the_driver_refuses_is_named_with_the_log(drawing, recorded, monkeypatch, capsys):
    from crowd_viewer import programs

    whole = programs.text
    monkeypatch.setattr(
        programs, "text", lambda name: whole(name) + ("\nwrong;" if name == "sky.frag" else "")
    )
    assert exit_code(["view", str(recorded), "--picture", str(recorded.with_suffix(".png"))]) == 2
    told = capsys.readouterr().err
    assert "sky.frag: the driver cannot compile them: " in told
    assert "syntax error" in told
    assert len(told.splitlines()) == 1


def test_without_opengl_the_message_says_what_to_install_and_the_simulation_runs(tmp_path):
    pytest.importorskip("moderngl")
    code = f"""
import moderngl
def refuse(**settings): raise Exception("libEGL.so.1: cannot open shared object file")
moderngl.create_context = refuse
from crowd.cli import exit_code
run = ["run", "plaza", "--characters", "10", "--seconds", "0.2", "--threads", "1"]
print(exit_code([*run, "--picture", r"{tmp_path / "a.png"}"]), exit_code(run))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment())
    assert done.stdout.splitlines()[-1] == "2 0", done.stderr
    told = next(line for line in done.stderr.splitlines() if line.startswith("viewer: "))
    assert "no OpenGL 3.3 can be had" in told
    assert "apt install libegl1 libgl1" in told
    assert not (tmp_path / "a.png").exists()


def test_without_the_viewers_packages_the_message_names_them(tmp_path):
    code = """
import sys
sys.modules["moderngl"] = None
from crowd.cli import exit_code
exit_code(["run", "plaza", "--picture", "a.png"])
"""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=environment(), cwd=tmp_path
    )
    told = done.stderr.splitlines()[-1]
    assert told == 'viewer: moderngl is not installed; allowed pip install "crowd-engine[viewer]"'


@pytest.mark.skipif(shutil.which("xvfb-run") is None, reason="needs xvfb")
@pytest.mark.parametrize("missing", ["PIL", "imgui_bundle"])
def test_a_window_opens_without_a_font_and_without_panels(drawing, recorded, missing):
    pytest.importorskip("glfw")
    code = f"""
import sys
sys.modules["{missing}"] = None
import crowd
from crowd_viewer.window import Window
with Window(crowd.Recording(r"{recorded}"), size=(320, 200)) as window:
    for key in ("h", "p", "b", "space"):
        window.key(key)
        window.refresh()
    print(window.renderer.picture().std() > 15, window.context.error)
"""
    screen = ["xvfb-run", "-a", "-s", "-screen 0 640x400x24"]
    done = subprocess.run(
        [*screen, sys.executable, "-c", code], capture_output=True, text=True, env=environment(), timeout=120
    )
    assert done.stdout.splitlines() == ["True GL_NO_ERROR"], done.stderr
    has_told = "no text in the window" in done.stderr
    assert has_told == (missing == "PIL")


def environment():
    """Variables for a process of its own."""
    path = os.pathsep.join(str(REPOSITORY / folder) for folder in (".", "kernels", "viewer"))
    return {**os.environ, "PYTHONPATH": path}
