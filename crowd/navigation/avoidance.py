"""Avoidance of others and of walls, and bodies kept apart."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from crowd.errors import SettingsError, describe
from crowd.navigation.cell_table import CellTable
from crowd.world.walls import Walls
from crowd_kernels.aligned import aligned_zeros
from crowd_kernels.contact import (
    MOST_PARTNERS,
    ContactLimits,
    find_pairs_crowd,
    list_near_walls,
    measure_contacts,
    relax_contacts,
    stop_approach,
)
from crowd_kernels.neighbors import CHUNKS, find_neighbors_crowd
from crowd_kernels.steering import BODY_COLUMNS, AvoidanceLimits, gather_bodies_crowd, steer_crowd
from crowd_kernels.wall_contact import stop_at_walls
from crowd_kernels.walls import MOST_EDGES

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int32]


@dataclass(frozen=True)
class AvoidanceSettings:
    """How characters avoid each other; every field can be set in a scenario."""

    neighbor_count: int = 10
    """Nearest others that a character avoids, 1 to 64. More is smoother in dense crowds and slower."""
    neighbor_distance: float = 5.0
    """Others farther away are ignored, m, 0.5 to 50. A larger value gives earlier reactions in open scenes
    and costs time there; in dense crowds the count is reached first."""
    time_horizon: float = 2.0
    """Time ahead for which others are avoided, s, 0.1 to 10. A larger value gives earlier, wider evasion."""
    wall_time_horizon: float = 1.0
    """Time ahead for which walls are avoided, s, 0.1 to 5. With a larger value people slow down earlier
    before walls and refuse narrow doors."""
    contact_horizon: float = 0.1
    """Time in which overlapping people want to be apart, s, 0.01 to 1; at least one step is used. A larger
    value separates more gently."""
    perturbation: float = 1e-4
    """Deterministic disturbance of the preferred velocity, m/s, 0 to 0.1; it breaks symmetric deadlocks. A
    larger value breaks them sooner and makes paths less straight."""
    maximum_acceleration: float = math.inf
    """Largest change of velocity, m/s^2, above 0. A smaller value gives smoother and later evasion."""
    follower_share: float = 0.0
    """How much more those behind give way to those in front than the other way round, 0 (alike) to 1 (those
    in front do not yield). A larger value keeps queues moving."""
    crowd_slowdown: float = 0.0
    """How much people slow down in a crowd, 0 (not at all) to 1 (as measured by Weidmann)."""
    contact_passes: int = 4
    """Passes that separate every overlapping pair, 1 to 50. More leaves less overlap and costs time."""
    most_contact_passes: int = 60
    """Passes at most while some overlap is deeper than `wanted_depth`, 1 to 1000."""
    contact_rounds: int = 6
    """Times at most that pairs are listed anew because bodies were pushed far, 1 to 50. More resolves larger
    piles in one step."""
    wanted_depth: float = 0.02
    """Overlap that is left alone in the later passes, m, 0.001 to 0.05. A smaller value costs passes."""
    contact_margin: float = 0.1
    """Pairs up to this far apart are watched while bodies are pushed, m, 0.01 to 1. A larger value lists more
    pairs and needs fewer rounds."""

    def __post_init__(self) -> None:
        """Refuse values outside the documented ranges."""
        for name, (low, high) in _RANGES.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise SettingsError(
                    describe(f"avoidance.{name}", "out of range", value, f"{low:g} to {high:g}")
                )


_RANGES: dict[str, tuple[float, float]] = {
    "neighbor_count": (1, 64),
    "neighbor_distance": (0.5, 50.0),
    "time_horizon": (0.1, 10.0),
    "wall_time_horizon": (0.1, 5.0),
    "contact_horizon": (0.01, 1.0),
    "perturbation": (0.0, 0.1),
    "maximum_acceleration": (1e-3, math.inf),
    "follower_share": (0.0, 1.0),
    "crowd_slowdown": (0.0, 1.0),
    "contact_passes": (1, 50),
    "most_contact_passes": (1, 1000),
    "contact_rounds": (1, 50),
    "wanted_depth": (1e-3, 0.05),
    "contact_margin": (0.01, 1.0),
}


def avoidance_limits(settings: AvoidanceSettings, dt: float) -> AvoidanceLimits:
    """What the kernels read of the settings, for steps of `dt`, s."""
    return AvoidanceLimits(
        settings.neighbor_count,
        settings.neighbor_distance,
        settings.time_horizon,
        settings.wall_time_horizon,
        max(settings.contact_horizon, dt),
        settings.perturbation,
        settings.maximum_acceleration,
        settings.follower_share,
        settings.crowd_slowdown,
    )


@dataclass(frozen=True)
class Neighbors:
    """Nearest others of each character, by distance, then by number.

    Attributes
    ----------
    character : (N, K) int32
        Numbers of the neighbours; entries from `count` on mean nothing.
    distance : (N, K) float64
        m.
    count : (N,) int32
        Neighbours found; 0 for characters that were not asked about.
    """

    character: IntArray
    distance: FloatArray
    count: IntArray


@dataclass(frozen=True)
class ContactReport:
    """What `Avoidance.project` left behind.

    Attributes
    ----------
    deepest_overlap : float
        m; 0 when nobody overlaps.
    rounds : int
        Times that pairs were listed.
    """

    deepest_overlap: float
    rounds: int


class Avoidance:
    """Steering and contact of a crowd, with their scratch arrays. It keeps nothing from step to step.

    Parameters
    ----------
    settings : AvoidanceSettings
    capacity : int
        Length N of all arrays.
    """

    def __init__(self, settings: AvoidanceSettings, capacity: int) -> None:
        self.settings = settings
        self.capacity = capacity
        wanted = max(settings.neighbor_count, MOST_EDGES, MOST_PARTNERS)
        self.steer_cells = CellTable(capacity, 0.25, settings.neighbor_distance)
        """Characters by cell, as the last `steer` sorted them, for searches up to `neighbor_distance`."""
        self._contact_cells = CellTable(capacity, 0.25, 4.0)
        self._body = aligned_zeros(BODY_COLUMNS * capacity)
        self._keys = aligned_zeros((CHUNKS, wanted), np.int64)
        line_count = settings.neighbor_count + MOST_EDGES
        self._lines = aligned_zeros((CHUNKS, 4 * line_count))
        self._projected = aligned_zeros((CHUNKS, 4 * line_count))
        self._partner = aligned_zeros((capacity, MOST_PARTNERS), np.int32)
        self._partner_count = aligned_zeros(capacity, np.int32)
        self._near = aligned_zeros(capacity, np.int32)
        self._contact_limits = ContactLimits(
            settings.contact_passes,
            settings.most_contact_passes,
            settings.wanted_depth,
            settings.contact_margin,
        )

    def steer(
        self,
        position_world: FloatArray,
        velocity_world: FloatArray,
        preferred_velocity_world: FloatArray,
        radius: FloatArray,
        maximum_speed: FloatArray,
        responsibility: FloatArray,
        active: IntArray,
        walls: Walls,
        dt: float,
        out_velocity_world: FloatArray,
        *,
        seed: int = 0,
        step: int = 0,
    ) -> None:
        """Choose the velocity nearest to the preferred one that avoids others and walls.

        Parameters
        ----------
        position_world, velocity_world, preferred_velocity_world : (N, 3) float64
            m and m/s; y is ignored. Characters without a finite position take no part and get velocity 0.
        radius, maximum_speed : (N,) float64
            m and m/s.
        responsibility : (N,) float64
            1/2 normally, 1 yields fully, 0 never yields. The shares of a pair are in proportion.
        active : (A,) int32
            Characters that take part, ascending; others are neither moved nor seen.
        walls : Walls
        dt : float
            s.
        out_velocity_world : (N, 3) float64
            Written in rows of `active`, m/s; y is left alone.
        seed, step : int
            Keys of the disturbance that breaks symmetry.
        """
        cells = self.steer_cells
        out_velocity_world[active, 0] = 0.0
        out_velocity_world[active, 2] = 0.0
        cells.sort(position_world, radius, active, self.settings.neighbor_distance)
        gather_bodies_crowd(
            cells.character,
            cells.sorted_count,
            velocity_world,
            preferred_velocity_world,
            radius,
            maximum_speed,
            responsibility,
            self._body,
        )
        steer_crowd(
            cells.cell_start,
            cells.point,
            cells.character,
            cells.slot,
            self._body,
            cells.sorted_count,
            cells.columns,
            cells.rows,
            cells.cell_size,
            walls.table,
            avoidance_limits(self.settings, dt),
            dt,
            seed,
            step,
            self._keys,
            self._lines,
            self._projected,
            out_velocity_world,
        )

    def neighbors(
        self,
        position_world: FloatArray,
        radius: FloatArray,
        active: IntArray,
        count: int | None = None,
        distance: float | None = None,
    ) -> Neighbors:
        """Find the nearest others of every active character.

        Parameters
        ----------
        position_world : (N, 3) float64
            m.
        radius : (N,) float64
            m; only to leave out characters that have none.
        active : (A,) int32
        count : int, optional
            Largest number for each; `neighbor_count` of the settings when left out.
        distance : float, optional
            Only others nearer than this, m; `neighbor_distance` of the settings when left out.

        Returns
        -------
        Neighbors
        """
        wanted = count or self.settings.neighbor_count
        reach = distance or self.settings.neighbor_distance
        cells = self.steer_cells
        cells.sort(position_world, radius, active, reach)
        found = Neighbors(
            np.zeros((self.capacity, wanted), np.int32),
            np.zeros((self.capacity, wanted)),
            np.zeros(self.capacity, np.int32),
        )
        find_neighbors_crowd(
            cells.cell_start,
            cells.point,
            cells.character,
            cells.sorted_count,
            cells.columns,
            cells.rows,
            cells.cell_size,
            reach,
            np.zeros((CHUNKS, wanted), np.int64),
            found.character,
            found.distance,
            found.count,
        )
        return found

    def project(
        self,
        position_world: FloatArray,
        previous_position_world: FloatArray,
        radius: FloatArray,
        mobility: FloatArray,
        active: IntArray,
        walls: Walls,
        dt: float,
        velocity_world: FloatArray | None = None,
        *,
        seed: int = 0,
    ) -> ContactReport:
        """Push overlapping bodies apart, and keep every body on its side of every wall.

        Parameters
        ----------
        position_world : (N, 3) float64
            In and out, m. Characters without a finite position take no part.
        previous_position_world : (N, 3) float64
            Positions before the step, from which motion is followed, m.
        radius : (N,) float64
            m, less than `walls.reach`.
        mobility : (N,) float64
            1 normally; 0 for those that nothing moves.
        active : (A,) int32
            Characters that take part, ascending.
        walls : Walls
        dt : float
            s.
        velocity_world : (N, 3) float64, optional
            In and out, m/s: loses what presses into others and into walls.
        seed : int
            Key of the direction in which coincident characters part.

        Returns
        -------
        ContactReport
        """
        limits = self._contact_limits
        cells = self._contact_cells
        if active.size == 0:
            return ContactReport(0.0, 0)
        deepest, farthest, near_count, rounds = 0.0, 0.0, 0, 0
        for rounds in range(1, self.settings.contact_rounds + 1):
            self._list_pairs(position_world, radius, active)
            near_count = list_near_walls(
                position_world,
                previous_position_world,
                radius,
                active,
                cells.slot,
                walls.table,
                limits.margin,
                self._near,
            )
            relax_contacts(
                position_world,
                previous_position_world,
                radius,
                mobility,
                active,
                cells.slot,
                self._partner,
                self._partner_count,
                self._near,
                near_count,
                walls.table,
                limits,
                limits.full_passes if rounds == 1 else 0,
                dt,
                seed,
            )
            deepest, farthest = measure_contacts(
                position_world,
                radius,
                mobility,
                active,
                cells.slot,
                cells.point,
                self._partner,
                self._partner_count,
            )
            if deepest <= limits.wanted_depth and farthest <= 0.5 * limits.margin:
                break
        if velocity_world is not None:
            stop_approach(
                velocity_world,
                position_world,
                radius,
                mobility,
                active,
                cells.slot,
                self._partner,
                self._partner_count,
            )
            stop_at_walls(velocity_world, position_world, radius, self._near, near_count, walls.table)
        return ContactReport(deepest, rounds)

    def _list_pairs(self, position_world: FloatArray, radius: FloatArray, active: IntArray) -> None:
        """Sort characters by cell and list the pairs that touch or nearly touch."""
        cells = self._contact_cells
        sizes = radius[active]
        sizes = sizes[np.isfinite(sizes)]
        largest = float(sizes.max()) if sizes.size else 0.0
        margin = self._contact_limits.margin
        cells.sort(position_world, radius, active, 2.0 * largest + margin)
        find_pairs_crowd(
            cells.cell_start,
            cells.point,
            cells.character,
            cells.sorted_count,
            cells.columns,
            cells.rows,
            cells.cell_size,
            radius,
            largest,
            margin,
            self._keys,
            self._partner,
            self._partner_count,
        )
