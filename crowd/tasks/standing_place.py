"""Where to stand to reach something: near enough, on free ground, with nothing between, facing it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import shapely

from crowd.world import World

FloatArray = npt.NDArray[np.float64]

DISTANCES = (0.46, 0.54, 0.38, 0.62, 0.70, 0.30, 0.78)
"""Ground distances from the target in the order of preference, at a stature of `STATURE`, m."""
DIRECTIONS = 24
STATURE = 1.75
ASIDE = 0.30
"""How far to the side of the hand the target is seen from the place, rad."""
GAP = 0.03
"""Least gap between people who stand, m."""
TOUCHING = 1e-6
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
    angle = 2.0 * math.pi * np.arange(DIRECTIONS) / DIRECTIONS
    length = np.array(DISTANCES) * stature / STATURE
    steps = np.stack([np.sin(angle), np.zeros(DIRECTIONS), np.cos(angle)], axis=1)
    ground = np.array([target_world[0], 0.0, target_world[2]])
    points = (ground + length[:, None, None] * steps).reshape(-1, 3)
    rank = np.repeat(np.abs(length - length[0]), DIRECTIONS)
    fits = world.is_walkable(points, radius)
    for place, other in taken:
        away = points - place
        fits &= np.hypot(away[:, 0], away[:, 2]) > radius + other + GAP
    fits &= _sees(world, points, ground)
    candidates = np.flatnonzero(fits)
    if candidates.size:
        starts = np.repeat(start_world[None], candidates.size, axis=0)
        candidates = candidates[world.is_reachable(starts, points[candidates], radius)]
    if candidates.size == 0:
        return None
    way = np.linalg.norm(points[candidates] - start_world, axis=1)
    order = np.argsort(way + NEARNESS_WEIGHT * rank[candidates], kind="stable")
    chosen = points[candidates[order[min(attempt * 5, candidates.size - 1)]]]
    towards = ground - chosen
    side = (ASIDE, -ASIDE, 0.0)[hand]
    return StandingPlace(chosen, math.atan2(towards[0], towards[2]) + side)


def _sees(world: World, points: FloatArray, ground: FloatArray) -> npt.NDArray[np.bool_]:
    """From which points no obstacle lies between, other than the one that the target is on."""
    seen = np.ones(len(points), np.bool_)
    if not world.obstacles:
        return seen
    target = shapely.Point(ground[0], ground[2])
    lines = shapely.linestrings(
        np.stack([points[:, [0, 2]], np.broadcast_to(ground[[0, 2]], (len(points), 2))], axis=1)
    )
    asked, found = world.tree.query(lines, predicate="intersects")
    stands_between = shapely.distance(world.tree.geometries[found], target) > TOUCHING
    seen[asked[stands_between]] = False
    return seen
