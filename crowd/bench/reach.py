"""How well people reach: thousands of random targets in and out of reach, exactness, limits, smoothness."""

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from crowd.blending.reach_space import SIDES, ReachSpace
from crowd.controllers.controller import Step
from crowd.motion.rotation import multiply, rotate
from crowd.scenario.schema import Area, Character, Scenario, WorldTable
from crowd.simulation import Simulation

FloatArray = npt.NDArray[np.float64]

PEOPLE = 1000
LONGEST = 2.0
"""Time in which every hand has come to its target, s."""
TILT = math.radians(20.0)
"""Largest turn of a rotation that is asked for against that of the examples, rad."""
SETTLED = 10
"""Frames over which a hand that cannot reach its target is watched."""
FINGERS_AND_EYES = ("thumb", "index", "middle", "ring", "little", "eye")


@dataclass
class ReachQuality:
    """What a run of random targets showed; one entry for each target unless stated otherwise.

    Attributes
    ----------
    name : str
    error, angle : list of (M,) float64
        Distance and angle of the hands from what was asked, m and rad.
    status : list of (M,) uint8
    acceleration : list of float
        Largest angular acceleration of any joint in each batch, rad/s^2.
    speed : list of float
        Largest angular speed of any joint in each batch, rad/s.
    beyond_limit : list of float
        Farthest that inverse kinematics left a joint's limit beyond what its example does, rad.
    jitter : list of float
        Largest motion of a hand while it waits at the nearest point, m per frame.
    """

    name: str
    error: list[FloatArray] = field(default_factory=list)
    angle: list[FloatArray] = field(default_factory=list)
    status: list[npt.NDArray[np.uint8]] = field(default_factory=list)
    acceleration: list[float] = field(default_factory=list)
    speed: list[float] = field(default_factory=list)
    jitter: list[float] = field(default_factory=list)


class Reachers:
    """People who stand in rows and reach; only idling and reaching move them.

    Parameters
    ----------
    people : int
    seed : int
    """

    def __init__(self, people: int, seed: int) -> None:
        side = math.ceil(math.sqrt(people))
        rng = np.random.default_rng(seed)
        facing = rng.uniform(-180.0, 180.0, people)
        characters = tuple(
            Character(position=(2.0 * (k % side) - side, 2.0 * (k // side) - side), facing=float(facing[k]))
            for k in range(people)
        )
        ground = Area(x=(-side - 4.0, side + 4.0), z=(-side - 4.0, side + 4.0))
        scenario = Scenario(name="reach", world=WorldTable(bounds=ground), characters=characters)
        self.simulation = Simulation(scenario, seed=seed)
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
