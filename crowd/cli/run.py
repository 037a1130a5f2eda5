"""``crowd run``: run a scenario with a progress bar, and report what happened."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Generator, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Annotated, Any

import typer

from crowd.cli.showing import CameraText
from crowd.errors import SettingsError, describe

if TYPE_CHECKING:
    from crowd.cli.showing import FrameSink
    from crowd.motion.library import MotionLibrary
    from crowd.recording import Recorder
    from crowd.scenario import Scenario
    from crowd.simulation import Frame, Simulation
    from crowd_viewer.camera import Camera

EXIT_NOT_AS_EXPECTED = 1
EXIT_INTERRUPTED = 130


def run(
    scenario: Annotated[str, typer.Argument(help="Bundled name, .toml file, or SteerBench .xml file.")],
    characters: Annotated[
        int | None, typer.Option(min=1, help="Number of people, instead of the scenario's.")
    ] = None,
    seconds: Annotated[
        float | None, typer.Option(help="Simulated time; the scenario's own, or until all have arrived.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Key of all random choices.")] = 0,
    motions: Annotated[
        Path | None, typer.Option(help="Motion library made by `crowd motions import`, or a folder.")
    ] = None,
    character: Annotated[
        list[Path] | None, typer.Option(help="Skinned glTF character to draw people as; may be repeated.")
    ] = None,
    view: Annotated[bool, typer.Option("--view", help="Show the run in a window.")] = False,
    video: Annotated[Path | None, typer.Option(help="Write a video.")] = None,
    picture: Annotated[Path | None, typer.Option(help="Write a picture of the last frame.")] = None,
    camera: CameraText = None,
    record: Annotated[Path | None, typer.Option(help="Write a recording (HDF5).")] = None,
    metrics: Annotated[Path | None, typer.Option(help="Write what was measured (JSON).")] = None,
    threads: Annotated[int | None, typer.Option(min=1, help="Threads; all cores when left out.")] = None,
    check: Annotated[
        bool, typer.Option("--check", help="Leave with code 1 if the scenario's expectations are not met.")
    ] = False,
) -> int:
    """Run a scenario and print a summary."""
    if seconds is not None and not 0.0 < seconds <= 86_400.0:
        raise SettingsError(describe("--seconds", "is out of range", seconds, "> 0 to 86400"))
    from crowd.cli.output import require_folder, write_json
    from crowd.cli.showing import draw_picture, film, require_viewer
    from crowd.motion.importing.folder import load_or_import
    from crowd.scenario import load_scenario

    chosen_camera = require_viewer(picture, video, view=view, camera=camera)
    require_folder("--record", record)
    require_folder("--metrics", metrics)
    loaded = load_scenario(scenario)
    library = None if motions is None else load_or_import(motions)
    simulation, compile_seconds = _prepare(loaded, seed, threads, characters, library, character or [])
    sinks = [
        sink for sink in (_open_recorder(record, simulation), film(video, simulation, chosen_camera)) if sink
    ]
    wall_seconds, was_stopped = _advance(simulation, sinks, seconds, chosen_camera, is_shown=view)
    draw_picture(picture, simulation, chosen_camera)
    measured = measured_facts(simulation, wall_seconds, compile_seconds, was_stopped=was_stopped)
    if metrics is not None:
        write_json(metrics, measured)
    from crowd.cli.expectations import judge
    from crowd.cli.summary import print_summary

    verdicts = judge(loaded.expect, measured)
    written = [path for path in (record, metrics, video, picture) if path is not None]
    print_summary(measured, verdicts, written)
    if was_stopped:
        return EXIT_INTERRUPTED
    return EXIT_NOT_AS_EXPECTED if check and not all(verdict.is_met for verdict in verdicts) else 0


def _prepare(
    scenario: Scenario,
    seed: int,
    threads: int | None,
    characters: int | None,
    library: MotionLibrary | None,
    character_files: Sequence[Path],
) -> tuple[Simulation, float]:
    """Compile kernels with a progress line and build the simulation; also returns compile time, s."""
    from rich.console import Console

    import crowd

    console = Console(stderr=True)
    with console.status("placing people") as status:
        simulation = crowd.Simulation(
            scenario,
            seed=seed,
            threads=threads,
            characters=characters,
            motions=library,
            character_files=character_files,
        )
        begin = time.perf_counter()
        crowd.warm_up(
            lambda stage: status.update(f"compiling kernels (first run only): {stage}"),
            is_threaded=simulation.threads > 1,
        )
        compile_seconds = time.perf_counter() - begin
    return simulation, compile_seconds


def _open_recorder(path: Path | None, simulation: Simulation) -> Recorder | None:
    if path is None:
        return None
    from crowd.recording import Recorder

    return Recorder(path, simulation)


class StopRequest:
    """Whether Ctrl-C was pressed. A run asks between two steps, so that nothing is cut in the middle."""

    def __init__(self) -> None:
        self.is_made = False

    def _note(self, number: int, stack: FrameType | None) -> None:
        if self.is_made:
            raise KeyboardInterrupt
        self.is_made = True

    @contextmanager
    def watching(self) -> Iterator[StopRequest]:
        """Take over Ctrl-C and termination; a second one stops at once."""
        if threading.current_thread() is not threading.main_thread():
            yield self
            return
        numbers = (signal.SIGINT, signal.SIGTERM)
        before = [signal.signal(number, self._note) for number in numbers]
        try:
            yield self
        finally:
            for number, handler in zip(numbers, before, strict=True):
                signal.signal(number, handler)


def _advance(
    simulation: Simulation,
    sinks: Sequence[FrameSink],
    seconds: float | None,
    camera: Camera | None,
    *,
    is_shown: bool,
) -> tuple[float, bool]:
    """Step to the end with a progress bar; returns the wall time, s, and whether Ctrl-C ended it."""
    from crowd.cli.progress import RunProgress

    # People who only stand have finished from the start; their scene still goes on.
    ends_early = seconds is None and not simulation.is_finished
    frame_count = max(1, round((seconds or simulation.scenario.seconds) / simulation.dt))
    begin = time.perf_counter()
    request = StopRequest()
    with ExitStack() as opened:
        for sink in sinks:
            opened.enter_context(sink)
        frames = opened.enter_context(closing(_frames(simulation, frame_count, camera, is_shown=is_shown)))
        with request.watching(), RunProgress(simulation, frame_count) as progress:
            for frame in frames:
                for sink in sinks:
                    sink.record(frame)
                progress.advance(frame)
                if request.is_made or (ends_early and simulation.is_finished):
                    break
    return time.perf_counter() - begin, request.is_made


def _frames(
    simulation: Simulation, frame_count: int, camera: Camera | None, *, is_shown: bool
) -> Generator[Frame, None, None]:
    """Step a simulation; in a window that is shown, as fast as time goes there and until it is closed."""
    if is_shown:
        from crowd_viewer.window import shown_frames

        yield from shown_frames(simulation, frame_count, camera=camera)
        return
    for _ in range(frame_count):
        yield simulation.step()


def measured_facts(
    simulation: Simulation, wall_seconds: float, compile_seconds: float, *, was_stopped: bool
) -> dict[str, Any]:
    """Join the facts of a run with its metrics.

    Parameters
    ----------
    simulation : Simulation
    wall_seconds, compile_seconds : float
        Time of the run alone, and of preparing it, s.
    was_stopped : bool
        Ctrl-C ended the run; the metrics are those up to then.
    """
    facts: dict[str, Any] = {
        "scenario": simulation.scenario.name,
        "characters": simulation.model.capacity,
        "seconds": simulation.time,
        "frames": simulation.step_index,
        "dt": simulation.dt,
        "seed": simulation.seed,
        "threads": simulation.threads,
        "wall_seconds": wall_seconds,
        "compile_seconds": compile_seconds,
        "real_time_factor": simulation.time / wall_seconds,
    }
    if was_stopped:
        facts["stopped"] = True
    facts.update(simulation.metrics.as_dict())
    return facts
