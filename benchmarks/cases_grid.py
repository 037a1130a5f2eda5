"""Shortest ways and distance fields on grids, beside pyastar2d.

Moving AI maps are used where they lie beside the checkout.

A search with landmarks is timed with the making of the landmarks, once for all queries of a map.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from benchmarks.case import Case, Run
from benchmarks.movingai import Queries, read_queries
from crowd.navigation.routing import Routing
from crowd.world import World
from crowd.world.obstacles import Box
from crowd_kernels import _jit
from crowd_kernels.distance_field import fill_field
from crowd_kernels.grid_search import BUCKETS, FOUND, FRESH_RECORD, UNSEEN, search_ways
from crowd_kernels.walkable import link_cells, mask_links

MAP_FOLDER = Path(__file__).resolve().parents[2] / "shared" / "data" / "movingai"
LANDMARKS = 4


@dataclass
class Search:
    """Queries with scratch arrays and results."""

    queries: Queries
    mask: npt.NDArray[np.uint8]
    head: npt.NDArray[np.int32]
    queue: npt.NDArray[np.int64]
    record: npt.NDArray[np.int64]
    landmark_cost: npt.NDArray[np.int32]
    status: npt.NDArray[np.int32]
    length: npt.NDArray[np.float64]
    expansions: npt.NDArray[np.int32]
    generation: int = 1
    cost: npt.NDArray[np.int32] = field(init=False)

    def __post_init__(self) -> None:
        self.cost = np.zeros(self.mask.size, np.int32)

    @property
    def columns(self) -> int:
        """Cells in a row."""
        return int(self.queries.is_walkable.shape[1])

    @property
    def count(self) -> int:
        """Number of queries."""
        return len(self.queries.start)


def rooms(size: int, rng: np.random.Generator) -> Queries:
    """A map of rooms with doors, and random queries."""
    is_walkable = np.ones((size, size), np.uint8)
    is_walkable[::32] = 0
    is_walkable[:, ::32] = 0
    for wall in range(32, size, 32):
        for room in range(0, size, 32):
            door = int(rng.integers(4, 26))
            is_walkable[wall, room + door : room + door + 3] = 1
            is_walkable[room + door : room + door + 3, wall] = 1
    free = np.flatnonzero(is_walkable.ravel()).astype(np.int32)
    start, goal = rng.choice(free, 200), rng.choice(free, 200)
    return Queries(is_walkable, start, goal, np.full(200, np.nan))


def search_for(queries: Queries) -> Search:
    """Prepare a search."""
    _jit.set_thread_count(1)
    rows, columns = queries.is_walkable.shape
    cells, count = rows * columns, len(queries.start)
    link, mask = np.zeros(cells, np.uint8), np.zeros(cells, np.uint8)
    link_cells(np.ascontiguousarray(queries.is_walkable.ravel()), columns, rows, link)
    mask_links(link, columns, rows, 0, columns, 0, rows, mask)
    return Search(
        queries,
        mask,
        np.zeros((1, BUCKETS), np.int32),
        np.zeros((1, 2 * cells), np.int64),
        np.full((1, cells), FRESH_RECORD),
        np.zeros((0, cells), np.int32),
        np.zeros(count, np.int32),
        np.zeros(count),
        np.zeros(count, np.int32),
    )


def fill(data: Search, goal: int, cost: npt.NDArray[np.int32]) -> None:
    """Compute the distance field of one goal."""
    fill_field(data.mask, data.columns, np.array([goal], np.int32), data.head[0], data.queue[0], cost)


def search(data: Search) -> None:
    """Find all ways."""
    search_ways(
        data.mask,
        data.columns,
        data.queries.start,
        data.queries.goal,
        data.generation,
        data.landmark_cost,
        data.record,
        data.head,
        data.queue,
        data.status,
        data.length,
        data.expansions,
    )
    data.generation += data.count


def search_with_landmarks(data: Search) -> None:
    """Choose landmarks far from each other, then find all ways."""
    cost = np.zeros((LANDMARKS, data.mask.size), np.int32)
    fill(data, int(data.queries.start[0]), data.cost)
    for landmark in range(LANDMARKS):
        fill(data, int(np.argmax(np.where(data.cost < UNSEEN, data.cost, -1))), cost[landmark])
        data.cost[:] = cost[0] if landmark == 0 else np.minimum(data.cost, cost[landmark])
    data.landmark_cost = cost
    search(data)


def fill_one(data: Search) -> None:
    """Compute the distance field of the first goal."""
    fill(data, int(data.queries.goal[0]), data.cost)


def search_with_peer(data: Search) -> None:
    """Find all ways with pyastar2d, which solves an easier problem: it may cut corners."""
    import pyastar2d

    weight = np.where(data.queries.is_walkable, 1.0, np.inf).astype(np.float32)
    for start, goal in zip(data.queries.start.tolist(), data.queries.goal.tolist(), strict=True):
        ends = divmod(start, data.columns), divmod(goal, data.columns)
        pyastar2d.astar_path(weight, *ends, allow_diagonal=True)


def check(data: Search) -> str | None:
    """Every way is as short as the benchmark says, or as a distance field where it says nothing."""
    for query in range(data.count):
        best = float(data.queries.optimal_length[query])
        allowed = best * (1 + 1e-4) + 1e-9
        if np.isnan(best):
            if query % 20:
                continue
            fill(data, int(data.queries.goal[query]), data.cost)
            best = data.cost[data.queries.start[query]] / 70.0
            allowed = best + 1e-9
        if data.status[query] != FOUND or not data.length[query] <= allowed:
            return f"query {query}: length {data.length[query]:.6f}, best {best:.6f}"
    return None


def check_field(data: Search) -> str | None:
    """The field agrees with the lengths of optimal ways to its goal."""
    same = np.flatnonzero(data.queries.goal == data.queries.goal[0])
    for query in same.tolist():
        best = float(data.queries.optimal_length[query])
        found = data.cost[data.queries.start[query]] / 70.0
        if not np.isnan(best) and not abs(found - best) <= 1e-4 * best:
            return f"query {query}: field {found:.6f}, best {best:.6f}"
    return None if data.cost[data.queries.goal[0]] == 0 else "the goal's own cost is not 0"


def peers() -> dict[str, Run]:
    """pyastar2d where it is installed."""
    try:
        import pyastar2d  # noqa: F401
    except ImportError:
        return {}
    return {"pyastar2d": search_with_peer}


def map_cases(name: str, read: Any) -> list[Case]:
    """Cases of one map: plain A*, and A* with landmarks."""
    return [
        Case(
            f"A*: {name}",
            (512,),
            read,
            search,
            check,
            items=lambda data: data.count,
            peers=peers(),
            least_ratio=1.0,
        ),
        Case(
            f"A* with landmarks: {name}",
            (512,),
            read,
            search_with_landmarks,
            check,
            items=lambda data: data.count,
            peers=peers(),
            least_ratio=2.0,
        ),
        Case(
            f"distance field: {name}",
            (512,),
            read,
            fill_one,
            check_field,
            items=lambda data: data.mask.size,
            bound_us=0.035,
        ),
    ]


def read_map_case(map_path: Path) -> Any:
    """Setup of the cases of one Moving AI map."""
    scen = map_path.with_name(map_path.name + ".scen")
    return lambda size, rng: search_for(read_queries(map_path, scen))


@dataclass
class Forest:
    """People with goals of their own among 700 boxes, as in the SteerBench forest."""

    world: World
    routing: Routing
    position_world: npt.NDArray[np.float64]
    goal_world: npt.NDArray[np.float64]
    way_point_world: npt.NDArray[np.float64]
    remaining_distance: npt.NDArray[np.float64]
    step: int = 0

    @property
    def rows(self) -> npt.NDArray[np.int32]:
        """All characters."""
        return np.arange(len(self.position_world), dtype=np.int32)


def forest(size: int, rng: np.random.Generator) -> Forest:
    """Plant a forest and send people through it."""
    _jit.set_thread_count(1)
    corners = rng.uniform(-99, 98, (700, 2)).tolist()
    world = World((-100, 100, -100, 100), [Box(x, x + 0.98, z, z + 0.98) for x, z in corners])
    points = np.zeros((2, size, 3))
    points[:, :, 0], points[:, :, 2] = rng.uniform(-99, 99, (2, 2, size))
    position_world, goal_world = (world.nearest_walkable(ends, 0.5) for ends in points)
    data = Forest(
        world, Routing(world, size), position_world, goal_world, np.zeros((size, 3)), np.zeros(size)
    )
    find_routes(data)
    return data


def find_routes(data: Forest) -> None:
    """Find everyone's way."""
    data.routing.set_goals(data.rows, data.goal_world, np.full(len(data.rows), 0.5), data.position_world)


def follow_routes(data: Forest) -> None:
    """Find everyone's way point in eight steps, in which everyone looks ahead once."""
    for _ in range(8):
        data.routing.way_points(
            data.position_world, data.rows, data.step, data.way_point_world, data.remaining_distance
        )
        data.step += 1


def check_routes(data: Forest) -> str | None:
    """Everybody has a way, and none is far longer than the straight line."""
    if (data.routing.corner_count == 0).any():
        return f"{int((data.routing.corner_count == 0).sum())} characters without a way"
    first = data.routing.corner[:, 0] - data.position_world[:, [0, 2]]
    length = np.hypot(first[:, 0], first[:, 1]) + data.routing.rest[:, 0]
    line = data.goal_world - data.position_world
    detour = float(length.sum() / np.hypot(line[:, 0], line[:, 2]).sum())
    return None if detour < 1.1 else f"ways are {detour:.2f} times as long as straight lines"


CASES = [
    *map_cases("rooms", lambda size, rng: search_for(rooms(size, rng))),
    *(
        case
        for path in sorted(MAP_FOLDER.glob("*.map"))
        for case in map_cases(path.stem, read_map_case(path))
    ),
    Case("routes: forest", (4000,), forest, find_routes, check_routes, bound_us=375.0),
    Case(
        "way points: forest",
        (10_000,),
        forest,
        follow_routes,
        check_routes,
        items=lambda data: 8 * len(data.rows),
        bound_us=0.2,
    ),
]
