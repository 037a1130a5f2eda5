"""Videos of runs and recordings, encoded while they are drawn."""

from __future__ import annotations

import math
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import numpy.typing as npt

from crowd.arguments import number
from crowd.errors import SettingsError, describe
from crowd.recording import Recording
from crowd_viewer.camera import Camera
from crowd_viewer.context import INSTALL, ViewerError, headless_context
from crowd_viewer.frame import LiveSource, ReplaySource
from crowd_viewer.picture import default_camera
from crowd_viewer.quality import FINE, Quality
from crowd_viewer.renderer import Renderer

if TYPE_CHECKING:
    from crowd.simulation import Frame, Simulation

FRAMES_PER_SECOND = 30.0
SIZE = (1280, 720)
ENDINGS = (".mp4", ".webm", ".mkv", ".mov")
CODECS = {".webm": "libvpx-vp9"}


def require_encoder(path: Path) -> Any:
    """The module that encodes, for a file of this name.

    Raises
    ------
    ViewerError
        It is not installed, or cannot make such files.
    """
    if path.suffix.lower() not in ENDINGS:
        raise ViewerError(describe(str(path), "is no kind of video", path.suffix, ", ".join(ENDINGS)))
    try:
        import imageio_ffmpeg  # type: ignore[import-untyped,unused-ignore]
    except ImportError as error:
        raise ViewerError(describe(str(path), "imageio-ffmpeg is not installed", allowed=INSTALL)) from error
    return imageio_ffmpeg


class VideoWriter:
    """Encodes pictures; use it in a ``with`` block.

    Parameters
    ----------
    path : Path
        Ends in .mp4, .webm, .mkv or .mov; an existing file is replaced.
    size : tuple of int
        Width and height, even.
    frames_per_second : float

    Raises
    ------
    ViewerError
        There is no encoder, the size is odd, or the rate is none.
    """

    def __init__(
        self, path: Path, size: tuple[int, int] = SIZE, frames_per_second: float = FRAMES_PER_SECOND
    ) -> None:
        encoder = require_encoder(path)
        if size[0] % 2 or size[1] % 2:
            raise ViewerError(describe(str(path), "width and height of a video are even", size))
        if not 0.0 < number(str(path), "frames_per_second", frames_per_second, "> 0 Hz") < math.inf:
            what = "frames_per_second are out of range"
            raise ViewerError(describe(str(path), what, frames_per_second, "> 0 Hz"))
        self.path = path
        presets = [] if path.suffix.lower() == ".webm" else ["-preset", "veryfast"]
        self._process = encoder.write_frames(
            str(path),
            size,
            fps=frames_per_second,
            codec=CODECS.get(path.suffix.lower(), "libx264"),
            quality=None,
            macro_block_size=2,
            output_params=["-crf", "20", *presets],
            ffmpeg_log_level="error",
        )
        self._has_begun = False

    def write(self, picture: npt.NDArray[np.uint8]) -> None:
        """Append a picture.

        Raises
        ------
        ViewerError
            The encoder has stopped, for example because the disk is full.
        """
        try:
            if not self._has_begun:
                # The encoder makes the file as soon as it runs: one without pictures would be unreadable.
                self._process.send(None)
                self._has_begun = True
            self._process.send(np.ascontiguousarray(picture))
        except (OSError, StopIteration) as error:
            raise ViewerError(
                describe(str(self.path), "cannot be written", str(error).splitlines()[0])
            ) from error

    def close(self) -> None:
        """Finish the file.

        Raises
        ------
        ViewerError
            There was no picture, so there is no file.
        """
        self._process.close()
        if not self._has_begun:
            raise ViewerError(describe(str(self.path), "is not written: there is no frame to show"))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None or self._has_begun:
            self.close()


class Film:
    """Films a simulation: hand it every frame, it draws those that are due; use it in a ``with`` block.

    Parameters
    ----------
    path : Path
    simulation : Simulation
    camera : Camera, optional
        One that sees the crowd as it is now when left out.
    size : tuple of int
    quality : Quality
    frames_per_second : float
    """

    def __init__(
        self,
        path: Path,
        simulation: Simulation,
        *,
        camera: Camera | None = None,
        size: tuple[int, int] = SIZE,
        quality: Quality = FINE,
        frames_per_second: float = FRAMES_PER_SECOND,
    ) -> None:
        self._source = LiveSource(simulation)
        self._camera = camera or default_camera(self._source.scene, self._source.places(), size)
        self._renderer = Renderer(headless_context(), self._source.scene, size, quality)
        self._writer = VideoWriter(path, size, frames_per_second)
        self._interval = 1.0 / frames_per_second
        self._begin: float | None = None
        self._written = 0

    def record(self, frame: Frame) -> None:
        """Draw a frame as often as its time asks for, the first always: no player opens an empty video."""
        if self._begin is None:
            self._begin = frame.time
        due = 1 + int((frame.time - self._begin) / self._interval + 1e-6)
        if due > self._written:
            self._renderer.draw(self._source.frame(), self._camera)
            picture = self._renderer.picture()
            for _ in range(due - self._written):
                self._writer.write(picture)
            self._written = due

    def close(self) -> None:
        """Finish the file.

        Raises
        ------
        ViewerError
            No frame was recorded, so there is no file.
        """
        self._renderer.release()
        self._writer.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self.close()
        except (ViewerError, OSError):
            # What went wrong first is told.
            if error is None:
                raise


def film_recording(
    recording: Recording,
    path: Path,
    *,
    camera: Camera | None = None,
    size: tuple[int, int] = SIZE,
    quality: Quality = FINE,
    frames_per_second: float = FRAMES_PER_SECOND,
    start: float | None = None,
    stop: float | None = None,
) -> int:
    """Make a video of a recording, or of its part from `start` to `stop`, s; returns the number of pictures.

    Raises
    ------
    ViewerError
        The recording is empty, or has nothing between these times.
    SettingsError
        A time is no number.
    """
    source = ReplaySource(recording)
    # A recording that was cut short simply ends earlier.
    first, last = float(recording.time[0]), float(recording.time[-1])
    for name, moment in (("start", start), ("stop", stop)):
        if moment is not None and math.isnan(number("video", name, moment, "a time, s")):
            raise SettingsError(describe("video", f"{name} is not a number", moment, "a time, s"))
    begin, end = max(first, first if start is None else start), min(last, last if stop is None else stop)
    if end < begin:
        got = f"{first if start is None else start:g} to {last if stop is None else stop:g} s"
        allowed = f"{first:.2f} to {last:.2f} s"
        raise ViewerError(describe(str(recording.path), "has no such time", got, allowed))
    chosen = camera or default_camera(source.scene, source.places(begin, end), size)
    with (
        VideoWriter(path, size, frames_per_second) as writer,
        Renderer(headless_context(), source.scene, size, quality) as renderer,
    ):
        times = np.arange(begin, end + 1e-6, 1.0 / frames_per_second)
        for time in times:
            renderer.draw(source.frame(float(time)), chosen)
            writer.write(renderer.picture())
    return len(times)
