"""Stages of the frame, each alone, in a crowd that walks in the open at 0.5 people per square metre."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from benchmarks.case import Case
from crowd.bench.frames import scene
from crowd.controllers.animation import Animation
from crowd.controllers.controller import Step
from crowd.controllers.foot_lock import FootLock
from crowd.controllers.idle import Idle
from crowd.controllers.locomotion import Locomotion
from crowd.controllers.world_offset import WorldOffset
from crowd.joints import Joints
from crowd.navigation.navigator import Navigator
from crowd.navigation.routing import Routing
from crowd.simulation import Simulation
from crowd.state import Float32Array
from crowd_kernels import _jit
from crowd_kernels.limb_ik import REACHED, crowd_two_bone_ik

LONGEST_WAY = 1e4
LANDING_HEIGHT = 0.05
"""A foot that has just landed may still be this far above the ground, m."""


@dataclass
class Walkers:
    """A crowd after some seconds, with one step to repeat."""

    simulation: Simulation
    step: Step
    pose_rotation: Float32Array
    pose_pelvis: Float32Array

    @property
    def navigator(self) -> Navigator:
        """Way points and avoidance."""
        return self.simulation.navigator

    @property
    def routing(self) -> Routing:
        """Ways."""
        return self.simulation.navigator.routing

    @property
    def layers(self) -> tuple[WorldOffset, Idle, Locomotion, Animation]:
        """The controller stack."""
        simulation = self.simulation
        return simulation.world_offset, simulation.idle, simulation.locomotion, simulation.animation

    @property
    def foot_lock(self) -> FootLock:
        """Planted feet."""
        return self.simulation.foot_lock

    @property
    def joints(self) -> Joints:
        """Forward kinematics."""
        return self.simulation.joints


def set_up(size: int, rng: np.random.Generator) -> Walkers:
    """Let a crowd walk for two seconds; a tenth of it plays a gesture."""
    simulation = Simulation(scene("walking_open", size), seed=int(rng.integers(1000)), is_threaded=False)
    _jit.set_thread_count(1)
    simulation.commands.play(np.arange(0, size, 10), "talk", seconds=1e6)
    for _ in simulation.run(seconds=2.0):
        pass
    active = simulation.population.active(simulation.state)
    step = Step(
        simulation.model,
        simulation.state,
        active,
        simulation.step_index,
        simulation.time,
        simulation.dt,
        simulation.seed,
    )
    for layer in simulation.controllers:
        layer.evaluate(step)
    return Walkers(
        simulation,
        step,
        simulation.state.pose_rotation.copy(),
        simulation.state.pose_pelvis.copy(),
    )


def navigate(walkers: Walkers) -> None:
    """Find way points."""
    walkers.navigator.navigate(walkers.step)


def steer(walkers: Walkers) -> None:
    """Rank those who wait, and avoid others."""
    walkers.navigator.steer(walkers.step)


def locomote(walkers: Walkers) -> None:
    """Wishes, limits, examples and weights, gait state."""
    walkers.simulation.locomotion.command(walkers.step)


def animate(walkers: Walkers) -> None:
    """World offset, idle, locomotion, animation."""
    for layer in walkers.layers:
        layer.evaluate(walkers.step)


def project(walkers: Walkers) -> None:
    """Push bodies apart."""
    walkers.navigator.project(walkers.step)


def lock_feet(walkers: Walkers) -> None:
    """Hold planted feet, in the pose that the layers left."""
    simulation, state = walkers.simulation, walkers.step.state
    state.pose_rotation[:], state.pose_pelvis[:] = walkers.pose_rotation, walkers.pose_pelvis
    walkers.foot_lock.evaluate(
        state.pose_rotation,
        state.pose_pelvis,
        simulation.model.people.segment_scale,
        state.position_world,
        state.yaw,
        simulation.locomotion.contact_wanted,
        walkers.step.active,
        walkers.step.dt,
        state.foot_point_world,
        state.foot_contact,
    )


def is_sound(walkers: Walkers) -> str | None:
    """Everything is finite, weights are valid, ways lead somewhere, planted feet are on the ground."""
    state = walkers.step.state
    for name, array in state.arrays():
        may_be_infinite = name in ("remaining_distance", "play_end")
        if np.issubdtype(array.dtype, np.floating) and not may_be_infinite and not np.isfinite(array).all():
            return f"{name} is not finite"
    if not np.allclose(state.example_weight.sum(axis=1), 1.0, atol=1e-9):
        return "weights of the examples do not sum to 1"
    if not (state.remaining_distance < LONGEST_WAY).all():
        return "somebody has no way to the goal"
    height = np.where(
        state.foot_contact == 1, state.foot_point_world[..., 0, 1], state.foot_point_world[..., 1, 1]
    )
    deepest = np.abs(height[state.foot_contact > 0]).max()
    return None if deepest < LANDING_HEIGHT else f"a planted foot is {deepest:.3f} m off the ground"


def case(name: str, run: Callable[[Walkers], None], bound_us: float | None = None) -> Case:
    """A stage of the frame as a case."""
    return Case(f"stage: {name}", (1000, 10_000), set_up, run, is_sound, bound_us=bound_us)


@dataclass
class Limbs:
    """Limbs with targets in reach."""

    arguments: tuple[np.ndarray, ...]
    end: np.ndarray
    status: np.ndarray


def set_up_limbs(size: int, rng: np.random.Generator) -> Limbs:
    """Legs of 0.43 and 0.41 m with random targets."""
    _jit.set_thread_count(1)
    root = rng.normal(size=(size, 3))
    middle, end = root + (0, -0.43, 0), root + (0, -0.83, 0.05)
    way = rng.normal(size=(size, 3))
    way *= rng.uniform(0.1, 0.8, (size, 1)) / np.linalg.norm(way, axis=1, keepdims=True)
    out = np.zeros((size, 3)), np.zeros((size, 3)), np.zeros(size, np.int64)
    return Limbs((root, middle, end, root + way, rng.normal(size=(size, 3)), *out), out[1], out[2])


def bend(limbs: Limbs) -> None:
    """Solve all limbs."""
    root, middle, end, target, pole, out_middle, out_end, out_status = limbs.arguments
    crowd_two_bone_ik(root, middle, end, target, pole, out_middle, out_end, out_status)


def is_met(limbs: Limbs) -> str | None:
    """All targets are met."""
    error = np.abs(limbs.end - limbs.arguments[3]).max()
    return None if error < 1e-9 and (limbs.status == REACHED).all() else f"off by {error:.2g} m"


CASES = [
    case("navigate", navigate),
    case("steer", steer),
    case("locomote", locomote),
    case("animate", animate),
    case("push apart", project),
    case("lock feet", lock_feet),
    Case("limb: two-bone inverse kinematics", (10_000,), set_up_limbs, bend, is_met),
]
