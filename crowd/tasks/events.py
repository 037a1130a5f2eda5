"""What happened to people's tasks, for programs that want to hear of it."""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from itertools import islice

MOST_EVENTS = 100_000


class EventKind(StrEnum):
    """What happened."""

    TASK_DONE = "task_done"
    TASK_FAILED = "task_failed"
    TASK_RETRIED = "task_retried"
    OBJECT_TAKEN = "object_taken"
    OBJECT_PUT_DOWN = "object_put_down"
    TARGET_REFUSED = "target_refused"
    """A hand, the gaze or a walker was sent to what it cannot go to."""


@dataclass(frozen=True)
class Event:
    """One thing that happened.

    Attributes
    ----------
    time : float
        Simulation time, s.
    character : int
    kind : EventKind
    task : str
        The task's action, such as ``"pick_up"``; of refused targets that no task asked for the layer:
        ``"reach"``, ``"grab"`` or ``"gaze"``, and ``"walk"`` of goals.
    detail : str
        The object's name, or why a task failed or a target was refused.
    """

    time: float
    character: int
    kind: EventKind
    task: str
    detail: str


class Events:
    """The last events of a run, oldest first."""

    def __init__(self) -> None:
        self._events: deque[Event] = deque(maxlen=MOST_EVENTS)
        self.count = 0
        """Events of the whole run, those that are forgotten included."""

    def add(self, time: float, character: int, kind: EventKind, task: str, detail: str = "") -> None:
        """Note an event."""
        self._events.append(Event(time, character, kind, task, detail))
        self.count += 1

    def __iter__(self) -> Iterator[Event]:
        return iter(self._events)

    def __len__(self) -> int:
        return len(self._events)

    def last(self, count: int) -> list[Event]:
        """The newest events, oldest first."""
        return list(islice(self._events, max(len(self._events) - count, 0), None))

    def since(self, time: float) -> list[Event]:
        """Events after a time, s."""
        return [event for event in self._events if event.time > time]
