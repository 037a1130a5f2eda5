"""What a run shows: a picture, a video, or a window. The viewer is loaded only when one is asked for."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Annotated, Protocol, Self

import typer

if TYPE_CHECKING:
    from crowd.recording import Recording
    from crowd.simulation import Frame, Simulation
    from crowd_viewer.camera import Camera


CameraText = Annotated[str | None, typer.Option(help='{"eye": [x, y, z], "target": [x, y, z]}, m.')]


class FrameSink(Protocol):
    """Whatever takes the frames of a run one after the other, in a ``with`` block."""

    def record(self, frame: Frame) -> None:
        """Take a frame."""

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Finish; after an error, this one is told and none of finishing."""


def require_viewer(
    picture: Path | None, video: Path | None, *, view: bool, camera: str | None = None
) -> Camera | None:
    """Refuse what could not be shown, before a long run begins; returns the camera that is asked for.

    Raises
    ------
    ViewerError
        Packages or OpenGL are missing; the message says what to install.
    """
    if picture is None and video is None and not view:
        return None
    from crowd.cli.output import require_folder

    require_folder("--picture", picture)
    require_folder("--video", video)
    from crowd_viewer.context import headless_context, require_moderngl

    if view:
        require_moderngl()
        from crowd_viewer.window import require_glfw

        require_glfw()
    if video is not None:
        from crowd_viewer.video import require_encoder

        require_encoder(video)
    if picture is not None:
        from crowd_viewer.picture import require_pillow

        require_pillow(picture)
    if picture is not None or video is not None:
        headless_context()
    from crowd_viewer.camera import Camera

    return None if camera is None else Camera.from_json(camera)


def film(path: Path | None, simulation: Simulation, camera: Camera | None) -> FrameSink | None:
    """What makes a video of a run."""
    if path is None:
        return None
    from crowd_viewer.video import Film

    return Film(path, simulation, camera=camera)


def draw_picture(path: Path | None, simulation: Simulation, camera: Camera | None) -> None:
    """Draw the present frame to a file."""
    if path is None:
        return
    from crowd_viewer.picture import render, write_picture

    write_picture(path, render(simulation, camera=camera))


def view(
    shown: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="Recording made by `crowd run --record`, or trajectories: JuPedSim sqlite, text or HDF5, "
            "or CSV of t, id, x, y.",
        ),
    ],
    video: Annotated[Path | None, typer.Option(help="Write a video instead of opening a window.")] = None,
    picture: Annotated[Path | None, typer.Option(help="Write a picture instead of opening a window.")] = None,
    time: Annotated[float | None, typer.Option(help="Moment of the picture, s; the last one.")] = None,
    start: Annotated[float | None, typer.Option(help="Time at which the video begins, s.")] = None,
    stop: Annotated[float | None, typer.Option(help="Time at which the video ends, s.")] = None,
    camera: CameraText = None,
    character: Annotated[
        list[Path] | None,
        typer.Option(help="Skinned glTF character for people on trajectories; may be repeated."),
    ] = None,
    record: Annotated[
        Path | None, typer.Option(help="Keep the recording of the people who walk along trajectories.")
    ] = None,
) -> int:
    """Watch a recording, or people who walk along trajectories of other programs."""
    is_window = video is None and picture is None and record is None
    chosen = require_viewer(picture, video, view=is_window, camera=camera)
    from crowd.cli.output import require_folder

    require_folder("--record", record)
    _require_trajectories(shown, record)
    with _opened(shown, record, character or []) as opened:
        if record is not None:
            print(f"wrote {record}")
        if picture is None and video is None and not is_window:
            return 0
        if picture is not None:
            from crowd_viewer.picture import render, write_picture

            write_picture(picture, render(opened, time=time, camera=chosen))
            print(f"wrote {picture}")
        if video is not None:
            from crowd_viewer.video import film_recording

            film_recording(opened, video, camera=chosen, start=start, stop=stop)
            print(f"wrote {video}")
        if is_window:
            from crowd_viewer.window import show

            show(opened, camera=chosen)
    return 0


def _require_trajectories(path: Path, record: Path | None) -> None:
    """Refuse to make a recording of a recording.

    Raises
    ------
    SettingsError
        One is asked for.
    """
    from crowd.errors import SettingsError, describe
    from crowd.trajectories.opening import is_recording

    if record is not None and is_recording(path):
        what = "is for trajectories of other programs"
        raise SettingsError(describe("--record", what, f"the recording {path}", "--picture or --video"))


def _opened(path: Path, record: Path | None, character_files: list[Path]) -> Recording:
    """Open a recording; trajectories get bodies first, with a progress bar."""
    from rich.console import Console
    from rich.progress import Progress

    from crowd.trajectories import FollowingSimulation, open_recording

    with ExitStack() as stack:
        progress: Progress | None = None

        def show(frame: Frame) -> None:
            nonlocal progress
            assert isinstance(frame.simulation, FollowingSimulation)
            if progress is None:
                progress = stack.enter_context(Progress(console=Console(stderr=True), transient=True))
                progress.add_task(f"walking along {path.name}", total=1.0)
            share = frame.time / max(frame.simulation.seconds, frame.time)
            progress.update(progress.task_ids[0], completed=share)

        return open_recording(path, record=record, character_files=character_files, on_frame=show)
