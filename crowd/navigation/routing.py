"""Ways to goals: one distance field for a goal that many share, a search for each goal of one's own."""

from collections import OrderedDict
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from crowd.state import ByteArray, FloatArray, IntArray
from crowd.world import World
from crowd.world.grid import Grid
from crowd.world.world import RADIUS_STEP
from crowd_kernels.grid_search import BUCKETS, FRESH_RECORD, LAST_GENERATION, OVERFLOW
from crowd_kernels.routing import (
    UNREACHABLE,
    follow_crowd,
    mark_crossing_ways,
    route_by_field,
    route_by_search,
)

BoolArray = npt.NDArray[np.bool_]

FIRST_RADIUS_CLASS = 1
THIN_BODY = 0.021
"""Radius of a body that passes wherever no wall is crossed, m."""
SEARCH_CHUNKS = 4
MOST_CELLS_FOR_CHUNKS = 1_000_000


@dataclass(frozen=True)
class RoutingSettings:
    """How ways are found and followed."""

    most_corners: int = 40
    """Corners kept of a way, >= 2; a longer way is found again where it was cut."""
    look_ahead_period: int = 8
    """Steps after which each character looks whether it can cut a corner, >= 1; larger: cheaper, later."""
    corner_reach: float = 0.3
    """m, > 0. A corner this near is passed as soon as the next one is in sight."""
    sharing: int = 10
    """Characters with one goal from which on a distance field is cheaper than searches, >= 1."""
    widest_lane: float = 0.6
    """Largest distance that people on a way of their own keep from corners, m, >= 0; 0: all hug them."""
    widest_shared_lane: float = 1.5
    """The same for those who share a goal, m, >= 0; larger: doors are used over more of their width."""
    most_fields: int = 32
    """Distance fields kept in memory, >= 1."""
    most_reroutes: int = 256
    """Ways found anew in one step after the world has changed, >= 1; larger: quicker, with longer steps."""
    most_new_fields: int = 2
    """Shared goals whose ways are found anew in one step after the world has changed, >= 1."""
    searches_for_landmarks: int = 64
    """Searches at once from which on it pays to look at landmarks first, >= 1."""


class Routing:
    """Keeps the corners of everyone's way.

    Parameters
    ----------
    world : World
    capacity : int
        Number of slots.
    shared_goals_world : (G, 3) float64, optional
        Goals that many characters of the scenario have.
    settings : RoutingSettings, optional
    """

    def __init__(
        self,
        world: World,
        capacity: int,
        shared_goals_world: FloatArray | None = None,
        settings: RoutingSettings | None = None,
    ) -> None:
        self.world = world
        self.settings = settings or RoutingSettings()
        shared = np.zeros((0, 3)) if shared_goals_world is None else shared_goals_world
        self._shared_goals = {(float(x), float(z)) for x, _, z in shared}
        corners = self.settings.most_corners
        self.goal_world: FloatArray = np.zeros((capacity, 3))
        self.radius_class: IntArray = np.full(capacity, FIRST_RADIUS_CLASS, np.int32)
        self.shares_goal: BoolArray = np.zeros(capacity, np.bool_)
        self.corner: FloatArray = np.zeros((capacity, corners, 2))
        self.rest: FloatArray = np.zeros((capacity, corners))
        self.corner_count: IntArray = np.zeros(capacity, np.int32)
        self.corner_index: IntArray = np.zeros(capacity, np.int32)
        self.status: ByteArray = np.zeros(capacity, np.uint8)
        """0 when there is a way, see `crowd_kernels.routing`. (character,)"""
        self.is_stale: BoolArray = np.zeros(capacity, np.bool_)
        """The world has changed since the way was found, and the way may have to as well. (character,)"""
        self.known_world: ByteArray = world.digest.copy()
        """Digest of the obstacles that the ways are for."""
        self._known_version = world.version
        self._is_lost: ByteArray = np.zeros(capacity, np.uint8)
        self._scratch = SearchScratch()
        self._fields: OrderedDict[tuple[bytes, int, int], IntArray] = OrderedDict()

    def state_fields(self) -> dict[str, npt.NDArray[np.generic]]:
        """Arrays that change in a run."""
        names = (
            "goal_world",
            "radius_class",
            "shares_goal",
            "corner",
            "rest",
            "corner_count",
            "corner_index",
            "status",
            "is_stale",
            "known_world",
        )
        return {name: getattr(self, name) for name in names}

    def is_reachable(self, characters: IntArray) -> BoolArray:
        """Which characters (M,) had a way to their goal when one was last looked for."""
        reachable: BoolArray = self.status[characters] == 0
        return reachable

    def is_cut_off(self, characters: IntArray) -> BoolArray:
        """Which characters (M,) have no way to their goal, as far as ways for the present world are known."""
        is_known = np.array_equal(self.known_world, self.world.digest)
        return ~self.is_reachable(characters) & ~self.is_stale[characters] & is_known

    def set_goals(
        self, characters: IntArray, goal_world: FloatArray, radius: FloatArray, position_world: FloatArray
    ) -> None:
        """Find ways to new goals.

        Parameters
        ----------
        characters : (M,) int32
            Rows.
        goal_world : (M, 3) float64
            Their goals, m.
        radius : (M,) float64
            Their bodies, m.
        position_world : (N, 3) float64
            Where everyone is, m.
        """
        self.goal_world[characters] = goal_world
        self.radius_class[characters] = np.maximum(np.ceil(radius / RADIUS_STEP - 1e-6), FIRST_RADIUS_CLASS)
        _, group, size = np.unique(goal_world, axis=0, return_inverse=True, return_counts=True)
        is_known = np.zeros(len(goal_world), np.bool_)
        if self._shared_goals:
            points = goal_world[:, [0, 2]].tolist()
            is_known[:] = [(x, z) in self._shared_goals for x, z in points]
        self.shares_goal[characters] = (size[group.ravel()] >= self.settings.sharing) | is_known
        self._route(characters, position_world)

    def way_points(
        self,
        position_world: FloatArray,
        active: IntArray,
        step_index: int,
        out_way_point_world: FloatArray,
        out_remaining_distance: FloatArray,
    ) -> None:
        """Find the next way points, and find ways anew where they are lost.

        Parameters
        ----------
        position_world : (N, 3) float64
            m.
        active : (A,) int32
            Characters that walk.
        step_index : int
        out_way_point_world : (N, 3) float64
            m; their own position for characters without a way.
        out_remaining_distance : (N,) float64
            Length of the way to the goal, m; infinite without a way.
        """
        self._notice_changes(position_world, active)
        self._route(self._next_stale(active), position_world)
        for number, members in self._by_class(active):
            grid = self.world.grid(number * RADIUS_STEP)
            follow_crowd(
                grid.walls,
                grid.radius,
                position_world,
                self.corner,
                self.rest,
                self.corner_count,
                members,
                step_index,
                self.settings.look_ahead_period,
                self.settings.corner_reach,
                self.corner_index,
                out_way_point_world,
                out_remaining_distance,
                self._is_lost,
            )
        lost = active[self._is_lost[active] == 1]
        if lost.size:
            self._route(lost, position_world)
            found = lost[self.corner_count[lost] > 0]
            out_way_point_world[found[:, None], [0, 2]] = self.corner[found, 0]
            to_corner = self.corner[found, 0] - position_world[found][:, [0, 2]]
            length = np.hypot(to_corner[:, 0], to_corner[:, 1])
            out_remaining_distance[found] = length + self.rest[found, 0]
            stuck = lost[self.corner_count[lost] == 0]
            out_way_point_world[stuck[:, None], [0, 2]] = position_world[stuck][:, [0, 2]]
            out_remaining_distance[stuck] = np.inf

    def _notice_changes(self, position_world: FloatArray, active: IntArray) -> None:
        """Mark ways that a change of the world concerns: those it blocks, or all when something is gone."""
        if not np.array_equal(self.known_world, self.world.digest):
            changes = self.world.changes_since(self._known_version)
            if changes is None or not changes or any(change.is_gone for change in changes):
                self.is_stale[active] = True
            else:
                reach = RADIUS_STEP * int(self.radius_class[active].max(initial=FIRST_RADIUS_CLASS))
                for change in changes:
                    low_x, low_z = (change.low - reach).tolist()
                    high_x, high_z = (change.high + reach).tolist()
                    mark_crossing_ways(
                        position_world,
                        self.corner,
                        self.corner_count,
                        self.corner_index,
                        active,
                        low_x,
                        low_z,
                        high_x,
                        high_z,
                        self.is_stale,
                    )
            self.known_world[:] = self.world.digest
        self._known_version = self.world.version

    def _next_stale(self, active: IntArray) -> IntArray:
        """Characters whose ways are to be found anew in this step: not too many, for not too many goals."""
        stale = active[self.is_stale[active]][: self.settings.most_reroutes]
        sharing = stale[self.shares_goal[stale]]
        if sharing.size == 0:
            return stale
        _, first, group = np.unique(self.goal_world[sharing], axis=0, return_index=True, return_inverse=True)
        last = np.sort(first)[: self.settings.most_new_fields][-1]
        is_next = ~self.shares_goal[stale]
        is_next[self.shares_goal[stale]] = first[group.ravel()] <= last
        return stale[is_next]

    def _by_class(self, characters: IntArray) -> list[tuple[int, IntArray]]:
        """Characters by the grid they share."""
        classes = self.radius_class[characters]
        present = np.flatnonzero(np.bincount(classes)).tolist()
        if len(present) == 1:
            return [(present[0], characters)]
        return [(number, characters[classes == number]) for number in present]

    def _route(self, characters: IntArray, position_world: FloatArray) -> None:
        """Find the ways of these characters to their goals."""
        if characters.size == 0:
            return
        self.is_stale[characters] = False
        self.corner_index[characters] = 0
        for number, members in self._by_class(characters):
            grid = self.world.grid(number * RADIUS_STEP)
            goal_cell = grid.nearest_cells(self.goal_world[members][:, [0, 2]])
            start_cell = self._start_cells(grid, position_world[members][:, [0, 2]], goal_cell)
            is_possible = start_cell >= 0
            self.corner_count[members[~is_possible]] = 0
            self.status[members[~is_possible]] = UNREACHABLE
            shares = is_possible & self.shares_goal[members]
            own = is_possible & ~self.shares_goal[members]
            self._search_ways(grid, members[own], start_cell[own], goal_cell[own], position_world)
            for cell in np.unique(goal_cell[shares]).tolist():
                sharing = shares & (goal_cell == cell)
                self._descend_field(grid, number, cell, members[sharing], start_cell[sharing], position_world)

    def _start_cells(self, grid: Grid, points: FloatArray, goal_cell: IntArray) -> IntArray:
        """Cells from which to start, in the goal's part of the grid; -1 where there is no way."""
        cells = grid.nearest_cells(points)
        cells[goal_cell < 0] = -1
        elsewhere = np.flatnonzero((cells >= 0) & (grid.component[cells] != grid.component[goal_cell]))
        if elsewhere.size:
            # A body pressed into a corner may stand in a pocket of the grid; behind a wall is no way out.
            reach = 2.0 * grid.radius + grid.layout.cell_size
            near = grid.nearest_cells(points[elsewhere], grid.component[goal_cell[elsewhere]], reach)
            for index, cell in zip(elsewhere.tolist(), near.tolist(), strict=True):
                is_beside = cell >= 0 and grid.is_free_line(points[index], grid.point[cell], THIN_BODY)
                cells[index] = cell if is_beside else -1
        return cells

    def _search_ways(
        self,
        grid: Grid,
        characters: IntArray,
        start_cell: IntArray,
        goal_cell: IntArray,
        position_world: FloatArray,
    ) -> None:
        """Find own ways by A*."""
        waiting = np.arange(characters.size)
        landmark_cost = np.zeros((0, grid.layout.cell_count), np.int32)
        if characters.size >= self.settings.searches_for_landmarks:
            landmark_cost = grid.landmark_cost
        while waiting.size:
            members = characters[waiting]
            route_by_search(
                grid.arrays,
                grid.walls,
                landmark_cost,
                members,
                start_cell[waiting],
                goal_cell[waiting],
                position_world,
                self.goal_world,
                self.settings.widest_lane,
                *self._scratch.arrays(grid, waiting.size),
                self._scratch.cells(grid),
                self.corner,
                self.rest,
                self.corner_count,
                self.status,
            )
            waiting = waiting[self.status[members] == OVERFLOW]
            if waiting.size:
                self._scratch.lengthen_queue()

    def _descend_field(
        self,
        grid: Grid,
        number: int,
        goal_cell: int,
        characters: IntArray,
        start_cell: IntArray,
        position_world: FloatArray,
    ) -> None:
        """Find the ways of characters with one goal down its distance field."""
        key = (self.world.digest.tobytes(), number, goal_cell)
        if key not in self._fields:
            self._fields[key] = grid.field(np.array([goal_cell], np.int32))
            while len(self._fields) > self.settings.most_fields:
                self._fields.popitem(last=False)
        self._fields.move_to_end(key)
        route_by_field(
            grid.arrays,
            grid.walls,
            self._fields[key],
            characters,
            start_cell,
            position_world,
            self.goal_world,
            self.settings.widest_shared_lane,
            self._scratch.cells(grid),
            self.corner,
            self.rest,
            self.corner_count,
            self.status,
        )


class SearchScratch:
    """Work arrays of A*, made when first needed and kept for grids of the same size."""

    def __init__(self) -> None:
        self._generation = 0
        self._record: npt.NDArray[np.int64] = np.zeros((0, 0), np.int64)
        self._head: IntArray = np.zeros((0, BUCKETS), np.int32)
        self._queue: npt.NDArray[np.int64] = np.zeros((0, 0), np.int64)
        self._cells: IntArray = np.zeros((0, 0), np.int32)

    def arrays(
        self, grid: Grid, queries: int
    ) -> tuple[int, npt.NDArray[np.int64], IntArray, npt.NDArray[np.int64]]:
        """First of `queries` unused generations, record, head and queue."""
        size = grid.layout.cell_count
        if self._record.shape[1] != size:
            chunks = chunk_count(size)
            self._record = np.full((chunks, size), FRESH_RECORD)
            self._head = np.zeros((chunks, BUCKETS), np.int32)
            self._queue = np.zeros((chunks, size // 2 + 64), np.int64)
            self._generation = 0
        if self._generation + queries > LAST_GENERATION:
            self._record[:] = FRESH_RECORD
            self._generation = 0
        first = self._generation + 1
        self._generation += queries
        return first, self._record, self._head, self._queue

    def lengthen_queue(self) -> None:
        """Make twice as much room for open cells."""
        self._queue = np.zeros((self._queue.shape[0], 2 * self._queue.shape[1]), np.int64)

    def cells(self, grid: Grid) -> IntArray:
        """Room for the cells of a way in each chunk."""
        size = grid.layout.cell_count
        if self._cells.shape[1] != size:
            self._cells = np.zeros((chunk_count(size), size), np.int32)
        return self._cells


def chunk_count(cell_count: int) -> int:
    """Sets of scratch arrays: what several threads can use, but one for huge grids, to save memory."""
    return SEARCH_CHUNKS if cell_count <= MOST_CELLS_FOR_CHUNKS else 1
