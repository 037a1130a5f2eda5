"""What carries things that people put down: the ground, boards, tops of obstacles, other things."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import shapely

from crowd.state import FloatArray
from crowd.world.obstacles import Wall

if TYPE_CHECKING:
    from crowd.simulation import Simulation

PLAY = 0.03
"""A place this far above or below what carries it is on it, m; heights in scenarios are rounded."""


def is_carried(simulation: Simulation, item: int, place_world: FloatArray) -> bool:
    """Tell whether anything is below an object at a place.

    Parameters
    ----------
    simulation : Simulation
    item : int
        Row of the object.
    place_world : (3,) float64
        Where its lowest point is to be, m.
    """
    x, height, z = place_world.tolist()
    return bool(np.any(np.abs(np.array(_heights_at(simulation, item, x, z)) - height) <= PLAY))


def _heights_at(simulation: Simulation, item: int, x: float, z: float) -> list[float]:
    """Heights of everything at a point of the ground that the object could stand on, m."""
    model, objects = simulation.model, simulation.objects
    heights = [0.0]
    for piece in model.furniture:
        if piece.x[0] <= x <= piece.x[1] and piece.z[0] <= z <= piece.z[1]:
            heights += piece.boards
    point = shapely.Point(x, z)
    for shape in model.world.obstacles:
        if not isinstance(shape, Wall) and shape.geometry().covers(point):
            heights.append(shape.height)
    away = (x, z) - objects.position_world[:, [0, 2]]
    farthest = np.linalg.norm(model.objects.half_size, axis=1)
    for other in np.flatnonzero((objects.holder < 0) & (np.abs(away) <= farthest[:, None]).all(axis=1)):
        least, greatest = model.objects.bounds(int(other), objects.rotation_world[other])
        is_below = (least[[0, 2]] <= away[other]) & (away[other] <= greatest[[0, 2]])
        if other != item and is_below.all():
            heights.append(float(objects.position_world[other, 1] + greatest[1]))
    return heights
