"""People who stand in rows and reach, random targets for them, and how fast their joints turn."""

import math

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from crowd.blending.reach_space import LARGEST_GAP, SIDES, ReachSpace
from crowd.controllers.controller import Step
from crowd.motion.library import MotionLibrary
from crowd.motion.rotation import about, conjugate, multiply, rotate, to_vector
from crowd.scenario.schema import DEFAULT_DT, Area, Character, Scenario, WorldTable
from crowd.simulation import Simulation
from crowd_kernels.ik_tree import TreeArrays

FloatArray = npt.NDArray[np.float64]

FAR = 0.5
"""Targets out of reach are farther than this from every blend, m."""


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

    def reach(
        self,
        hand: int,
        target: FloatArray,
        rotation: FloatArray | None = None,
        rows: npt.NDArray[np.int32] | None = None,
    ) -> None:
        """Start to reach for targets (N, 3) with hand rotations (N, 4) in each person's root frame.

        Where rows are given, only these people do; targets and rotations are everyone's all the same.
        """
        state = self.simulation.state
        rows = self.rows if rows is None else rows
        facing = about(1, state.yaw[rows])
        world = rotate(facing, target[rows]) + state.position_world[rows]
        turned = None if rotation is None else multiply(facing, rotation[rows])
        self.simulation.reach.start(state, rows, hand, world, turned)

    def move(
        self, hand: int, target: FloatArray, rotation: FloatArray | None, rows: npt.NDArray[np.int32]
    ) -> None:
        """Move the targets of reaches that are on: as in `reach`, but without anything new beginning."""
        state = self.simulation.state
        facing = about(1, state.yaw[rows])
        state.reach_target_world[rows, hand] = rotate(facing, target[rows]) + state.position_world[rows]
        if rotation is not None:
            state.reach_target_rotation_world[rows, hand] = multiply(facing, rotation[rows])

    def hand(self, hand: int) -> tuple[FloatArray, FloatArray]:
        """Positions (N, 3) and rotations (N, 4) of a hand in the root frame."""
        joint = self.simulation.model.skeleton.joint(f"{SIDES[hand]}_hand")
        joints = self.simulation.joints
        return joints.position_model[:, joint].astype(np.float64), joints.rotation_model[:, joint].astype(
            np.float64
        )

    @property
    def largest_example_acceleration(self) -> float:
        """Largest angular acceleration of any joint in the examples, rad/s^2."""
        joints = self.space.keys.joint
        return max(
            angular_motion(clip.rotation_local[:, None, joints].astype(np.float64), 1.0 / clip.frame_rate)[1]
            for part in self.space.examples
            for clip in part.clips
        )

    def beyond_limits(self) -> float:
        """How far joints that inverse kinematics turns are beyond their limits at most, rad."""
        rotation = self.simulation.joint_rotations_local().astype(np.float64)
        return beyond_limits(self.simulation.reach.tree, rotation)

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


def beyond_limits(tree: TreeArrays, rotation: FloatArray) -> float:
    """Find how far joints are beyond their limits at most, rad; 0 where all are within.

    Parameters
    ----------
    tree : TreeArrays
        Joints that inverse kinematics turns, and their limits: an ellipse of swings and a range of twists.
    rotation : (N, J, 4) float64
        Local rotations of all joints of the skeleton.
    """
    limited = np.flatnonzero((tree.is_limited != 0) & (tree.weight > 0.0))
    inner, outer = tree.parent_frame[limited].astype(float), tree.joint_frame[limited].astype(float)
    framed = multiply(conjugate(inner), multiply(rotation[:, tree.joint[limited]], outer))
    w, x, y, z = np.moveaxis(framed * np.where(framed[..., :1] < 0.0, -1.0, 1.0), -1, 0)
    length = np.maximum(np.hypot(w, z), 1e-12)
    swing = np.stack([x * w - y * z, y * w + x * z], axis=-1) / length[..., None]
    size = np.linalg.norm(swing, axis=-1)
    share = np.linalg.norm(swing * tree.inverse_swing[limited], axis=-1)
    on_ellipse = np.minimum(size / np.maximum(share, 1.0), 1.0)
    swung = 2.0 * (np.arcsin(np.minimum(size, 1.0)) - np.arcsin(on_ellipse))
    low, high = 2.0 * np.arctan(tree.twist[limited].astype(float)).T
    twist = 2.0 * np.arctan2(z, w)
    twisted = np.maximum(twist - high, low - twist) * (tree.is_free[limited, 2] != 0.0)
    return float(max(swung.max(initial=0.0), twisted.max(initial=0.0)))


class JointMotion:
    """Largest angular speed and acceleration of any joint over the steps that were added.

    Parameters
    ----------
    dt : float
        s.

    Attributes
    ----------
    speed, acceleration : float
        rad/s and rad/s^2.
    """

    def __init__(self, dt: float) -> None:
        self.speed = self.acceleration = 0.0
        self._dt = dt
        self._rotation: FloatArray | None = None
        self._velocity: FloatArray | None = None

    def add(self, rotation: FloatArray) -> None:
        """Add the rotations (N, J, 4) of a step."""
        if self._rotation is not None:
            velocity = to_vector(multiply(conjugate(self._rotation), rotation)) / self._dt
            self.speed = max(self.speed, float(np.linalg.norm(velocity, axis=-1).max()))
            if self._velocity is not None:
                change = np.linalg.norm(velocity - self._velocity, axis=-1).max()
                self.acceleration = max(self.acceleration, float(change) / self._dt)
            self._velocity = velocity
        self._rotation = rotation


def angular_motion(rotation: FloatArray, dt: float) -> tuple[float, float]:
    """Largest angular speed and acceleration of any joint over frames (F, N, J, 4)."""
    motion = JointMotion(dt)
    for frame in rotation:
        motion.add(frame)
    return motion.speed, motion.acceleration
