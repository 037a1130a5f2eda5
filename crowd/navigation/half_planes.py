"""Half-planes of velocities that keep one character clear of others and of walls, for people who look."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from crowd.navigation.avoidance import AvoidanceSettings, avoidance_limits
from crowd.world.walls import Walls
from crowd_kernels.steering import BODY_COLUMNS, gather_bodies_crowd, neighbor_lines
from crowd_kernels.walls import MOST_EDGES, wall_lines

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int32]


def half_planes(
    settings: AvoidanceSettings,
    character: int,
    position_world: FloatArray,
    velocity_world: FloatArray,
    preferred_velocity_world: FloatArray,
    radius: FloatArray,
    maximum_speed: FloatArray,
    responsibility: FloatArray,
    active: IntArray,
    walls: Walls,
    dt: float,
    *,
    seed: int = 0,
) -> tuple[FloatArray, int]:
    """Find what restricts the next velocity of one character, with the kernels that choose it.

    Parameters
    ----------
    settings : AvoidanceSettings
    character : int
    position_world, velocity_world, preferred_velocity_world, radius, maximum_speed, responsibility
        As in `Avoidance.steer`.
    active : (A,) int32
    walls : Walls
    dt : float
        s.
    seed : int

    Returns
    -------
    lines : (H, 4) float64
        Point x, z (m/s) and unit direction x, z of each boundary; admissible on the left, as seen with z up
        and x to the right.
    wall_count : int
        How many of them, the first ones, are of walls.
    """
    others = active[active != character]
    away = np.hypot(*(position_world[others] - position_world[character])[:, [0, 2]].T)
    near = np.lexsort((others, away))[: settings.neighbor_count]
    near = near[away[near] < settings.neighbor_distance]
    rows = np.concatenate([[character], others[near]]).astype(np.int32)
    body = np.zeros(BODY_COLUMNS * len(rows))
    gather_bodies_crowd(
        rows,
        len(rows),
        velocity_world,
        preferred_velocity_world,
        radius,
        maximum_speed,
        responsibility,
        body,
    )
    limits = avoidance_limits(settings, dt)
    lines = np.zeros(4 * (len(rows) + MOST_EDGES))
    keys = np.zeros(max(len(rows), MOST_EDGES), np.int64)
    wall_count = 0
    if walls.table.cell_edge.shape[0]:
        x, _, z = position_world[character].tolist()
        vx, _, vz = velocity_world[character].tolist()
        reach = limits.wall_time_horizon * float(maximum_speed[character]) + float(radius[character])
        rate = 1.0 / limits.wall_time_horizon
        own_radius = float(radius[character])
        wall_count = wall_lines(walls.table, x, z, vx, vz, own_radius, reach, rate, keys, lines)
    keys[: len(rows) - 1] = np.arange(1, len(rows))
    slots = np.arange(len(rows), dtype=np.int32)
    point = np.ascontiguousarray(position_world[rows][:, [0, 2]]).ravel()
    count = neighbor_lines(0, point, body, slots, rows, keys, len(rows) - 1, limits, seed, wall_count, lines)
    return lines[: 4 * count].reshape(count, 4), int(wall_count)
