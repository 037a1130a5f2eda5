"""Which part of a recording is exported: characters, times, and the visits that people make through slots."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from crowd.errors import SettingsError, describe, nearest_first
from crowd.recording import Recording

IntArray = npt.NDArray[np.int64]

BLOCK_BYTES = 16 << 20
"""Poses read at once, bytes; what bounds the memory of an export."""


@dataclass(frozen=True)
class Visit:
    """One person's stay in the scene.

    Attributes
    ----------
    number : int
        Counts visits over the whole selection, from 0.
    slot : int
        Row in the arrays of the recording.
    name : str
        Unique, such as ``"person_0003"``; later visits through a slot end in ``_2``, ``_3``.
    first, last : int
        Frames of the recording, both included.
    """

    number: int
    slot: int
    name: str
    first: int
    last: int

    @property
    def frame_count(self) -> int:
        """Number of frames."""
        return self.last - self.first + 1


class Selection:
    """Part of a recording.

    Parameters
    ----------
    recording : Recording
    characters : sequence of int or str, optional
        Slots or names; all when left out.
    start, stop : float, optional
        Simulated time, s; from the first to the last frame when left out.

    Raises
    ------
    SettingsError
        A character is unknown, or no frame lies in the time.
    """

    def __init__(
        self,
        recording: Recording,
        characters: Sequence[int | str] | None = None,
        start: float | None = None,
        stop: float | None = None,
    ) -> None:
        self.recording = recording
        self.slots: IntArray = (
            np.arange(recording.character_count)
            if characters is None
            else np.array(sorted({_slot(recording, name) for name in characters}), np.int64)
        )
        time = recording.time
        begins = -np.inf if start is None else start
        ends = np.inf if stop is None else stop
        inside = np.flatnonzero((time >= begins - 1e-9) & (time <= ends + 1e-9))
        if len(inside) == 0:
            allowed = f"{time[0]:g} to {time[-1]:g} s" if len(time) else "the recording is empty"
            asked = f"{start if start is not None else ''} to {stop if stop is not None else ''}"
            raise SettingsError(describe(str(recording.path), "no frame lies in the time", asked, allowed))
        self.first, self.last = int(inside[0]), int(inside[-1])

    @property
    def frame_count(self) -> int:
        """Number of frames."""
        return self.last - self.first + 1

    @property
    def frame_seconds(self) -> float:
        """Time from frame to frame, s."""
        return self.recording.frame_seconds

    def blocks(self, characters: int | None = None) -> Iterator[slice]:
        """Frames of the recording in blocks whose poses fit into `BLOCK_BYTES`."""
        joints = self.recording.skeleton.joint_count
        everyone = self.recording.character_count
        count = len(self.slots) if characters is None else characters
        bytes_of_a_frame = joints * (8 * everyone + 32 * 4 * count) + 64 * everyone
        size = int(max(1, BLOCK_BYTES // max(bytes_of_a_frame, 1)))
        for begin in range(self.first, self.last + 1, size):
            yield slice(begin, min(begin + size, self.last + 1))

    @cached_property
    def visits(self) -> tuple[Visit, ...]:
        """Stays of people in the scene, by slot and time."""
        recording = self.recording
        present = {int(slot): [-1, -1] for slot in self.slots}
        found: list[tuple[int, int, int]] = []
        for frames in self._plain_blocks():
            is_active = recording.read("is_active", frames)[:, self.slots]
            spawned = recording.read("spawn_count", frames)[:, self.slots]
            for column, slot in enumerate(self.slots.tolist()):
                _follow(present[slot], is_active[:, column], spawned[:, column], frames.start, slot, found)
        found.extend((slot, begin, self.last) for slot, (begin, _) in present.items() if begin >= 0)
        return _named(sorted(found))

    def _plain_blocks(self) -> Iterator[slice]:
        size = max(1, BLOCK_BYTES // max(8 * self.recording.character_count, 1))
        for begin in range(self.first, self.last + 1, size):
            yield slice(begin, min(begin + size, self.last + 1))


def _slot(recording: Recording, name: int | str) -> int:
    if isinstance(name, str) and name in recording.names:
        return recording.names.index(name)
    text = str(name)
    if text.isdigit() and int(text) < recording.character_count:
        return int(text)
    known = nearest_first(text, recording.names)
    allowed = f"0 to {recording.character_count - 1}, or {known}"
    raise SettingsError(describe(str(recording.path), "has no such character", name, allowed))


def _follow(
    state: list[int],
    is_active: npt.NDArray[np.bool_],
    spawned: npt.NDArray[np.int32],
    first: int,
    slot: int,
    found: list[tuple[int, int, int]],
) -> None:
    """Follow one slot through a block; `state` is the first frame of a running visit and its spawn count."""
    key = np.where(is_active, spawned.astype(np.int64), -1)
    before = np.concatenate([[state[1] if state[0] >= 0 else -1], key[:-1]])
    for row in np.flatnonzero(key != before).tolist():
        if state[0] >= 0:
            found.append((slot, state[0], first + row - 1))
        state[0], state[1] = (first + row, int(key[row])) if key[row] >= 0 else (-1, -1)


def _named(found: Sequence[tuple[int, int, int]]) -> tuple[Visit, ...]:
    visits = []
    seen: dict[int, int] = {}
    for number, (slot, first, last) in enumerate(found):
        seen[slot] = seen.get(slot, 0) + 1
        again = "" if seen[slot] == 1 else f"_{seen[slot]}"
        visits.append(Visit(number, slot, f"person_{slot:04d}{again}", first, last))
    return tuple(visits)
