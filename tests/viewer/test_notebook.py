"""In a notebook a picture is seen as a picture, and a clip as a video."""

import base64
import io
import math
import re

import numpy as np
import pytest

import crowd
from crowd.errors import CrowdError
from crowd.recording import Recorder


def test_a_picture_is_an_array_that_a_notebook_shows(drawing, walkers):
    image = pytest.importorskip("PIL.Image")
    picture = drawing.render(walkers, size=(160, 96))
    assert isinstance(picture, np.ndarray)
    assert (np.asarray(image.open(io.BytesIO(picture._repr_png_()))) == picture).all()
    # Parts that are no pictures are shown as numbers.
    assert picture[..., 0]._repr_png_() is None
    assert (picture / 2)._repr_png_() is None


def test_a_clip_of_a_run_and_of_a_recording_is_a_video_in_the_page(drawing, tmp_path):
    imageio = pytest.importorskip("imageio.v3")
    pytest.importorskip("imageio_ffmpeg")
    simulation = crowd.Simulation(crowd.load_scenario("plaza"), seed=3, characters=10, threads=1)
    clip = drawing.clip(simulation, seconds=0.5, size=(160, 96))
    assert simulation.time == pytest.approx(0.5)
    page = clip._repr_html_()
    begin = page.index("base64,") + len("base64,")
    assert base64.b64decode(page[begin : page.index('"', begin)]) == clip.data
    clip.write(tmp_path / "clip.mp4")
    assert imageio.imread(tmp_path / "clip.mp4").shape == (15, 96, 160, 3)
    with Recorder(tmp_path / "run.h5", simulation) as recorder:
        for _ in range(60):
            recorder.record(simulation.step())
    with crowd.Recording(tmp_path / "run.h5") as recording:
        drawing.clip(recording, seconds=0.4, start=0.7, size=(160, 96)).write(tmp_path / "part.mp4")
        for how, what in (
            ({"seconds": math.nan}, "clip: seconds are out of range; got nan; allowed 0 to 86400 s"),
            ({"start": math.nan}, "video: start is not a number; got nan; allowed a time, s"),
            ({"frames_per_second": 0.0}, ".mp4: frames_per_second are out of range; got 0.0; allowed > 0 Hz"),
        ):
            with pytest.raises(CrowdError, match=re.escape(what)):
                drawing.clip(recording, size=(160, 96), **how)
    assert imageio.imread(tmp_path / "part.mp4").shape == (13, 96, 160, 3)


@pytest.mark.parametrize("seconds", [0, 0.0, 0.004])
def test_a_clip_without_a_frame_is_one_line(drawing, walkers, seconds):
    before = walkers.time
    with pytest.raises(CrowdError) as caught:
        drawing.clip(walkers, seconds=seconds, size=(160, 96))
    what = "clip: is shorter than a step: there is no frame to show"
    assert str(caught.value) == f"{what}; got '{seconds:g} s'; allowed >= 0.0166667 s"
    assert walkers.time == before


def test_a_film_without_a_frame_leaves_no_file(drawing, walkers, tmp_path):
    pytest.importorskip("imageio_ffmpeg")
    from crowd_viewer.video import Film, VideoWriter

    path = tmp_path / "film.mp4"
    film = Film(path, walkers, size=(160, 96))
    with pytest.raises(CrowdError, match=re.escape(f"{path}: is not written: there is no frame to show")):
        film.close()
    with pytest.raises(CrowdError, match="there is no frame to show"), VideoWriter(path):
        pass
    with pytest.raises(KeyError), VideoWriter(path):
        raise KeyError
    assert not list(tmp_path.iterdir())


def test_what_fails_first_is_told_and_not_that_the_film_is_empty(drawing, walkers, tmp_path, monkeypatch):
    pytest.importorskip("imageio_ffmpeg")
    from crowd_viewer.video import Film

    def fail():
        raise CrowdError("the step has failed")

    monkeypatch.setattr(walkers, "step", fail)
    with pytest.raises(CrowdError, match="the step has failed"):
        drawing.clip(walkers, seconds=0.5, size=(160, 96))
    with pytest.raises(KeyError), Film(tmp_path / "film.mp4", walkers, size=(160, 96)):
        raise KeyError
    with (
        pytest.raises(CrowdError, match="there is no frame to show"),
        Film(tmp_path / "film.mp4", walkers, size=(160, 96)),
    ):
        pass
