"""Shortest ways on grids beside pyastar2d; Moving AI maps where they lie beside the checkout."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.case import Case, Run
from benchmarks.movingai import Queries, read_queries
from crowd_kernels import _jit
from crowd_kernels.grid_search import BUCKETS, FOUND, fill_field, mask_moves, search_ways

MAP_FOLDER = Path(__file__).resolve().parents[2] / "shared" / "data" / "movingai"


@dataclass
class Search:
    """Queries with scratch arrays and results."""

    queries: Queries
    mask: Any
    scratch: tuple[Any, ...]
    status: Any
    length: Any
    expansions: Any
    generation: int = 0

    @property
    def columns(self) -> int:
        """Cells in a row."""
        return int(self.queries.is_walkable.shape[1])


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
    start, goal = rng.choice(free, 100), rng.choice(free, 100)
    return Queries(is_walkable, start, goal, np.full(100, np.nan))


def search_for(queries: Queries) -> Search:
    """Prepare a search."""
    _jit.set_thread_count(1)
    rows, columns = queries.is_walkable.shape
    cells, count = rows * columns, len(queries.start)
    mask = np.zeros(cells, np.uint8)
    mask_moves(np.ascontiguousarray(queries.is_walkable.ravel()), columns, rows, mask)
    scratch = (
        np.zeros((1, cells), np.int32),
        np.zeros((1, cells), np.uint8),
        np.zeros((1, cells), np.int32),
        np.zeros((1, BUCKETS), np.int32),
        np.zeros((1, 8 * cells), np.int32),
        np.zeros((1, 8 * cells), np.int32),
    )
    return Search(
        queries, mask, scratch, np.zeros(count, np.int32), np.zeros(count), np.zeros(count, np.int32)
    )


def search(data: Search) -> None:
    """Find all ways."""
    data.generation += 2 * len(data.status) + 2
    cost, arrival, stamp, head, following, entry = data.scratch
    search_ways(
        data.mask,
        data.columns,
        data.queries.start,
        data.queries.goal,
        data.generation,
        cost,
        arrival,
        stamp,
        head,
        following,
        entry,
        data.status,
        data.length,
        data.expansions,
    )


def search_with_peer(data: Search) -> None:
    """Find all ways with pyastar2d, which solves an easier problem: it may cut corners."""
    import pyastar2d

    weight = np.where(data.queries.is_walkable, 1.0, np.inf).astype(np.float32)
    for start, goal in zip(data.queries.start.tolist(), data.queries.goal.tolist(), strict=True):
        ends = divmod(start, data.columns), divmod(goal, data.columns)
        pyastar2d.astar_path(weight, *ends, allow_diagonal=True)


def check(data: Search) -> str | None:
    """Every way is as short as the benchmark says, or as a distance field where it says nothing."""
    for query in range(len(data.status)):
        best = float(data.queries.optimal_length[query])
        if np.isnan(best):
            if query % 20:
                continue
            field = np.zeros(len(data.mask), np.int32)
            queue = (data.scratch[3][0], data.scratch[4][0], data.scratch[5][0])
            fill_field(data.mask, data.columns, data.queries.goal[query : query + 1], *queue, field)
            best = field[data.queries.start[query]] / 70.0
        if data.status[query] != FOUND or data.length[query] > best * (1 + 1e-4) + 1e-9:
            return f"query {query}: length {data.length[query]:.6f}, best {best:.6f}"
    return None


def peers() -> dict[str, Run]:
    """pyastar2d where it is installed."""
    try:
        import pyastar2d  # noqa: F401
    except ImportError:
        return {}
    return {"pyastar2d": search_with_peer}


def map_case(map_path: Path) -> Case:
    """Case of one Moving AI map."""
    scen = map_path.with_name(map_path.name + ".scen")
    return Case(
        f"A*: {map_path.stem}",
        (512,),
        lambda size, rng: search_for(read_queries(map_path, scen)),
        search,
        check,
        items=lambda data: len(data.status),
        peers=peers(),
    )


CASES = [
    Case(
        "A*: rooms",
        (512,),
        lambda size, rng: search_for(rooms(size, rng)),
        search,
        check,
        items=lambda data: len(data.status),
        peers=peers(),
    ),
    *(map_case(path) for path in sorted(MAP_FOLDER.glob("*.map"))),
]
