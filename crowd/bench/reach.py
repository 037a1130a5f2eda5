"""How well people reach: thousands of random targets in and out of reach, exactness, limits, smoothness."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from crowd.blending.reach_space import LARGEST_GAP, SIDES, ReachSpace
from crowd.controllers.controller import Step
from crowd.motion.clip import Clip
from crowd.motion.library import MotionLibrary
from crowd.motion.rotation import conjugate, from_vector, multiply, rotate, to_vector
from crowd.scenario.schema import DEFAULT_DT, Area, Character, Scenario, WorldTable
from crowd.simulation import Simulation
from crowd_kernels.reach_goal import OUT_OF_REACH, REACHED

FloatArray = npt.NDArray[np.float64]

PEOPLE = 1000
GOING, COMING = 85, 110
"""Frames in which every hand has come to its target, and back to rest."""
TURNING = 80
"""Further frames for hands that must turn far, to their targets and back each."""
TILT = math.radians(20.0)
"""Largest turn of a rotation that is asked for against that of the examples, rad."""
TWIST = math.radians(140.0)
"""Turn of a rotation that hardly anybody can have."""
FAR = 0.5
"""Targets out of reach are farther than this from every blend, m."""
WATCHED = 10
"""Frames over which hands that wait are watched."""
TOLERANCE, ANGLE_TOLERANCE = 1e-3, math.radians(1.0)
LARGEST_RATIO = 1.2
"""Largest angular acceleration over that of the examples."""
FASTEST = 12.0
"""Largest angular speed of a joint, rad/s."""
LARGEST_JITTER = 1e-4
"""Largest motion of a hand that waits, m per frame."""


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
    problem: str


class Reachers:
    """People who stand in rows and reach; only idling and reaching move them.

    Parameters
    ----------
    people : int
    seed : int
    motions : MotionLibrary, optional
        Whose reaches are blended; the built-in library when left out.
    dt : float
        s.
    """

    def __init__(
        self, people: int, seed: int, motions: MotionLibrary | None = None, dt: float = DEFAULT_DT
    ) -> None:
        side = math.ceil(math.sqrt(people))
        rng = np.random.default_rng(seed)
        facing = rng.uniform(-180.0, 180.0, people)
        characters = tuple(
            Character(position=(2.0 * (k % side) - side, 2.0 * (k // side) - side), facing=float(facing[k]))
            for k in range(people)
        )
        ground = Area(x=(-side - 4.0, side + 4.0), z=(-side - 4.0, side + 4.0))
        scenario = Scenario(name="reach", dt=dt, world=WorldTable(bounds=ground), characters=characters)
        self.simulation = Simulation(scenario, seed=seed, motions=motions)
        self.rows = np.arange(people, dtype=np.int32)
        self.size = self.simulation.model.people.stature / self.simulation.model.skeleton.stature
        self.index = 0

    @property
    def space(self) -> ReachSpace:
        """The examples that are blended."""
        return self.simulation.reach.space

    def step(self) -> None:
        """Advance idling and reaching, and compute the joints."""
        simulation = self.simulation
        step = Step(
            simulation.model,
            simulation.state,
            self.rows,
            self.index,
            self.index * simulation.dt,
            simulation.dt,
            simulation.seed,
        )
        simulation.idle.evaluate(step)
        simulation.reach.evaluate(step)
        simulation.joints.compute(simulation.state, simulation.model.people, self.rows)
        self.index += 1

    def reach(self, hand: int, target: FloatArray, rotation: FloatArray | None = None) -> None:
        """Start to reach for targets (N, 3) with hand rotations (N, 4) in each person's root frame."""
        state = self.simulation.state
        facing = np.zeros((len(self.rows), 4))
        facing[:, 0], facing[:, 2] = np.cos(0.5 * state.yaw), np.sin(0.5 * state.yaw)
        world = rotate(facing, target) + state.position_world
        turned = None if rotation is None else multiply(facing, rotation)
        self.simulation.reach.start(state, self.rows, hand, world, turned)

    def hand(self, hand: int) -> tuple[FloatArray, FloatArray]:
        """Positions (N, 3) and rotations (N, 4) of a hand in the root frame."""
        joint = self.simulation.model.skeleton.joint(f"{SIDES[hand]}_hand")
        joints = self.simulation.joints
        return joints.position_model[:, joint].astype(np.float64), joints.rotation_model[:, joint].astype(
            np.float64
        )

    def local_rotations(self) -> FloatArray:
        """Rotations (N, J, 4) of the joints that reaches move."""
        chosen = self.simulation.reach.space.keys.joint
        return self.simulation.joint_rotations_local()[:, chosen].astype(np.float64)


def random_targets(reachers: Reachers, hand: int, rng: np.random.Generator, is_far: bool) -> FloatArray:
    """Draw a target for everyone, evenly in the space: in reach, or out of it; root frame, m."""
    point = reachers.space.pseudo[hand].point
    tree = cKDTree(point)
    margin = 1.2 if is_far else LARGEST_GAP
    low, high = point.min(axis=0) - margin, point.max(axis=0) + margin
    found = np.zeros((0, 3))
    while len(found) < len(reachers.rows):
        tried = low + (high - low) * rng.random((20 * len(reachers.rows), 3))
        distance, _ = tree.query(tried)
        found = np.concatenate([found, tried[distance > FAR if is_far else distance < LARGEST_GAP]])
    return np.asarray(found[: len(reachers.rows)] * reachers.size[:, None])


def random_turns(count: int, rng: np.random.Generator) -> FloatArray:
    """Draw rotation vectors (N, 3) of 1 rad about any axis."""
    axis = rng.normal(size=(count, 3))
    return np.asarray(axis / np.linalg.norm(axis, axis=1, keepdims=True))


def angular_motion(rotation: FloatArray, dt: float) -> tuple[float, float]:
    """Largest angular speed and acceleration of any joint over frames (F, N, J, 4)."""
    speed = to_vector(multiply(conjugate(rotation[:-1]), rotation[1:])) / dt
    acceleration = np.diff(speed, axis=0) / dt
    return float(np.linalg.norm(speed, axis=-1).max()), float(np.linalg.norm(acceleration, axis=-1).max())


def example_acceleration(clips: tuple[Clip, ...], joints: npt.NDArray[np.int32]) -> float:
    """Largest angular acceleration of any joint in the examples, rad/s^2."""
    return max(
        angular_motion(clip.rotation_local[:, None, joints].astype(np.float64), 1.0 / clip.frame_rate)[1]
        for clip in clips
    )


def run_batch(
    reachers: Reachers, hand: int, target: FloatArray, rotation: FloatArray | None, further: int = 0
) -> tuple[FloatArray, FloatArray, npt.NDArray[np.uint8], float, float, float]:
    """Reach for targets and return; gives positions, rotations, statuses, speed, acceleration and jitter.

    Hands have `further` frames for each way.
    """
    going = GOING + further
    state, dt = reachers.simulation.state, reachers.simulation.dt
    frames, waiting = [], []
    reachers.reach(hand, target, rotation)
    for frame in range(going + WATCHED):
        reachers.step()
        frames.append(reachers.local_rotations())
        if frame >= going:
            waiting.append(reachers.hand(hand)[0])
    place, turned = reachers.hand(hand)
    status = state.reach_status[:, hand].copy()
    reachers.simulation.reach.end(state, reachers.rows, hand)
    for _ in range(COMING + further):
        reachers.step()
        frames.append(reachers.local_rotations())
    speed, acceleration = 0.0, 0.0
    for begin in range(0, len(frames) - 2, 40):
        part = angular_motion(np.array(frames[begin : begin + 42]), dt)
        speed, acceleration = max(speed, part[0]), max(acceleration, part[1])
    jitter = float(np.linalg.norm(np.diff(np.array(waiting), axis=0), axis=2).max())
    return place, turned, status, speed, acceleration, jitter


def measure(targets: int, far: int, seed: int = 0) -> list[ReachQuality]:
    """Reach for random targets with each hand.

    Parameters
    ----------
    targets : int
        Targets in reach of each hand; each is met first by position, then with a rotation.
    far : int
        Targets out of reach of each hand.
    seed : int
    """
    people = min(PEOPLE, targets)
    reachers = Reachers(people, seed)
    rng = np.random.default_rng(seed)
    for _ in range(3):
        reachers.step()
    clips = tuple(clip for part in reachers.space.examples for clip in part.clips)
    most = example_acceleration(clips, reachers.space.keys.joint)
    results = []
    for hand, side in enumerate(SIDES):
        batches: dict[str, list[Batch]] = {
            "position": [],
            "position and rotation": [],
            "out of reach": [],
            "rotation out of reach": [],
            "both out of reach": [],
        }
        for _ in range(math.ceil(targets / people)):
            target = random_targets(reachers, hand, rng, is_far=False)
            first = run_batch(reachers, hand, target, None)
            batches["position"].append((target, None, *first))
            tilt = random_turns(people, rng) * rng.random((people, 1))
            wanted = multiply(from_vector(TILT * tilt), first[1])
            second = run_batch(reachers, hand, target, wanted)
            batches["position and rotation"].append((target, wanted, *second))
        for _ in range(math.ceil(far / people)):
            target = random_targets(reachers, hand, rng, is_far=True)
            first = run_batch(reachers, hand, target, None)
            batches["out of reach"].append((target, None, *first))
            wanted = multiply(from_vector(TWIST * random_turns(people, rng)), first[1])
            second = run_batch(reachers, hand, target, wanted, TURNING)
            batches["both out of reach"].append((target, wanted, *second))
            target = random_targets(reachers, hand, rng, is_far=False)
            third = run_batch(reachers, hand, target, wanted, TURNING)
            batches["rotation out of reach"].append((target, wanted, *third))
        results += [judge(f"{side} hand, {name}", part, most) for name, part in batches.items() if part]
    return results


Batch = tuple[
    FloatArray, FloatArray | None, FloatArray, FloatArray, npt.NDArray[np.uint8], float, float, float
]
"""Targets, rotations asked for, and what `run_batch` gives."""


def judge(name: str, batches: list[Batch], most: float) -> ReachQuality:
    """Sum up batches of one kind; `most` is the largest acceleration of the examples."""
    status = np.concatenate([batch[4] for batch in batches])
    error = np.concatenate([np.linalg.norm(batch[2] - batch[0], axis=1) for batch in batches])
    turned = [
        np.linalg.norm(to_vector(multiply(conjugate(batch[3]), batch[1])), axis=1)
        if batch[1] is not None
        else np.zeros(len(batch[0]))
        for batch in batches
    ]
    angle = np.concatenate(turned)
    met = (status == REACHED) & (error < TOLERANCE) & (angle < ANGLE_TOLERANCE)
    reported = int((status == OUT_OF_REACH).sum())
    acceleration, jitter = max(batch[6] for batch in batches), max(batch[7] for batch in batches)
    speed = max(batch[5] for batch in batches)
    problems = []
    is_far = "out of reach" in name
    if is_far and reported + int(met.sum()) < len(status):
        problems.append("not reported")
    if not is_far and not met.all():
        problems.append(f"{len(status) - int(met.sum())} not reached")
    if acceleration > LARGEST_RATIO * most:
        problems.append(f"acceleration over {LARGEST_RATIO:g} times that of the examples")
    if speed > FASTEST:
        problems.append(f"speed over {FASTEST:g} rad/s")
    if jitter > LARGEST_JITTER:
        problems.append("jitter")
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
        ", ".join(problems),
    )
