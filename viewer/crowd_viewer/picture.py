"""Pictures without a window: one call from a simulation or a recording to an array of pixels."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from crowd.errors import describe
from crowd.recording import Recording
from crowd.simulation import Simulation
from crowd_viewer.camera import Camera
from crowd_viewer.context import ViewerError, headless_context
from crowd_viewer.frame import CrowdFrame, Scene, source_of
from crowd_viewer.quality import FINE, Quality
from crowd_viewer.renderer import Renderer

Picture = npt.NDArray[np.uint8]


def render(
    shown: Simulation | Recording,
    *,
    time: float | None = None,
    camera: Camera | None = None,
    size: tuple[int, int] = (1280, 720),
    quality: Quality = FINE,
) -> Picture:
    """Draw a crowd.

    Parameters
    ----------
    shown : Simulation or Recording
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
        The upper left pixel first.

    Raises
    ------
    ViewerError
        There is no OpenGL; the message says what to install.
    """
    source = source_of(shown)
    frame = source.frame(time)
    chosen = camera or default_camera(source.scene, frame, size)
    with Renderer(headless_context(), source.scene, size, quality) as renderer:
        renderer.draw(frame, chosen, keeps_levels=False)
        return renderer.picture()


def render_identities(
    shown: Simulation | Recording,
    *,
    time: float | None = None,
    camera: Camera | None = None,
    size: tuple[int, int] = (1280, 720),
) -> tuple[npt.NDArray[np.uint32], npt.NDArray[np.float32]]:
    """Draw who is seen where, and how far away: slot + 1 or 0, and m. Both (height, width).

    Parameters are those of `render`.
    """
    source = source_of(shown)
    frame = source.frame(time)
    chosen = camera or default_camera(source.scene, frame, size)
    with Renderer(headless_context(), source.scene, size) as renderer:
        return renderer.identities(frame, chosen)


def default_camera(scene: Scene, frame: CrowdFrame, size: tuple[int, int]) -> Camera:
    """See the ground of the scene, or the people where it is much larger than what they take."""
    low_x, high_x, low_z, high_z = scene.bounds
    corners = np.array(
        [[low_x, 0, low_z], [low_x, 0, high_z], [high_x, 0, low_z], [high_x, 0, high_z]], float
    )
    there = frame.position_world[frame.is_active]
    if len(there):
        low, high = there.min(axis=0) - 2.0, there.max(axis=0) + 2.0
        corners[:, [0, 2]] = np.clip(corners[:, [0, 2]], low[[0, 2]], high[[0, 2]])
    return Camera.framing(corners, size[0] / size[1])


def write_picture(path: Path, picture: Picture) -> None:
    """Write a picture; the format follows the ending.

    Raises
    ------
    ViewerError
        Pillow is missing, or the file cannot be written.
    """
    try:
        from PIL import Image
    except ImportError as error:
        allowed = 'pip install "crowd-engine[viewer]"'
        raise ViewerError(describe(str(path), "pillow is not installed", allowed=allowed)) from error
    try:
        Image.fromarray(picture).save(path)
    except (OSError, ValueError) as error:
        raise ViewerError(describe(str(path), "cannot be written", str(error))) from error
