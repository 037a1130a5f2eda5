"""Ways to goals: one distance field for a goal that many share, a search for each goal of one's own."""

from collections import OrderedDict
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from crowd.state import ByteArray, FloatArray, IntArray
from crowd.world import World
from crowd.world.grid import Grid
from crowd.world.world import RADIUS_STEP, radius_class
from crowd_kernels.grid_search import BUCKETS, OVERFLOW, fill_field
from crowd_kernels.routing import GridArrays, follow_crowd, route_by_field, route_by_search


@dataclass(frozen=True)
class RoutingSettings:
    """How ways are found and followed."""

    most_corners: int = 40
    """Corners kept of a way, >= 2; a longer way is found again where it was cut."""
    look_ahead_period: int = 8
    """Steps after which each character looks whether it can cut a corner, >= 1; larger: cheaper, later."""
    corner_reach: float = 0.3
    """m, > 0. A corner this near is passed."""
    sharing: int = 10
    """Characters with one goal from which on a distance field is cheaper than searches, >= 1."""
    most_fields: int = 32
    """Distance fields kept in memory, >= 1."""
    most_reroutes: int = 256
    """Ways found anew in one step after the world has changed, >= 1; larger: quicker, with longer steps."""


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
        self.radius_class: IntArray = np.zeros(capacity, np.int32)
        self.shares_goal: npt.NDArray[np.bool_] = np.zeros(capacity, np.bool_)
        self.corner: FloatArray = np.zeros((capacity, corners, 2))
        self.rest: FloatArray = np.zeros((capacity, corners))
        self.corner_count: IntArray = np.zeros(capacity, np.int32)
        self.corner_index: IntArray = np.zeros(capacity, np.int32)
        self.status: ByteArray = np.zeros(capacity, np.uint8)
        """0 when there is a way, see `crowd_kernels.routing`. (character,)"""
        self.is_stale: npt.NDArray[np.bool_] = np.zeros(capacity, np.bool_)
        """The way was found before the world changed. (character,)"""
        self.known_world: npt.NDArray[np.uint8] = np.zeros(16, np.uint8)
        """Digest of the obstacles that the ways are for."""
        self.known_world[:] = world.digest
        self._is_lost: ByteArray = np.zeros(capacity, np.uint8)
        self._search = SearchScratch()
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
        self.radius_class[characters] = [radius_class(r) for r in radius]
        _, group, size = np.unique(goal_world, axis=0, return_inverse=True, return_counts=True)
        is_known = [(float(x), float(z)) in self._shared_goals for x, _, z in goal_world]
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
            m.
        out_remaining_distance : (N,) float64
            Length of the way to the goal, m; infinite without a way.
        """
        if not np.array_equal(self.known_world, self.world.digest):
            self.known_world[:] = self.world.digest
            self.is_stale[active] = True
        stale = active[self.is_stale[active]][: self.settings.most_reroutes]
        self._route(stale, position_world)
        for number, members in self._by_class(active):
            follow_crowd(
                grid_arrays(self.world.grid(number * RADIUS_STEP)),
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
            has_way = lost[self.corner_count[lost] > 0]
            out_way_point_world[has_way[:, None], [0, 2]] = self.corner[has_way, 0]

    def _by_class(self, characters: IntArray) -> list[tuple[int, IntArray]]:
        """Characters by the grid they share."""
        classes = self.radius_class[characters]
        return [(int(number), characters[classes == number]) for number in np.unique(classes)]

    def _route(self, characters: IntArray, position_world: FloatArray) -> None:
        """Find the ways of these characters to their goals."""
        if characters.size == 0:
            return
        self.is_stale[characters] = False
        self.corner_index[characters] = 0
        for number, members in self._by_class(characters):
            grid = self.world.grid(number * RADIUS_STEP)
            goal = self.goal_world[members]
            goal_cell = grid.nearest_cells(goal[:, [0, 2]])
            start_cell = self._start_cells(grid, position_world[members][:, [0, 2]], goal_cell)
            is_possible = start_cell >= 0
            self.corner_count[members[~is_possible]] = 0
            self.status[members[~is_possible]] = 1
            own = is_possible & ~self.shares_goal[members]
            self._search_ways(grid, members[own], start_cell[own], goal_cell[own], position_world)
            for cell in np.unique(goal_cell[is_possible & self.shares_goal[members]]):
                sharing = is_possible & self.shares_goal[members] & (goal_cell == cell)
                route_by_field(
                    grid_arrays(grid),
                    self._field(grid, number, int(cell)),
                    members[sharing],
                    start_cell[sharing],
                    position_world,
                    self.goal_world,
                    self._search.cells(grid),
                    self.corner,
                    self.rest,
                    self.corner_count,
                    self.status,
                )

    def _start_cells(self, grid: Grid, points: FloatArray, goal_cell: IntArray) -> IntArray:
        """Cells from which to start: nearest ones in the goal's part; -1 where that is far off."""
        cells = grid.nearest_cells(points)
        cells[goal_cell < 0] = -1
        known = np.maximum(goal_cell, 0)
        elsewhere = np.flatnonzero((cells >= 0) & (grid.component[cells] != grid.component[known]))
        for index in elsewhere:
            part = int(grid.component[goal_cell[index]])
            near = grid.nearest_cells(points[index : index + 1], part)[0]
            gap = np.linalg.norm(grid.point[near] - points[index])
            # A body pressed into a corner may stand in a pocket of the grid; another room is no way out.
            cells[index] = near if gap < 2.0 * grid.radius + grid.layout.cell_size else -1
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
        if characters.size == 0:
            return
        cost, arrival, stamp, head, following, entry = self._search.arrays(grid)
        route_by_search(
            grid_arrays(grid),
            characters,
            start_cell,
            goal_cell,
            position_world,
            self.goal_world,
            self._search.next_generation(characters.size),
            cost,
            arrival,
            stamp,
            head,
            following,
            entry,
            self._search.cells(grid),
            self.corner,
            self.rest,
            self.corner_count,
            self.status,
        )

    def _field(self, grid: Grid, number: int, goal_cell: int) -> IntArray:
        """The distance field of a goal."""
        key = (self.known_world.tobytes(), number, goal_cell)
        if key not in self._fields:
            cost = np.zeros(grid.layout.cell_count, np.int32)
            entries = 4 * grid.layout.cell_count + 8
            goals = np.array([goal_cell], np.int32)
            while True:
                queue = (
                    np.zeros(BUCKETS, np.int32),
                    np.zeros(entries, np.int32),
                    np.zeros(entries, np.int32),
                )
                if fill_field(grid.mask, grid.layout.columns, goals, *queue, cost) != OVERFLOW:
                    break
                entries *= 2
            self._fields[key] = cost
            while len(self._fields) > self.settings.most_fields:
                self._fields.popitem(last=False)
        self._fields.move_to_end(key)
        return self._fields[key]


class SearchScratch:
    """Work arrays of A*, made when first needed and kept for grids of the same size."""

    def __init__(self) -> None:
        self._size = 0
        self._generation = 0
        self._arrays: tuple[npt.NDArray[np.generic], ...] = ()
        self._cells: IntArray = np.zeros(0, np.int32)

    def arrays(self, grid: Grid) -> tuple[npt.NDArray[np.generic], ...]:
        """Cost, arrival, stamp, head, following, entry."""
        size = grid.layout.cell_count
        if size != self._size:
            self._size, self._generation = size, 0
            entries = 8 * size + 8
            self._arrays = (
                np.zeros(size, np.int32),
                np.zeros(size, np.uint8),
                np.zeros(size, np.int32),
                np.zeros(BUCKETS, np.int32),
                np.zeros(entries, np.int32),
                np.zeros(entries, np.int32),
            )
        return self._arrays

    def next_generation(self, queries: int) -> int:
        """First of `queries` unused generation numbers."""
        if self._generation > 2**30:
            self._generation = 0
            self._arrays[2][:] = 0
        first = self._generation + 2
        self._generation += 2 * queries
        return first

    def cells(self, grid: Grid) -> IntArray:
        """Room for the cells of one way."""
        if self._cells.size < grid.layout.cell_count:
            self._cells = np.zeros(grid.layout.cell_count, np.int32)
        return self._cells


def grid_arrays(grid: Grid) -> GridArrays:
    """A grid as the kernels read it."""
    layout = grid.layout
    return GridArrays(
        grid.mask,
        grid.is_open,
        grid.point,
        float(layout.low_x),
        float(layout.low_z),
        float(layout.cell_size),
        layout.columns,
        layout.rows,
    )
