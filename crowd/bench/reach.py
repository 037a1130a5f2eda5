"""How well people reach: thousands of random targets in and out of reach, exactness, limits, smoothness."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from crowd.bench.reachers import FloatArray, JointMotion, Reachers, random_targets, random_turns
from crowd.blending.reach_space import SIDES
from crowd.motion.rotation import conjugate, from_vector, multiply, to_vector
from crowd_kernels.reach_state import OUT_OF_REACH, REACHED

PEOPLE = 1000
FRAME_RATE = 60.0
"""Numbers of frames below are as for so many steps per second."""
GOING, COMING = 85, 110
"""Frames in which every hand has come to its target, and back to rest."""
TURNING = 80
"""Further frames for hands that turn far, to their targets and back each, or that turn round on their way."""
TILT = math.radians(20.0)
"""Largest turn of a rotation that is asked for against that of the examples, rad."""
TWIST = math.radians(140.0)
"""Turn of a rotation that hardly anybody can have."""
SENT_ON = 4
"""How often hands that are sent on get another target."""
SOON, LATE = 4, 50
"""Least and largest time between such targets, frames: on the way to them, and while hands wait."""
SWAY, SWAY_TURN = 0.16, 0.32
"""Way of targets that move, m, and how far they turn, rad: at up to 0.25 m/s and 0.5 rad/s."""
SWAYING = 120
"""Frames of such a way, there and back, which they go twice."""
TOGETHER = 40
"""Largest time between the starts, or the ends, of both hands, frames."""
BOTH_GOING = 260
"""Frames in which both hands have come to their targets, or nearest to them, and back to rest."""
WATCHED = 10
"""Frames over which hands that wait are watched."""
TOLERANCE, ANGLE_TOLERANCE = 1e-3, math.radians(1.0)
LARGEST_RATIO = 1.2
"""Largest angular acceleration over that of the examples."""
FASTEST = 12.0
"""Largest angular speed of a joint, rad/s."""
LEAST_MET = 0.5
"""Least share of hands that are at their targets where both are sent anywhere."""
LARGEST_JITTER = 1e-4
"""Largest motion of a hand that waits, m per frame."""
MOST_BEYOND = math.radians(0.1)
"""Joints are within their limits but for this, rad."""


@dataclass(frozen=True)
class ReachQuality:
    """What one kind of target showed.

    Attributes
    ----------
    name : str
    targets, reached, reported : int
        How many there were, were met, and were reported as out of reach.
    error, angle : float
        Largest distance and angle from what was asked, of those that were met, m and rad.
    acceleration, speed : float
        Largest of any joint, rad/s^2 and rad/s.
    acceleration_ratio : float
        Over the largest of the examples.
    jitter : float
        Largest motion of a waiting hand, m per frame.
    beyond : float
        How far joints were beyond their limits at most, rad.
    problem : str
        What is not as it should be; empty when all is.
    """

    name: str
    targets: int
    reached: int
    reported: int
    error: float
    angle: float
    acceleration: float
    acceleration_ratio: float
    speed: float
    jitter: float
    beyond: float
    problem: str


@dataclass(frozen=True)
class Outcome:
    """What people showed who reached with one hand, all together.

    Attributes
    ----------
    target, place : (N, 3) float64
        Where the hand was to be, and was, root frame, m.
    wanted : (N, 4) float64 or None
        Rotation that was asked for.
    rotation : (N, 4) float64
        That of the hand.
    status : (N,) uint8
    speed, acceleration : float
        Largest of any joint, rad/s and rad/s^2.
    jitter : float
        Largest motion of the waiting hand, m per frame.
    beyond : float
        How far joints were beyond their limits at most, rad.
    """

    target: FloatArray
    wanted: FloatArray | None
    place: FloatArray
    rotation: FloatArray
    status: npt.NDArray[np.uint8]
    speed: float
    acceleration: float
    jitter: float
    beyond: float


class Run:
    """Steps of people who reach, watched: how their joints turn, and how hands move that should wait."""

    def __init__(self, reachers: Reachers) -> None:
        self.reachers = reachers
        self.motion = JointMotion(reachers.simulation.dt)
        self.beyond = 0.0

    def frames(self, count: int) -> int:
        """Frames of this run that take as long as so many of `FRAME_RATE`."""
        return round(count / FRAME_RATE / self.reachers.simulation.dt)

    def step(self, count: int, before: Callable[[int], None] | None = None) -> None:
        """Go on for some frames; `before` is called with the number of each."""
        for frame in range(count):
            if before is not None:
                before(frame)
            self.reachers.step()
            self.motion.add(self.reachers.local_rotations())
            self.beyond = max(self.beyond, self.reachers.beyond_limits())

    def wait(self, hands: Sequence[int]) -> list[float]:
        """Watch hands that wait; gives the largest motion of each in a frame, m."""
        places = []
        for _ in range(WATCHED):
            self.step(1)
            places.append([self.reachers.hand(hand)[0] for hand in hands])
        return [float(most) for most in np.linalg.norm(np.diff(places, axis=0), axis=3).max(axis=(0, 2))]

    def end(self, hands: Sequence[int], frames: npt.NDArray[np.int64], count: int) -> None:
        """Let hands return, each person's (N, H) after some frames, and go on for `count` frames."""

        def let_go(frame: int) -> None:
            for place, hand in enumerate(hands):
                rows = self.reachers.rows[frames[:, place] == frame]
                self.reachers.simulation.reach.end(self.reachers.simulation.state, rows, hand)

        self.step(count, let_go)

    def outcome(
        self, hand: int, target: FloatArray, wanted: FloatArray | None
    ) -> tuple[FloatArray, FloatArray | None, FloatArray, FloatArray, npt.NDArray[np.uint8]]:
        """How a hand stands now: the first fields of an outcome."""
        return (
            target,
            wanted,
            *self.reachers.hand(hand),
            self.reachers.simulation.state.reach_status[:, hand].copy(),
        )


def run_batch(
    reachers: Reachers, hand: int, target: FloatArray, rotation: FloatArray | None, further: int = 0
) -> Outcome:
    """Reach for targets with one hand and return; it has `further` frames for each way."""
    run = Run(reachers)
    reachers.reach(hand, target, rotation)
    run.step(run.frames(GOING + further))
    (jitter,) = run.wait((hand,))
    outcome = run.outcome(hand, target, rotation)
    run.end((hand,), np.zeros((len(target), 1), np.int64), run.frames(COMING + further))
    return Outcome(*outcome, run.motion.speed, run.motion.acceleration, jitter, run.beyond)


def send_on(
    reachers: Reachers,
    hand: int,
    targets: Sequence[FloatArray],
    rotations: Sequence[FloatArray | None],
    rng: np.random.Generator,
    moves: bool = False,
) -> Outcome:
    """Reach for one target after the other without returning, each at a random time; judged is the last.

    Where targets move they sway in any direction and turn about any axis, jump in the middle of that, and
    rest at last where they were given.
    """
    run = Run(reachers)
    people = len(reachers.rows)
    direction, axis = random_turns(people, rng), random_turns(people, rng)
    begun = np.zeros(people, np.int64)
    due = rng.integers(run.frames(SOON), run.frames(LATE), (len(targets), len(reachers.rows)))
    swaying = run.frames(SWAYING)
    due[0] = 0
    due = due.cumsum(axis=0)

    def start(frame: int) -> None:
        for target, rotation, begin in zip(targets, rotations, due, strict=True):
            rows = reachers.rows[begin == frame]
            if rows.size:
                reachers.reach(hand, target, rotation, rows)
                begun[rows] = frame
            if moves:
                share = sway(frame - begun, swaying)[:, None]
                away = SWAY * share
                turn = from_vector(SWAY_TURN * share * axis)
                turned = None if rotation is None else multiply(turn, rotation)
                reachers.move(hand, target + away * direction, turned, reachers.rows[begin == begun])

    moving = 2 * swaying if moves else 0
    run.step(int(due.max()) + moving + run.frames(GOING + 2 * TURNING), start)
    (jitter,) = run.wait((hand,))
    outcome = run.outcome(hand, targets[-1], rotations[-1])
    run.end((hand,), np.zeros((len(reachers.rows), 1), np.int64), run.frames(COMING))
    return Outcome(*outcome, run.motion.speed, run.motion.acceleration, jitter, run.beyond)


def sway(frames: npt.NDArray[np.int64], period: int) -> FloatArray:
    """How far targets are on their way there and back, 0 to 1, some frames (N,) after they came."""
    return np.where(frames < 2 * period, 0.5 - 0.5 * np.cos(2.0 * np.pi * frames / period), 0.0)


def run_both(reachers: Reachers, rng: np.random.Generator, times: int) -> list[Outcome]:
    """Reach with both hands for targets anywhere, `times` one after the other, each hand at its own time."""
    run = Run(reachers)
    hands = range(len(SIDES))
    together, going = run.frames(TOGETHER), run.frames(TOGETHER + BOTH_GOING)
    for _ in range(times):
        target = [random_targets(reachers, hand, rng, is_far=False) for hand in hands]
        due = rng.integers(0, together, (len(reachers.rows), len(hands)))

        def start(frame: int, target: list[FloatArray] = target, due: npt.NDArray[np.int64] = due) -> None:
            for hand in hands:
                rows = reachers.rows[due[:, hand] == frame]
                if rows.size:
                    reachers.reach(hand, target[hand], None, rows)

        run.step(going, start)
    jitter = run.wait(hands)
    outcomes = [run.outcome(hand, target[hand], None) for hand in hands]
    run.end(hands, rng.integers(0, together, (len(reachers.rows), len(hands))), going)
    speed, acceleration = run.motion.speed, run.motion.acceleration
    return [Outcome(*outcomes[hand], speed, acceleration, jitter[hand], run.beyond) for hand in hands]


def measure(targets: int, far: int, seed: int = 0) -> list[ReachQuality]:
    """Reach for random targets, with each hand and with both.

    Parameters
    ----------
    targets : int
        Targets in reach of each hand; each is met first by position, then with a rotation, and the hand is
        sent on to it from others.
    far : int
        Targets out of reach of each hand, and people who reach with both hands.
    seed : int
    """
    people = min(PEOPLE, targets)
    reachers = Reachers(people, seed)
    rng = np.random.default_rng(seed)
    for _ in range(3):
        reachers.step()
    most = reachers.largest_example_acceleration
    batches: dict[str, list[Outcome]] = {}
    for hand, side in enumerate(SIDES):
        near = [near_outcomes(reachers, hand, rng) for _ in range(math.ceil(targets / people))]
        sent = [sent_outcomes(reachers, hand, part["position"], rng) for part in near]
        distant = [far_outcomes(reachers, hand, rng) for _ in range(math.ceil(far / people))]
        for part in (*near, *sent, *distant):
            for name, outcome in part.items():
                batches.setdefault(f"{side} hand, {name}", []).append(outcome)
    for _ in range(math.ceil(far / people)):
        batches.setdefault("both hands, anywhere", []).extend(run_both(reachers, rng, 1))
        batches.setdefault("both hands, anywhere, sent on", []).extend(run_both(reachers, rng, 2))
    return [judge(name, outcomes, most) for name, outcomes in batches.items()]


def near_outcomes(reachers: Reachers, hand: int, rng: np.random.Generator) -> dict[str, Outcome]:
    """Reach for targets in reach, by position and with rotations near to those of the blends."""
    target = random_targets(reachers, hand, rng, is_far=False)
    first = run_batch(reachers, hand, target, None)
    second = run_batch(reachers, hand, target, tilted(first.rotation, rng))
    return {"position": first, "position and rotation": second}


def sent_outcomes(
    reachers: Reachers, hand: int, known: Outcome, rng: np.random.Generator
) -> dict[str, Outcome]:
    """Send a hand on through targets in reach, and with rotations near to those of the blends to and fro."""
    targets = [random_targets(reachers, hand, rng, is_far=False) for _ in range(SENT_ON + 1)]
    other = run_batch(reachers, hand, targets[0], None)
    way = [(known, other)[time % 2] for time in range(SENT_ON + 1)]
    turned = [tilted(end.rotation, rng) for end in way]
    # Rotations come and go on the way, too.
    some = [rotation if time != 1 else None for time, rotation in enumerate(turned)]
    return {
        "sent on": send_on(reachers, hand, targets, [None] * len(targets), rng),
        "sent on, rotation": send_on(reachers, hand, [end.target for end in way], some, rng),
        "moving": send_on(reachers, hand, [end.target for end in way], list(turned), rng, moves=True),
    }


def far_outcomes(reachers: Reachers, hand: int, rng: np.random.Generator) -> dict[str, Outcome]:
    """Reach for targets out of reach, rotations that hardly anybody can have, and both."""
    people = len(reachers.rows)
    target = random_targets(reachers, hand, rng, is_far=True)
    first = run_batch(reachers, hand, target, None)
    wanted = multiply(from_vector(TWIST * random_turns(people, rng)), first.rotation)
    second = run_batch(reachers, hand, target, wanted, TURNING)
    near = random_targets(reachers, hand, rng, is_far=False)
    third = run_batch(reachers, hand, near, wanted, TURNING)
    return {"out of reach": first, "rotation out of reach": third, "both out of reach": second}


def tilted(rotation: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Turn rotations (N, 4) by up to `TILT` each."""
    people = len(rotation)
    return multiply(from_vector(TILT * random_turns(people, rng) * rng.random((people, 1))), rotation)


def judge(name: str, outcomes: list[Outcome], most: float) -> ReachQuality:
    """Sum up outcomes of one kind; `most` is the largest acceleration of the examples."""
    status = np.concatenate([outcome.status for outcome in outcomes])
    error = np.concatenate([np.linalg.norm(outcome.place - outcome.target, axis=1) for outcome in outcomes])
    turned = [
        np.linalg.norm(to_vector(multiply(conjugate(outcome.rotation), outcome.wanted)), axis=1)
        if outcome.wanted is not None
        else np.zeros(len(outcome.target))
        for outcome in outcomes
    ]
    angle = np.concatenate(turned)
    met = (status == REACHED) & (error < TOLERANCE) & (angle < ANGLE_TOLERANCE)
    reported = int((status == OUT_OF_REACH).sum())
    acceleration = max(outcome.acceleration for outcome in outcomes)
    speed = max(outcome.speed for outcome in outcomes)
    jitter = max(outcome.jitter for outcome in outcomes)
    beyond = max(outcome.beyond for outcome in outcomes)
    problems = []
    # Nobody has both hands at any two places; but most people have at least one there.
    is_shared = name.startswith("both hands")
    may_miss = is_shared or "out of reach" in name
    if is_shared and met.mean() < LEAST_MET:
        problems.append(f"less than {LEAST_MET:.0%} reached")
    if may_miss and reported + int(met.sum()) < len(status):
        problems.append("not reported")
    if not may_miss and not met.all():
        problems.append(f"{len(status) - int(met.sum())} not reached")
    if acceleration > LARGEST_RATIO * most:
        problems.append(f"acceleration over {LARGEST_RATIO:g} times that of the examples")
    if speed > FASTEST:
        problems.append(f"speed over {FASTEST:g} rad/s")
    if jitter > LARGEST_JITTER:
        problems.append("jitter")
    if beyond > MOST_BEYOND:
        problems.append("joints beyond their limits")
    return ReachQuality(
        name,
        len(status),
        int(met.sum()),
        reported,
        float(error[met].max(initial=0.0)),
        float(angle[met].max(initial=0.0)),
        acceleration,
        acceleration / most,
        speed,
        jitter,
        beyond,
        ", ".join(problems),
    )
