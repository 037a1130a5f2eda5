"""Where a scenario came from, so that every message can name file, line and key."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from crowd.errors import ScenarioError, describe

Location = tuple[str | int, ...]
SHOWN_PROBLEMS = 20


def key_path(location: Sequence[str | int]) -> str:
    """Write a location the way a user would: ``regions[2].speed``."""
    text = ""
    for part in location:
        if isinstance(part, int):
            text += f"[{part}]"
        elif part.replace("_", "").isalnum():
            text += f".{part}" if text else part
        else:
            text += f'."{part}"' if text else f'"{part}"'
    return text


@dataclass(frozen=True)
class ScenarioSource:
    """File and lines of a scenario.

    Attributes
    ----------
    label : str
        File name for messages; ``"scenario"`` for one that was made in Python.
    text : str
        The file's whole text.
    folder : Path
        Where files that the scenario names are looked for.
    find_lines : callable, optional
        Finds the line of each key, from 1, when a message needs them.
    """

    label: str = "scenario"
    text: str = ""
    folder: Path = Path()
    find_lines: Callable[[], Mapping[Location, int]] | None = None

    @cached_property
    def lines(self) -> Mapping[Location, int]:
        """Line of each key, from 1."""
        return self.find_lines() if self.find_lines is not None else {}

    def where(self, location: Sequence[str | int]) -> str:
        """Name a place: ``plaza.toml: line 12: regions[2].speed``; with the nearest known line."""
        line = None
        for length in range(len(location), 0, -1):
            line = self.lines.get(tuple(location[:length]))
            if line is not None:
                break
        parts = [self.label]
        if line is not None:
            parts.append(f"line {line}")
        if location:
            parts.append(key_path(location))
        return ": ".join(parts)


@dataclass
class Problems:
    """Everything wrong with a scenario, collected so that a user sees all of it at once."""

    source: ScenarioSource
    lines: list[str] = field(default_factory=list)

    def add(
        self, location: Sequence[str | int], what: str, got: object = None, allowed: str | None = None
    ) -> None:
        """Note one problem; the same line is noted once."""
        line = describe(self.source.where(location), what, got, allowed)
        if line not in self.lines:
            self.lines.append(line)

    def raise_if_any(self) -> None:
        """Raise one `ScenarioError` with a line for each problem.

        Raises
        ------
        ScenarioError
            There are problems.
        """
        if not self.lines:
            return
        shown = self.lines[:SHOWN_PROBLEMS]
        if len(self.lines) > SHOWN_PROBLEMS:
            shown.append(f"{self.source.label}: and {len(self.lines) - SHOWN_PROBLEMS} more problems")
        raise ScenarioError("\n".join(shown))
