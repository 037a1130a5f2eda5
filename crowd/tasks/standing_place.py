"""Where to stand to reach something: near enough, on free ground, with nothing between, facing it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from crowd.people import shoulders_world
from crowd.world import World

FloatArray = npt.NDArray[np.float64]

DISTANCES = (0.46, 0.54, 0.38, 0.62, 0.70, 0.30, 0.78)
"""Ground distances from the target in the order of preference, at a stature of `STATURE`, m."""
DIRECTIONS = 24
FINE_DIRECTIONS = 72
"""Directions from the target that are tried when none of the few will do, as beside somebody at a table."""
BOTH = 2
STATURE = 1.75
ASIDE = 0.30
"""How far to the side of the hand the target is seen from the place, rad."""
GAP = 0.03
"""Least gap between people who stand, m."""
NEARNESS_WEIGHT = 3.0
"""How much way a person takes for a better distance, m of way per m."""


@dataclass(frozen=True)
class StandingPlace:
    """A point on the ground, (3,) m, and a heading, rad."""

    position_world: FloatArray
    yaw: float


def find_standing_place(
    world: World,
    target_world: FloatArray,
    start_world: FloatArray,
    stature: float,
    radius: float,
    hand: int,
    taken: Sequence[tuple[FloatArray, float]],
    attempt: int = 0,
) -> StandingPlace | None:
    """Find the best place from which a person can reach a point.

    Parameters
    ----------
    world : World
    target_world : (3,) float64
        Point to reach, m.
    start_world : (3,) float64
        Where the person is now, m.
    stature, radius : float
        Of the person, m.
    hand : int
        0 right, 1 left, 2 both.
    taken : sequence of ((3,) float64, float)
        Places and radii of people who stand, or will.
    attempt : int
        How many of the best places to pass over, for another try.

    Returns
    -------
    StandingPlace or None
        None when nobody can stand near the point.

    Notes
    -----
    **Source:** Feng, Xu, Shapiro, section 8: a far target is walked to before it is reached.
    **Differs from the source:** the place is chosen among obstacles and people instead of on the straight
    line to the target.
    """
    for directions in (DIRECTIONS, FINE_DIRECTIONS):
        points, yaw, rank = _places_around(target_world, stature, hand, directions)
        candidates = _where_one_can_stand(
            world, points, yaw, target_world, start_world, stature, radius, hand, taken
        )
        if candidates.size:
            way = np.linalg.norm(points[candidates] - start_world, axis=1)
            order = np.argsort(way + NEARNESS_WEIGHT * rank[candidates], kind="stable")
            chosen = candidates[order[min(attempt * 5, candidates.size - 1)]]
            return StandingPlace(points[chosen], float(yaw[chosen]))
    return None


def _where_one_can_stand(
    world: World,
    points: FloatArray,
    yaw: FloatArray,
    target_world: FloatArray,
    start_world: FloatArray,
    stature: float,
    radius: float,
    hand: int,
    taken: Sequence[tuple[FloatArray, float]],
) -> npt.NDArray[np.intp]:
    """Rows of the places that are free, from which the arms can reach, and to which there is a way."""
    fits = world.is_walkable(points, radius)
    for place, other in taken:
        away = points - place
        fits &= np.hypot(away[:, 0], away[:, 2]) > radius + other + GAP
    fits &= _is_free_for_arms(world, points, yaw, stature, hand, target_world)
    candidates = np.flatnonzero(fits)
    if candidates.size:
        starts = np.repeat(start_world[None], candidates.size, axis=0)
        candidates = candidates[world.is_reachable(starts, points[candidates], radius)]
    return candidates


def is_behind_walls(
    world: World, target_world: FloatArray, start_world: FloatArray, stature: float, radius: float, hand: int
) -> bool:
    """Whether obstacles keep a person from every place where the hand would reach; arguments as above."""
    return find_standing_place(world, target_world, start_world, stature, radius, hand, ()) is None


def _places_around(
    target_world: FloatArray, stature: float, hand: int, directions: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Places (P, 3) around a target, headings there (P,), and how far each is from the best distance (P,)."""
    angle = 2.0 * math.pi * np.arange(directions) / directions
    length = np.array(DISTANCES) * stature / STATURE
    steps = np.stack([np.sin(angle), np.zeros(directions), np.cos(angle)], axis=1)
    points = (target_world * [1.0, 0.0, 1.0] + length[:, None, None] * steps).reshape(-1, 3)
    yaw = np.tile(angle - math.pi + (ASIDE, -ASIDE, 0.0)[hand], len(length))
    return points, yaw, np.repeat(np.abs(length - length[0]), directions)


def _is_free_for_arms(
    world: World, points: FloatArray, yaw: FloatArray, stature: float, hand: int, target_world: FloatArray
) -> npt.NDArray[np.bool_]:
    """At which places no obstacle is between the shoulders of the arms that reach and the target."""
    targets = np.broadcast_to(target_world, points.shape)
    free = np.ones(len(points), np.bool_)
    for side in (0, 1) if hand == BOTH else (hand,):
        free &= ~world.is_blocked(shoulders_world(points, yaw, stature, side), targets)
    return free
