"""Neighbour search and reciprocal avoidance of discs that cross an open or a dense square, beside pyrvo."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.case import Case, Run
from crowd.navigation.avoidance import Avoidance, AvoidanceSettings
from crowd.navigation.patience import Patience
from crowd.world.walls import Walls
from crowd_kernels import _jit

DT = 0.1
RADIUS = 0.25
PREFERRED_SPEED = 1.34
MAXIMUM_SPEED = 1.6
OPEN_DENSITY, DENSE_DENSITY = 0.5, 2.0
MOST_UNSAFE = {OPEN_DENSITY: 0.08, DENSE_DENSITY: 0.35}
"""Share of characters that may come to meet another within a second: those that no velocity makes safe."""
LEAST_RATE = 1.5e6
"""Characters that must be steered in a second on one thread, in the open."""


@dataclass
class Discs:
    """Discs with goals on the other side of a square."""

    density: float
    avoidance: Avoidance
    patience: Patience
    position: Any
    velocity: Any
    preferred: Any
    radius: Any
    maximum_speed: Any
    responsibility: Any
    mobility: Any
    active: Any
    walls: Walls
    new_velocity: Any
    peer: Any = None


def set_up(density: float, has_walls: bool, size: int, rng: np.random.Generator) -> Discs:
    """Put discs on a jittered lattice and let them move for three seconds."""
    _jit.set_thread_count(1)
    side = math.ceil(math.sqrt(size))
    step = 1.0 / math.sqrt(density)
    lattice = np.stack(np.divmod(np.arange(size), side), axis=1) * step
    jitter = rng.uniform(-0.5, 0.5, (size, 2)) * max(step - 2 * RADIUS, 0.0) * 0.9
    position = np.zeros((size, 3))
    position[:, [0, 2]] = lattice + jitter
    direction = rng.uniform(0, 2 * np.pi, size)
    preferred = PREFERRED_SPEED * np.stack([np.sin(direction), 0 * direction, np.cos(direction)], axis=1)
    extent = side * step
    boxes = [
        [(x, z), (x + 1.0, z), (x + 1.0, z + 1.0), (x, z + 1.0)]
        for x, z in rng.uniform(-20.0, extent, (round(extent * extent / 100.0), 2))
    ]
    discs = Discs(
        density,
        Avoidance(AvoidanceSettings(), size),
        Patience(size),
        position,
        np.zeros((size, 3)),
        preferred,
        np.full(size, RADIUS),
        np.full(size, MAXIMUM_SPEED),
        np.full(size, 0.5),
        np.ones(size),
        np.arange(size, dtype=np.int32),
        Walls.build(boxes) if has_walls else Walls.build(),
        np.zeros((size, 3)),
    )
    for number in range(30):
        steer(discs)
        discs.velocity[:] = discs.new_velocity
        before = discs.position.copy()
        discs.position += DT * discs.velocity
        discs.avoidance.project(
            discs.position, before, discs.radius, discs.mobility, discs.active, discs.walls, DT, seed=number
        )
    return discs


def steer(discs: Discs) -> None:
    """Find neighbours and choose velocities."""
    discs.avoidance.steer(
        discs.position,
        discs.velocity,
        discs.preferred,
        discs.radius,
        discs.maximum_speed,
        discs.responsibility,
        discs.active,
        discs.walls,
        DT,
        discs.new_velocity,
    )


def find_neighbors(discs: Discs) -> None:
    """Find the ten nearest others of everyone."""
    discs.avoidance.neighbors(discs.position, discs.radius, discs.active)


def be_patient(discs: Discs) -> None:
    """Rank those who wait."""
    discs.patience.update(
        discs.position,
        discs.preferred.copy(),
        discs.active,
        DT,
        1,
        1,
        discs.responsibility.copy(),
        discs.mobility.copy(),
    )


def is_in_order(discs: Discs) -> str | None:
    """Ranks only lower what the caller gave, and nothing becomes negative."""
    responsibility, mobility = discs.responsibility.copy(), discs.mobility.copy()
    preferred = discs.preferred.copy()
    discs.patience.update(discs.position, preferred, discs.active, DT, 1, 1, responsibility, mobility)
    is_lower = (responsibility <= discs.responsibility).all() and (mobility <= discs.mobility).all()
    return None if is_lower and min(responsibility.min(), mobility.min()) > 0.0 else "ranks are wrong"


def project(discs: Discs) -> None:
    """Push bodies apart."""
    discs.avoidance.project(
        discs.position, discs.position.copy(), discs.radius, discs.mobility, discs.active, discs.walls, DT
    )


def is_safe(discs: Discs) -> str | None:
    """Few pairs meet within a second, nobody is too fast, and people get on."""
    velocity = discs.new_velocity[:, [0, 2]]
    speed = np.hypot(*velocity.T)
    if not np.isfinite(velocity).all() or speed.max() > MAXIMUM_SPEED + 1e-6:
        return f"speed {speed.max():.3f} m/s"
    found = discs.avoidance.neighbors(discs.position, discs.radius, discs.active)
    point = discs.position[:, [0, 2]]
    unsafe = np.zeros(len(point), bool)
    for rank in range(found.character.shape[1]):
        rows = np.flatnonzero(found.count > rank)
        other = found.character[rows, rank]
        way, relative = point[other] - point[rows], velocity[other] - velocity[rows]
        square = np.maximum((relative**2).sum(axis=1), 1e-12)
        time = np.clip(-(way * relative).sum(axis=1) / square, 0.0, 1.0)
        nearest = np.hypot(*(way + time[:, None] * relative).T)
        apart_now = np.hypot(*way.T) > 2 * RADIUS
        unsafe[rows[(nearest < 2 * RADIUS - 0.05) & apart_now]] = True
    share = float(unsafe.mean())
    return None if share <= MOST_UNSAFE[discs.density] else f"{share:.1%} will collide"


def has_no_overlap(discs: Discs) -> str | None:
    """No two bodies are deeper than 5 cm in each other."""
    found = discs.avoidance.neighbors(discs.position, discs.radius, discs.active)
    nearest = found.distance[found.count > 0, 0].min()
    return None if nearest > 2 * RADIUS - 0.05 else f"overlap of {2 * RADIUS - nearest:.3f} m"


def step_peer(discs: Discs) -> None:
    """Step the same discs with pyrvo, preferred velocities set one by one as its interface asks."""
    import pyrvo

    if discs.peer is None:
        limits = AvoidanceSettings()
        discs.peer = pyrvo.RVOSimulator(
            DT,
            limits.neighbor_distance,
            limits.neighbor_count,
            limits.time_horizon,
            limits.wall_time_horizon,
            RADIUS,
            MAXIMUM_SPEED,
        )
        for row in range(len(discs.position)):
            discs.peer.add_agent((discs.position[row, 2], discs.position[row, 0]))
            velocity = discs.velocity[row]
            discs.peer.set_agent_velocity(row, (velocity[2], velocity[0]))
    for row, preferred in enumerate(discs.preferred.tolist()):
        discs.peer.set_agent_pref_velocity(row, (preferred[2], preferred[0]))
    discs.peer.do_step()


def peers() -> dict[str, Run]:
    """pyrvo (RVO2 in C++) where it is installed."""
    try:
        import pyrvo  # noqa: F401
    except ImportError:
        return {}
    return {"pyrvo": step_peer}


CASES = [
    Case(
        "steer: open, 0.5 per m2",
        (1000, 10_000),
        lambda size, rng: set_up(OPEN_DENSITY, False, size, rng),
        steer,
        is_safe,
        peers=peers(),
        bound_us=1e6 / LEAST_RATE,
    ),
    Case(
        "steer: dense, 2 per m2",
        (10_000,),
        lambda size, rng: set_up(DENSE_DENSITY, False, size, rng),
        steer,
        is_safe,
        peers=peers(),
    ),
    Case(
        "steer: open, with boxes",
        (10_000,),
        lambda size, rng: set_up(OPEN_DENSITY, True, size, rng),
        steer,
        is_safe,
    ),
    Case(
        "neighbours: ten nearest",
        (10_000,),
        lambda size, rng: set_up(OPEN_DENSITY, False, size, rng),
        find_neighbors,
        has_no_overlap,
    ),
    Case(
        "patience",
        (10_000,),
        lambda size, rng: set_up(OPEN_DENSITY, False, size, rng),
        be_patient,
        is_in_order,
    ),
    Case(
        "push apart: dense",
        (10_000,),
        lambda size, rng: set_up(DENSE_DENSITY, False, size, rng),
        project,
        has_no_overlap,
    ),
]
