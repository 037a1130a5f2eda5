"""The cast of a run: which skinned character each person is drawn and exported as."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from crowd.characters.character import Character, load_character
from crowd.errors import MotionError, SettingsError, describe, nearest_first
from crowd.scenario import PlacedCharacters, Scenario
from crowd.scenario.source import Problems
from crowd_kernels.random import uniform

IntArray = npt.NDArray[np.int32]

BUILT_IN = "built-in"
"""What a scenario calls the engine's own body."""
OWN_BODY = -1
ENDINGS = (".glb", ".gltf")
PURPOSE_CHARACTER = 106


@dataclass(frozen=True)
class Cast:
    """Who is drawn as what.

    Attributes
    ----------
    characters : tuple of Character
    number : (N,) int32
        Place of each person's character in `characters`; -1 for the engine's own body.
    """

    characters: tuple[Character, ...]
    number: IntArray

    @classmethod
    def of_nobody(cls, count: int) -> Cast:
        """Everyone has the engine's own body."""
        return cls((), np.full(count, OWN_BODY, np.int32))

    @classmethod
    def build(
        cls, scenario: Scenario, placed: PlacedCharacters, seed: int, files: Sequence[Path] = ()
    ) -> Cast:
        """Load the characters that a scenario names, and draw one for each person.

        Parameters
        ----------
        scenario : Scenario
        placed : PlacedCharacters
        seed : int
            Key of the draws.
        files : sequence of Path
            Characters of people for whom the scenario names none.

        Raises
        ------
        ScenarioError
            With a line for each file that cannot be used.
        SettingsError
            One of `files` cannot be used.
        """
        loading = _Loading(scenario)
        choices = {location: loading.named(location) for location in dict.fromkeys(placed.location)}
        loading.problems.raise_if_any()
        others = [loading.given(path) for path in files] or [OWN_BODY]
        number = np.full(placed.count, OWN_BODY, np.int32)
        for row, (location, key) in enumerate(zip(placed.location, placed.key.tolist(), strict=True)):
            choice = choices[location] or others
            number[row] = choice[int(uniform(seed, key, 0, PURPOSE_CHARACTER) * len(choice))]
        return cls(tuple(loading.characters), number)


class _Loading:
    """Loads each file once, and collects what is wrong with them."""

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        self.problems = Problems(scenario.source)
        self.characters: list[Character] = []
        self._numbers: dict[Path, int] = {}

    def named(self, location: tuple[str | int, ...]) -> list[int]:
        """Numbers of the characters that one table of the scenario names."""
        table, index = location[:2]
        names: tuple[str, ...] = getattr(self.scenario, str(table))[index].character
        found = []
        for name in names:
            try:
                path = self.scenario.source.folder / name
                found.append(OWN_BODY if name == BUILT_IN else self._number(path, name))
            except MotionError as error:
                self.problems.add((*location[:2], "character"), f"cannot be used: {error}")
        return found

    def given(self, path: Path) -> int:
        """Number of a character that the caller of the run names."""
        try:
            return self._number(path, str(path))
        except MotionError as error:
            raise SettingsError(str(error)) from error

    def _number(self, path: Path, name: str) -> int:
        if path.suffix.lower() not in ENDINGS or not path.is_file():
            there = [other.name for end in ENDINGS for other in path.absolute().parent.glob(f"*{end}")]
            allowed = f'"{BUILT_IN}", or a .glb or .gltf file' + (
                f" such as {nearest_first(path.name, there)}" if there else ""
            )
            raise MotionError(describe("character", "no such file", name, allowed))
        key = path.resolve()
        if key not in self._numbers:
            self.characters.append(load_character(path))
            self._numbers[key] = len(self.characters) - 1
        return self._numbers[key]
