"""Save and restore everything that changes in a run, in one file.

A restored simulation continues with the same bits as one that was never stopped.
"""

from __future__ import annotations

import json
import os
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import numpy.typing as npt

from crowd.errors import RecordingError, describe

if TYPE_CHECKING:
    from crowd.simulation import Simulation

FORMAT = 5
"""Counts up when the meaning of arrays changes; other names of arrays tell by themselves."""
BEGIN = b"PK\x03\x04"
"""How a file begins that `save` has written: it is an archive of arrays."""
SHOWN_BYTES = 8
"""How much of a file that is something else is shown: enough to know its kind."""
SHOWN_NAMES = 3
"""How many arrays that are too many or too few are named."""
OTHER_VERSION = "is of another version of the engine"
ALLOWED = "a file written by Simulation.save"


class Stateful(Protocol):
    """A part of the simulation with arrays of its own that change in a run."""

    def state_fields(self) -> Mapping[str, npt.NDArray[Any]]:
        """Names and arrays; the arrays keep their identity over a run."""


def state_arrays(simulation: Simulation) -> Iterator[tuple[str, npt.NDArray[Any]]]:
    """All arrays that change in a run, with unique names."""
    for name, array in simulation.state.arrays():
        yield f"state.{name}", array
    for part, owner in simulation.stateful_parts():
        for name, array in owner.state_fields().items():
            yield f"{part}.{name}", array


def save(simulation: Simulation, path: str | os.PathLike[str]) -> None:
    """Write a checkpoint; the file appears whole or not at all.

    Parameters
    ----------
    simulation : Simulation
    path : path
        Usually ends in ``.npz``.

    Raises
    ------
    RecordingError
        The file cannot be written.
    """
    target = Path(path)
    facts = {
        "format": FORMAT,
        "scenario": simulation.scenario.name,
        "capacity": simulation.model.capacity,
        "seed": simulation.seed,
        "bodies": simulation.bodies,
        "step_index": simulation.step_index,
    }
    arrays = dict(state_arrays(simulation))
    partial = target.with_name(target.name + ".partial")
    try:
        with partial.open("wb") as file:
            np.savez(file, facts=np.array(json.dumps(facts)), allow_pickle=False, **arrays)
        partial.replace(target)
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise RecordingError(describe(str(target), "cannot write the checkpoint", error.strerror)) from error


def restore(simulation: Simulation, path: str | os.PathLike[str]) -> None:
    """Load a checkpoint into a simulation of the same scenario, number of people and seed.

    Raises
    ------
    RecordingError
        The file is no checkpoint, or belongs to another run or another version of the engine; the simulation
        is as it was.
    """
    facts, contents = _read(Path(path))
    if facts.get("format") != FORMAT:
        what = f"{OTHER_VERSION}: its format is another"
        raise RecordingError(describe(str(path), what, facts.get("format"), str(FORMAT)))
    expected = {
        "scenario": simulation.scenario.name,
        "capacity": simulation.model.capacity,
        "seed": simulation.seed,
        "bodies": simulation.bodies,
    }
    for key, value in expected.items():
        if facts.get(key) != value:
            raise RecordingError(
                describe(str(path), f"checkpoint of another run: {key}", facts.get(key), repr(value))
            )
    arrays = dict(state_arrays(simulation))
    if contents.keys() != arrays.keys():
        others = [f"no {name}" for name in arrays.keys() - contents.keys()]
        others += contents.keys() - arrays.keys()
        got = ", ".join(sorted(others)[:SHOWN_NAMES])
        what = f"{OTHER_VERSION}: its arrays are others"
        raise RecordingError(describe(str(path), what, got, "those of this version"))
    for name, array in arrays.items():
        stored = contents[name]
        if (stored.shape, stored.dtype) != (array.shape, array.dtype):
            got = f"{stored.dtype} {stored.shape}"
            raise RecordingError(
                describe(str(path), f"does not fit the scenario: {name}", got, f"{array.dtype} {array.shape}")
            )
    for name, array in arrays.items():
        array[...] = contents[name]
    simulation.step_index = int(facts["step_index"])
    simulation.model.timetable.update(simulation.model.world, simulation.time)


def _read(path: Path) -> tuple[dict[str, Any], dict[str, npt.NDArray[Any]]]:
    """Facts and arrays of a checkpoint.

    Raises
    ------
    RecordingError
        The file is missing, cut off, damaged, or something else.
    """
    try:
        with path.open("rb") as file:
            begin = file.read(SHOWN_BYTES)
            # NumPy would take anything else for a pickle.
            if not begin.startswith(BEGIN):
                got = begin or "an empty file"
                raise RecordingError(describe(str(path), "is not a checkpoint", got, ALLOWED))
            if not zipfile.is_zipfile(file):
                got = f"{path.stat().st_size} bytes"
                raise RecordingError(describe(str(path), "is cut off", got, "the whole file"))
            file.seek(0)
            with np.load(file, allow_pickle=False) as stored:
                contents = {name: stored[name] for name in stored.files}
    except OSError as error:
        got = error.strerror or str(error)
        raise RecordingError(describe(str(path), "cannot be read", got, ALLOWED)) from error
    except (ValueError, EOFError, RuntimeError, zipfile.BadZipFile, zlib.error) as error:
        got = str(error).partition("\n")[0]
        raise RecordingError(describe(str(path), "is damaged", got, ALLOWED)) from error
    try:
        facts = json.loads(str(contents.pop("facts")))
        int(facts["step_index"])
    except (KeyError, ValueError, TypeError) as error:
        got = ", ".join(list(contents)[:4])
        raise RecordingError(describe(str(path), "is not a checkpoint", f"arrays {got}", ALLOWED)) from error
    return facts, contents
