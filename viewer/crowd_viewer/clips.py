"""Short videos in memory, which a notebook shows in their place."""

from __future__ import annotations

import base64
import tempfile
from dataclasses import dataclass
from pathlib import Path

from crowd.arguments import checked_seconds
from crowd.errors import SettingsError, describe
from crowd.simulation import Simulation
from crowd_viewer.camera import Camera
from crowd_viewer.frame import Shown, opened
from crowd_viewer.quality import FINE, Quality
from crowd_viewer.video import FRAMES_PER_SECOND, Film, film_recording

CLIP_SIZE = (640, 360)


@dataclass(frozen=True)
class Clip:
    """An encoded video.

    Attributes
    ----------
    data : bytes
        Content of an MP4 file.
    size : tuple of int
        Width and height, pixels.
    """

    data: bytes
    size: tuple[int, int]

    def write(self, path: Path | str) -> None:
        """Write the file."""
        Path(path).write_bytes(self.data)

    def _repr_html_(self) -> str:
        """The video as a notebook wants it."""
        coded = base64.b64encode(self.data).decode("ascii")
        width, height = self.size
        return (
            f'<video width="{width}" height="{height}" controls loop autoplay muted '
            f'src="data:video/mp4;base64,{coded}"></video>'
        )

    def __repr__(self) -> str:
        return f"Clip of {self.size[0]} x {self.size[1]} pixels, {len(self.data) / 1e6:.2f} MB"


def clip(
    shown: Shown,
    *,
    seconds: float = 4.0,
    start: float | None = None,
    camera: Camera | None = None,
    size: tuple[int, int] = CLIP_SIZE,
    quality: Quality = FINE,
    frames_per_second: float = FRAMES_PER_SECOND,
) -> Clip:
    """Film a crowd for a notebook.

    Parameters
    ----------
    shown : Simulation, Recording, Trajectories or path
        A simulation is stepped on while it is filmed.
    seconds : float
        Length, s.
    start : float, optional
        Where to begin in a recording, s; at its beginning when left out.
    camera : Camera, optional
        One that sees the crowd when left out.
    size : tuple of int
        Width and height, pixels, even.
    quality : Quality
    frames_per_second : float

    Raises
    ------
    ViewerError
        There is no OpenGL or no encoder; the message says what to install.
    SettingsError
        It is no time, or shorter than a step of the simulation.
    """
    source = opened(shown)
    seconds = checked_seconds("clip", seconds)
    if isinstance(source, Simulation) and round(seconds / source.dt) < 1:
        what = "is shorter than a step: there is no frame to show"
        raise SettingsError(describe("clip", what, f"{seconds:g} s", f">= {source.dt:g} s"))
    with tempfile.TemporaryDirectory(prefix="crowd-") as folder:
        path = Path(folder) / "clip.mp4"
        if isinstance(source, Simulation):
            with Film(
                path,
                source,
                camera=camera,
                size=size,
                quality=quality,
                frames_per_second=frames_per_second,
            ) as film:
                for frame in source.run(seconds):
                    film.record(frame)
        else:
            begin = float(source.time[0]) if start is None and source.frame_count else start
            film_recording(
                source,
                path,
                camera=camera,
                size=size,
                quality=quality,
                frames_per_second=frames_per_second,
                start=begin,
                stop=None if begin is None else begin + seconds,
            )
        return Clip(path.read_bytes(), size)
