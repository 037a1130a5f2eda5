"""The progress bar of a run."""

from __future__ import annotations

import time
from types import TracebackType
from typing import TYPE_CHECKING, Self

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

if TYPE_CHECKING:
    from crowd.simulation import Frame, Simulation

UPDATE_SECONDS = 0.1


class RunProgress:
    """Simulated time, people in the scene, and speed against real time, on the error stream."""

    def __init__(self, simulation: Simulation, frame_count: int) -> None:
        self._simulation = simulation
        self._first_time = simulation.time
        self._last_time = self._first_time + frame_count * simulation.dt
        self._begin = time.perf_counter()
        self._shown_at = 0.0
        self._frames_since = 0
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.fields[state]}"),
            TimeRemainingColumn(),
            console=Console(stderr=True),
        )
        self._task = self._progress.add_task(simulation.scenario.name, total=frame_count, state="")

    def advance(self, frame: Frame) -> None:
        """Count a frame; the display follows ten times a second."""
        self._frames_since += 1
        now = time.perf_counter()
        if now - self._shown_at >= UPDATE_SECONDS:
            self._show(frame.time, now)

    def _show(self, simulated: float, now: float) -> None:
        people = int(self._simulation.state.is_active.sum())
        factor = (simulated - self._first_time) / max(now - self._begin, 1e-9)
        state = f"{simulated:.1f} of {self._last_time:g} s, {people} people, {factor:.1f} x real time"
        self._progress.update(self._task, advance=self._frames_since, state=state)
        self._frames_since = 0
        self._shown_at = now

    def __enter__(self) -> Self:
        self._progress.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._show(self._simulation.time, time.perf_counter())
        self._progress.stop()
