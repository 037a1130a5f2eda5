"""Turn the objects of a scenario into arrays."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
import numpy.typing as npt

from crowd.errors import ScenarioError
from crowd.motion.rotation import about, multiply
from crowd.scenario.object_table import ObjectTable
from crowd.scenario.schema import Scenario
from crowd.scenario.source import Location, Problems
from crowd.world.mesh import Mesh, load_mesh
from crowd.world.objects import Objects, ShapeKind

FloatArray = npt.NDArray[np.float64]

BELOW_GROUND = 1e-3
"""Depth below the ground that does not count, m."""
LARGEST_MESH = 5.0
"""Longest side of a mesh, m."""


@dataclass(frozen=True)
class _Entry:
    """One row while it is built."""

    location: Location
    table: ObjectTable
    name: str
    position: FloatArray
    rotation: FloatArray
    half_size: FloatArray
    mesh: int


def place_objects(scenario: Scenario) -> Objects:
    """Read the shapes of all objects and put them where they are at the start.

    Raises
    ------
    ScenarioError
        With a line for each problem: a mesh that cannot be read, an object outside the bounds or below the
        ground, a name that is there twice.
    """
    problems = Problems(scenario.source)
    meshes: list[Mesh] = []
    known_files: dict[tuple[str, float], int] = {}
    entries: list[_Entry] = []
    for number, table in enumerate(scenario.objects):
        location: Location = ("objects", number)
        mesh = -1
        if table.file is not None:
            key = (table.file, table.scale)
            if key not in known_files:
                loaded = _load(scenario.source.folder / table.file, table.scale, location, problems)
                if loaded is None:
                    continue
                known_files[key] = len(meshes)
                meshes.append(loaded)
            mesh = known_files[key]
        half_size = meshes[mesh].half_size if mesh >= 0 else _half_size(table)
        rotation = _rotation(table)
        entries += [
            _Entry(location, table, name, place, rotation, half_size, mesh)
            for name, place in _copies(number, table)
        ]
    problems.raise_if_any()
    objects = _packed(entries, tuple(meshes)) if entries else Objects.none()
    _check_places(scenario, entries, objects, problems)
    problems.raise_if_any()
    return objects


def _load(path: Path, scale: float, location: Location, problems: Problems) -> Mesh | None:
    try:
        mesh = load_mesh(path, scale)
    except ScenarioError as error:
        problems.add((*location, "file"), str(error))
        return None
    longest = float(2.0 * mesh.half_size.max())
    if longest > LARGEST_MESH:
        problems.add(
            (*location, "scale"), "makes the mesh too large", f"{longest:g} m", f"{LARGEST_MESH:g} m"
        )
        return None
    return mesh


def _half_size(table: ObjectTable) -> FloatArray:
    if table.size is not None:
        return np.array(table.size) / 2.0
    radius = table.radius or 0.0
    return np.array([radius, radius if table.length is None else table.length / 2.0, radius])


def _rotation(table: ObjectTable) -> FloatArray:
    x, y, z = np.radians(table.rotation)
    return multiply(about(1, y), multiply(about(2, z), about(0, x)))


def _copies(number: int, table: ObjectTable) -> Iterator[tuple[str, FloatArray]]:
    """Name and place of an object and its copies."""
    name = table.name or f"objects[{number}]"
    start = np.array(table.position)
    if table.repeat is None:
        yield name, start
        return
    steps = product(*(range(count) for count in table.repeat.count))
    for copy, step in enumerate(steps):
        yield f"{name}[{copy}]", start + np.array(step) * table.repeat.spacing


def _packed(entries: list[_Entry], meshes: tuple[Mesh, ...]) -> Objects:
    """Make the arrays, and lift what rests on a surface."""
    objects = Objects(
        tuple(entry.name for entry in entries),
        np.array([ShapeKind[entry.table.shape.upper()] for entry in entries], np.int32),
        np.array([entry.half_size for entry in entries]),
        np.array([entry.table.colour for entry in entries], np.float32),
        np.array([entry.mesh for entry in entries], np.int32),
        meshes,
        np.array([entry.position for entry in entries]),
        np.array([entry.rotation for entry in entries]),
    )
    for row, entry in enumerate(entries):
        if entry.table.resting:
            objects.start_position_world[row, 1] -= objects.lowest_point(row, entry.rotation)
    return objects


def _check_places(scenario: Scenario, entries: list[_Entry], objects: Objects, problems: Problems) -> None:
    bounds = scenario.world.bounds
    allowed = f"x {bounds.x[0]:g} to {bounds.x[1]:g}, z {bounds.z[0]:g} to {bounds.z[1]:g}"
    seen: set[str] = set()
    for row, entry in enumerate(entries):
        x, y, z = objects.start_position_world[row].tolist()
        if entry.name in seen:
            problems.add((*entry.location, "name"), "is there twice", entry.name, "a name of its own")
        seen.add(entry.name)
        where = (*entry.location, "position")
        if not (bounds.x[0] <= x <= bounds.x[1] and bounds.z[0] <= z <= bounds.z[1]):
            problems.add(where, f"{entry.name} is outside the bounds", [x, y, z], allowed)
        lowest = y + objects.lowest_point(row, entry.rotation)
        if lowest < -BELOW_GROUND:
            problems.add(
                where,
                f"{entry.name} reaches below the ground",
                f"{lowest:.3g} m",
                "a greater height, or resting = true",
            )
