"""The window: opened under a virtual screen in a process of its own, and driven as a user would."""

import math
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from crowd_viewer.camera import Camera
from crowd_viewer.controls import CameraControls, Playback

REPOSITORY = Path(__file__).resolve().parents[2]
PROGRAM = """
import numpy as np
import crowd
import crowd_viewer
from crowd_viewer.window import Window

simulation = crowd.Simulation(crowd.load_scenario("plaza"), seed=3, characters=40, threads=1)
for _ in range(30):
    simulation.step()
with Window(simulation, size=(640, 360), quality=crowd_viewer.FINE, has_panels=False) as window:
    window.playback.is_paused = True
    window.refresh()
    plain = window.renderer.picture().astype(float)
    headless = crowd_viewer.render(simulation, camera=window.controls.camera, size=(640, 360)).astype(float)
    # Below the lines of text.
    print("like headless", np.abs(plain - headless)[60:].mean() < 0.1)
    identity, _ = window.renderer.identities(window._frame, window.controls.camera)
    rows, columns = np.nonzero(identity)
    middle = len(rows) // 2
    slot = int(identity[rows[middle], columns[middle]]) - 1
    window.pick(float(columns[middle]), float(rows[middle]))
    print("picked", window.picked == slot)
    before = window.playback.time
    window.key(",")
    print("stays", window.playback.is_paused and window.playback.time == before)
    for key in ("f", "h", *"1234567890", "b", "t"):
        window.key(key)
        window.refresh()
    print("drawn over", np.abs(window.renderer.picture() - plain).mean() > 1.0)
    window.resize(0, 0)
    window.refresh()
    window.resize(320, 200)
    window.refresh()
    print("resized", window.renderer.picture().shape == (200, 320, 3))
    print("errors", window.context.error)
    window.key("escape")
    print("open", window.is_open)
"""


@pytest.mark.skipif(shutil.which("xvfb-run") is None, reason="needs xvfb")
def test_a_window_shows_picks_and_closes():
    pytest.importorskip("glfw")
    pytest.importorskip("moderngl")
    path = os.pathsep.join(str(REPOSITORY / folder) for folder in (".", "kernels", "viewer"))
    done = subprocess.run(
        ["xvfb-run", "-a", "-s", "-screen 0 1280x720x24", sys.executable, "-c", PROGRAM],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": path},
        timeout=120,
    )
    assert done.stdout.splitlines() == [
        "like headless True",
        "picked True",
        "stays True",
        "drawn over True",
        "resized True",
        "errors GL_NO_ERROR",
        "open False",
    ], done.stderr


def test_orbiting_keeps_the_distance_and_zooming_changes_it():
    controls = CameraControls(Camera((0.0, 3.0, 8.0), (0.0, 1.0, 0.0)))
    before = math.dist(controls.camera.eye, controls.camera.target)
    controls.orbit(120.0, -40.0)
    assert math.dist(controls.camera.eye, controls.camera.target) == pytest.approx(before)
    assert controls.camera.eye[0] < -1.0
    controls.zoom(3.0)
    assert math.dist(controls.camera.eye, controls.camera.target) == pytest.approx(before * 0.88**3)


def test_looking_around_keeps_the_camera_where_it_is():
    controls = CameraControls(Camera((0.0, 3.0, 8.0), (0.0, 1.0, 0.0)))
    controls.look_around(50.0, 20.0)
    assert controls.camera.eye == (0.0, 3.0, 8.0)
    assert controls.camera.target != (0.0, 1.0, 0.0)


def test_a_followed_person_stays_where_it_is_in_the_picture():
    controls = CameraControls(Camera((0.0, 3.0, 8.0), (0.0, 1.0, 0.0)))
    places = np.array([[1.0, 0.0, 2.0], [5.0, 0.0, 0.0]])
    controls.toggle_follow(1)
    controls.follow(places)
    assert controls.camera.target == pytest.approx((5.0, 1.0, 0.0))
    offset = np.subtract(controls.camera.eye, controls.camera.target)
    controls.follow(places + [0.5, 0.0, 0.25])
    assert controls.camera.target == pytest.approx((5.5, 1.0, 0.25))
    assert np.subtract(controls.camera.eye, controls.camera.target) == pytest.approx(offset)
    controls.toggle_follow(1)
    assert controls.followed == -1


def test_the_view_from_above_goes_back_to_the_one_before():
    camera = Camera((0.0, 3.0, 8.0), (0.0, 1.0, 0.0))
    controls = CameraControls(camera)
    controls.toggle_top(30.0)
    assert not controls.camera.is_perspective
    controls.toggle_top(30.0)
    assert controls.camera == camera


def test_time_stops_steps_and_stays_within_the_recording():
    playback = Playback(first=1.0, last=3.0, time=1.0, step=0.1)
    assert playback.advance(0.5) == pytest.approx(0.5)
    playback.change_speed(1)
    assert playback.advance(0.5) == pytest.approx(1.0)
    playback.single_step(-1)
    assert (playback.time, playback.is_paused) == (pytest.approx(2.4), True)
    assert playback.advance(1.0) == 0.0
    playback.is_paused = False
    playback.advance(9.0)
    assert playback.time == 3.0


def test_a_recording_that_has_ended_begins_again():
    playback = Playback(first=1.0, last=3.0, time=3.0, is_paused=True)
    assert playback.share == 1.0
    playback.toggle()
    assert (playback.time, playback.is_paused, playback.share) == (1.0, False, 0.0)
    playback.advance(0.5)
    playback.toggle()
    assert (playback.time, playback.is_paused) == (1.5, True)
