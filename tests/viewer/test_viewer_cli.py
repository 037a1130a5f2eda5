"""Pictures and videos from the command line."""

import os
import subprocess
import sys

import numpy as np
import pytest

from crowd.cli import exit_code
from crowd.errors import CrowdError
from crowd.recording import Recording


def test_wrong_files_are_refused_before_the_run(drawing, capsys):
    pytest.importorskip("imageio_ffmpeg")
    for arguments, expected in (
        (["--video", "a.gif"], "a.gif: is no kind of video; got '.gif'; allowed .mp4"),
        (["--picture", "a.mp3"], "a.mp3: is no kind of picture; got '.mp3'"),
        (["--picture", "/no/a.png"], "--picture: there is no such folder; got '/no'"),
    ):
        assert exit_code(["run", "plaza", *arguments]) == 2
        assert capsys.readouterr().err.startswith(expected)


def test_a_video_that_fails_is_told_and_the_recording_is_finished(drawing, tmp_path, capsys, monkeypatch):
    pytest.importorskip("imageio_ffmpeg")
    from crowd_viewer.video import Film

    def fail(film, frame):
        if frame.index == 9:
            raise CrowdError("the encoder has stopped")

    monkeypatch.setattr(Film, "record", fail)
    video, recording = tmp_path / "a.mp4", tmp_path / "a.h5"
    arguments = ["run", "plaza", "--characters", 5, "--seconds", 0.5, "--threads", 1]
    arguments += ["--video", video, "--record", recording]
    assert exit_code([str(argument) for argument in arguments]) == 2
    assert capsys.readouterr().err.splitlines()[-1] == "the encoder has stopped"
    with Recording(recording) as finished:
        assert finished.frame_count == 5


def test_a_run_leaves_a_picture_a_video_and_a_recording_to_view(drawing, tmp_path, capsys):
    pytest.importorskip("imageio_ffmpeg")
    image = pytest.importorskip("PIL.Image")
    imageio = pytest.importorskip("imageio.v3")
    picture, video, recording = (tmp_path / name for name in ("a.png", "a.mp4", "a.h5"))
    arguments = ["run", "plaza", "--characters", 20, "--seconds", 0.5, "--threads", 1]
    arguments += ["--picture", picture, "--video", video, "--record", recording]
    assert exit_code([str(argument) for argument in arguments]) == 0
    pixels = np.asarray(image.open(picture))
    assert pixels.shape == (720, 1280, 3)
    assert pixels.std() > 15
    frames = imageio.imread(video)
    assert frames.shape == (15, 720, 1280, 3)
    # People move: the last picture is not the first.
    assert np.abs(frames[-1].astype(float) - frames[0]).max() > 40
    replay = tmp_path / "b.png"
    camera = '{"eye": [5, 3, 9], "target": [0, 1, 0]}'
    command = ["view", recording, "--picture", replay, "--time", 0.2, "--camera", camera]
    assert exit_code([str(argument) for argument in command]) == 0
    assert np.asarray(image.open(replay)).std() > 15
    assert capsys.readouterr().out.endswith(f"wrote {replay}\n")
    for arguments, asked in (
        (["--picture", tmp_path / "c.png", "--time", 7], "7 s"),
        (["--picture", tmp_path / "c.png", "--time", -1], "-1 s"),
        (["--picture", tmp_path / "c.png", "--time", "nan"], "nan s"),
        (["--video", tmp_path / "c.mp4", "--start", 5, "--stop", 9], "5 to 9 s"),
    ):
        assert exit_code([str(argument) for argument in ["view", recording, *arguments]]) == 2
        expected = f"{recording}: has no such time; got '{asked}'; allowed 0.03 to 0.50 s\n"
        assert capsys.readouterr().err == expected
        assert not list(tmp_path.glob("*c.*"))
    for time in (0.0, 0.51):
        assert exit_code([str(a) for a in ["view", recording, "--picture", replay, "--time", time]]) == 0
    assert exit_code([str(a) for a in ["view", recording, "--record", tmp_path / "c.h5"]]) == 2
    expected = "--record: is for trajectories of other programs; got 'the recording "
    assert capsys.readouterr().err.startswith(expected)


@pytest.mark.parametrize("ending", ["mp4", "webm", "mkv", "mov"])
def test_a_video_of_one_frame_can_be_played(drawing, tmp_path, ending):
    pytest.importorskip("imageio_ffmpeg")
    imageio = pytest.importorskip("imageio.v3")
    video = tmp_path / f"a.{ending}"
    arguments = ["run", "plaza", "--characters", "5", "--seconds", "0.01", "--video", str(video)]
    assert exit_code([*arguments, "--threads", "1"]) == 0
    frames = imageio.imread(video)
    assert frames.shape == (1, 720, 1280, 3)
    assert frames.std() > 15


def test_the_viewer_is_loaded_only_when_something_is_shown():
    loaded = "[name for name in sys.modules if name.partition('.')[0] in ('crowd_viewer', 'moderngl')]"
    code = f"import crowd.cli, sys; print({loaded})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_without_a_screen_a_window_is_refused_before_the_run(drawing):
    pytest.importorskip("glfw")
    code = "from crowd.cli import main; main(['run', 'plaza', '--view'])"
    bare = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=bare)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert line.startswith("--view: no screen to open a window on; allowed --picture")
