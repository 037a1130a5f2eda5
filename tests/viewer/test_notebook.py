"""In a notebook a picture is seen as a picture, and a clip as a video."""

import base64
import io

import numpy as np
import pytest

import crowd
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
    assert imageio.imread(tmp_path / "part.mp4").shape == (13, 96, 160, 3)
