"""A real window, driven by real events of mouse and keys, its pictures compared with headless ones."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import crowd
from crowd.recording import Recorder

REPOSITORY = Path(__file__).resolve().parents[2]
EXPECTED = """\
scrubbed to True
picked True
layer True
layer off True
orbited True
nearer True
flies True
stops without the focus True
lives at one pixel True
resized True
back from the bar True
closed 0
runs True
closed 0
kept True
"""


@pytest.mark.skipif(
    shutil.which("xvfb-run") is None or shutil.which("xdotool") is None, reason="needs xvfb and xdotool"
)
def test_mouse_and_keys_do_what_they_say(drawing, tmp_path):
    for package in ("glfw", "PIL"):
        pytest.importorskip(package)
    simulation = crowd.Simulation(crowd.load_scenario("plaza"), seed=3, characters=40, threads=1)
    with Recorder(tmp_path / "run.h5", simulation) as recorder:
        for _ in range(180):
            recorder.record(simulation.step())
    path = os.pathsep.join(str(REPOSITORY / folder) for folder in (".", "kernels", "viewer"))
    driver = Path(__file__).with_name("window_driver.py")
    screen = ["xvfb-run", "-a", "-s", "-screen 0 1280x720x24"]
    done = subprocess.run(
        [*screen, sys.executable, driver, tmp_path / "run.h5"],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": path},
        timeout=300,
    )
    shown = [line for line in done.stdout.splitlines() if line.rpartition(" ")[2] in ("True", "False", "0")]
    assert shown == EXPECTED.splitlines(), done.stdout + done.stderr
