"""Pictures without a window: one call from a simulation or a recording to an array of pixels."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import numpy.typing as npt

from crowd.errors import describe
from crowd_viewer.camera import Camera
from crowd_viewer.context import INSTALL, ViewerError, headless_context
from crowd_viewer.frame import ReplaySource, Scene, Shown, Source, source_of
from crowd_viewer.quality import FINE, Quality
from crowd_viewer.renderer import Renderer

FloatArray = npt.NDArray[np.float64]
OUTLIERS = 0.12
"""Share of people at each side who may be outside of a picture that nobody has chosen a camera for."""


class Picture(np.ndarray[tuple[int, int, int], np.dtype[np.uint8]]):
    """Pixels, (height, width, 3) uint8, the upper left one first; a notebook shows them."""

    def _repr_png_(self) -> bytes | None:
        """The picture as a notebook wants it; None for parts that are no pictures."""
        if self.ndim != 3 or self.shape[2] != 3 or self.dtype != np.uint8 or not self.size:
            return None
        from PIL import Image

        file = io.BytesIO()
        Image.fromarray(np.asarray(self)).save(file, "png")
        return file.getvalue()


def render(
    shown: Shown,
    *,
    time: float | None = None,
    camera: Camera | None = None,
    size: tuple[int, int] = (1280, 720),
    quality: Quality = FINE,
) -> Picture:
    """Draw a crowd.

    Parameters
    ----------
    shown : Simulation, Recording, Trajectories or path
    time : float, optional
        Which moment of a recording, s; the last when left out. A simulation is drawn as it is now.
    camera : Camera, optional
        One that sees the crowd when left out.
    size : tuple of int
        Width and height, pixels.
    quality : Quality

    Returns
    -------
    (height, width, 3) uint8
        The upper left pixel first; a notebook shows it as a picture.

    Raises
    ------
    ViewerError
        There is no OpenGL; the message says what to install. Or the recording has no such time.
    """
    source = source_of(shown)
    frame = source.frame(_moment(source, time))
    chosen = camera or default_camera(source.scene, frame.places, size)
    with Renderer(headless_context(), source.scene, size, quality) as renderer:
        renderer.draw(frame, chosen, keeps_levels=False)
        return renderer.picture().view(Picture)


def render_identities(
    shown: Shown,
    *,
    time: float | None = None,
    camera: Camera | None = None,
    size: tuple[int, int] = (1280, 720),
) -> tuple[npt.NDArray[np.uint32], npt.NDArray[np.float32]]:
    """Draw who is seen where, and how far away: slot + 1 or 0, and m. Both (height, width).

    Parameters are those of `render`.
    """
    source = source_of(shown)
    frame = source.frame(_moment(source, time))
    chosen = camera or default_camera(source.scene, frame.places, size)
    with Renderer(headless_context(), source.scene, size) as renderer:
        return renderer.identities(frame, chosen)


def _moment(source: Source, time: float | None) -> float | None:
    """Moment of a recording that is asked for, if it has such a moment.

    A run is asked for from its beginning on, though the first frame is recorded a little later; likewise up
    to the frame that would have followed the last one.
    """
    if time is None or not isinstance(source, ReplaySource):
        return time
    times = source.recording.time
    first, last = float(times[0]), float(times[-1])
    gap = (last - first) / max(len(times) - 1, 1)
    if not min(first, 0.0) <= time <= last + gap:
        what, allowed = f"{time:g} s", f"{first:.2f} to {last:.2f} s"
        raise ViewerError(describe(str(source.recording.path), "has no such time", what, allowed))
    return time


def default_camera(scene: Scene, places: FloatArray, size: tuple[int, int]) -> Camera:
    """See most of the places where people are, (P, 3) m, from ahead and above; the ground without any."""
    low_x, high_x, low_z, high_z = scene.bounds
    low, high = np.array([low_x, 0.0, low_z]), np.array([high_x, 0.0, high_z])
    if len(places):
        share = 100.0 * OUTLIERS if len(places) > 20 else 0.0
        low = np.percentile(places, share, axis=0) - 1.0
        high = np.percentile(places, 100.0 - share, axis=0) + 1.0
    corners = np.array([[x, 0.0, z] for x in (low[0], high[0]) for z in (low[2], high[2])])
    return Camera.framing(corners, size[0] / size[1])


def require_pillow(path: Path) -> None:
    """Check that pictures can be written.

    Raises
    ------
    ViewerError
        Pillow is missing, or knows no format with this ending.
    """
    try:
        from PIL import Image
    except ImportError as error:
        raise ViewerError(describe(str(path), "pillow is not installed", allowed=INSTALL)) from error
    known = Image.registered_extensions()
    if path.suffix.lower() not in known:
        raise ViewerError(describe(str(path), "is no kind of picture", path.suffix, ".png, .jpg, .webp"))


def write_picture(path: Path, picture: npt.NDArray[np.uint8]) -> None:
    """Write a picture; the format follows the ending.

    Raises
    ------
    ViewerError
        Pillow is missing, or the file cannot be written.
    """
    require_pillow(path)
    from PIL import Image

    try:
        Image.fromarray(picture).save(path)
    except (OSError, ValueError) as error:
        raise ViewerError(describe(str(path), "cannot be written", str(error))) from error
