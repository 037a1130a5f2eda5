"""A benchmark case: something that is set up, run, timed and checked, with peers beside it."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

Run = Callable[[Any], None]


@dataclass(frozen=True)
class Case:
    """One benchmark.

    Attributes
    ----------
    name : str
        Unique, for example ``"steer open"``.
    sizes : tuple of int
        Items to run with.
    setup : callable
        ``setup(size, rng)`` makes whatever `run` takes.
    run : callable
        Does the work once.
    check : callable
        After `run`: None when the answer is right, else what is wrong with it.
    reset : callable, optional
        Restores what a run changes, before each run; its time does not count.
    items : callable, optional
        Items that one run works through; the size when left out.
    peers : mapping of str to callable
        The same work done by others, as `run`.
    bound_us : float, optional
        Most microseconds per item.
    least_ratio : float, optional
        Least number of times that the first peer must take.
    """

    name: str
    sizes: tuple[int, ...]
    setup: Callable[[int, np.random.Generator], Any]
    run: Run
    check: Callable[[Any], str | None]
    reset: Run | None = None
    items: Callable[[Any], int] | None = None
    peers: Mapping[str, Run] = field(default_factory=dict)
    bound_us: float | None = None
    least_ratio: float | None = None


@dataclass(frozen=True)
class Result:
    """What a case took.

    Attributes
    ----------
    case : str
    size : int
    us_per_item : float
        Best of several runs, compilation apart.
    peers : dict of str to float
        Microseconds per item of the peers.
    compile_seconds : float
        Time of the first run.
    problem : str or None
        What is wrong: a wrong answer, or a bound that is not kept.
    """

    case: str
    size: int
    us_per_item: float
    peers: dict[str, float]
    compile_seconds: float
    problem: str | None

    @property
    def is_ok(self) -> bool:
        """The answer is right and all bounds are kept."""
        return self.problem is None


def best_seconds(
    run: Run, data: Any, reset: Run | None = None, least_seconds: float = 0.4, most_runs: int = 50
) -> float:
    """Least wall time of one run, after what restores the data."""
    best, begin, runs = float("inf"), time.perf_counter(), 0
    while runs < 3 or (time.perf_counter() - begin < least_seconds and runs < most_runs):
        if reset is not None:
            reset(data)
        start = time.perf_counter()
        run(data)
        best = min(best, time.perf_counter() - start)
        runs += 1
    return best


def measure(case: Case, size: int, seed: int = 1) -> Result:
    """Set up, compile, check and time one case at one size."""
    data = case.setup(size, np.random.default_rng(seed))
    start = time.perf_counter()
    case.run(data)
    compile_seconds = time.perf_counter() - start
    problem = case.check(data)
    items = case.items(data) if case.items else size
    us = best_seconds(case.run, data, case.reset) / items * 1e6
    peers = {}
    for name, run in case.peers.items():
        run(data)
        peers[name] = best_seconds(run, data, most_runs=5) / items * 1e6
    if problem is None and case.bound_us is not None and us > case.bound_us:
        problem = f"{us:.3f} us per item, allowed {case.bound_us:g}"
    if problem is None and case.least_ratio is not None and peers:
        ratio = next(iter(peers.values())) / us
        if ratio < case.least_ratio:
            problem = f"{ratio:.2f} times as fast as {next(iter(peers))}, allowed from {case.least_ratio:g}"
    return Result(case.name, size, us, peers, compile_seconds, problem)
