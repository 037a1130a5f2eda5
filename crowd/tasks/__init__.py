"""Task lists: people who walk to things, pick them up, carry them, put them down, touch, look, sit, play."""

from crowd.tasks.events import Event, EventKind, Events
from crowd.tasks.execution import Tasks
from crowd.tasks.refusals import Refusals

__all__ = ["Event", "EventKind", "Events", "Refusals", "Tasks"]
