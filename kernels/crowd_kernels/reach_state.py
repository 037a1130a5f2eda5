"""State of reaching hands, and the limits of their ways."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from crowd_kernels._jit import inlined_kernel
from crowd_kernels.quaternion import Quaternion
from crowd_kernels.vector import Vector

NONE, MOVE, HOLD, RETURN = 0, 1, 2, 3
"""Stages."""
MOVING, REACHED, OUT_OF_REACH, REFUSED = 1, 2, 3, 4
"""Statuses, as those of inverse kinematics."""
APEX, END = 1.0, 2.0
"""Courses at the target, and at rest again."""


class ReachLimits(NamedTuple):
    """How hands go from target to target."""

    least_time: float
    """Shortest time to another target, s."""
    time_per_metre: float
    """Further time by distance, s/m."""
    time_per_radian: float
    """Shortest time by how far a hand turns, against the examples or from one target to another, s/rad."""
    time_shared: float
    """Further time where both hands pull at the trunk, over how far inverse kinematics takes a hand, s/m."""
    acceleration: float
    """A hand that is at its target follows accelerations up to this without a glide, m/s^2."""
    target_speed: float
    """Targets that move faster than this are taken to have jumped, m/s."""
    turn_acceleration: float
    """Largest angular acceleration of joints between the blends of two targets, rad/s^2."""
    far_turn_time: float
    """Shortest time over the square of how far joints turn between two blends, s/rad^2: blends of far poses
    are fast in their middle, and come beside the limits of joints there."""
    clearance: float
    """Distance from the body's axis that ways between targets keep in their middle, m."""
    body_radius: float
    """Targets closer to the spine than this are refused, m at the library's size."""
    turn_back: float
    """Change of the course's rate when a reach turns back or slows down, over the square of that rate."""
    lead: float
    """Share of the way to the apex in which the examples take over the pose."""
    lead_acceleration: float
    """Largest angular acceleration with which joints turn to theirs from far off, rad/s^2."""
    rotation_rate: float
    """Largest rate with which a rotation that is asked for on the way comes and goes, 1/s."""
    farthest: float
    """Farthest that inverse kinematics takes a hand from where the examples bring it, m."""
    missing_rate: float
    """Rate with which what could not be had is made up for, 1/s."""
    example_time: float
    """Time in which the examples' weights follow those of a look-up, s."""
    weight_change: float
    """Change of all weights together from which on they follow more slowly, 0 to 1, > 0."""


class ReachState(NamedTuple):
    """What changes: fields of the state, (N, 2, ...) for right and left hand unless stated otherwise."""

    stage: npt.NDArray[np.uint8]
    status: npt.NDArray[np.uint8]
    refusals: npt.NDArray[np.int32]
    """(N, 2) How often targets were refused."""
    is_own: npt.NDArray[np.bool_]
    """(N, 2) Targets move with the body: no wall comes between."""
    is_blocked: npt.NDArray[np.bool_]
    """(N, 2) A wall lies between the shoulder and the target."""
    target_world: npt.NDArray[np.float64]
    target_rotation_world: npt.NDArray[np.float64]
    has_rotation: npt.NDArray[np.bool_]
    point_hand: npt.NDArray[np.float64]
    seconds: npt.NDArray[np.float64]
    hold_left: npt.NDArray[np.float64]
    course: npt.NDArray[np.float64]
    course_rate: npt.NDArray[np.float64]
    waited: npt.NDArray[np.float64]
    """(N,) For how long both hands have waited of people who stand, one of them far from its goal, s."""
    weight: npt.NDArray[np.float64]
    lead_time: npt.NDArray[np.float64]
    """(N, 2) Least time from rest to the goal, s, as found when the hand set out, and anew when it returned:
    the way back takes longer in proportion. A time that is asked for goes before it."""
    seen: npt.NDArray[np.float64]
    seen_velocity: npt.NDArray[np.float64]
    offset: npt.NDArray[np.float64]
    offset_velocity: npt.NDArray[np.float64]
    away: npt.NDArray[np.float64]
    """(N, 2, 3) How far the other hand's share of the trunk takes a hand from where its own examples have it,
    as far as that counts, m."""
    lag: npt.NDArray[np.float64]
    lag_velocity: npt.NDArray[np.float64]
    lag_acceleration: npt.NDArray[np.float64]
    time_left: npt.NDArray[np.float64]
    plan_time: npt.NDArray[np.float64]
    bulge: npt.NDArray[np.float64]
    glide_turn: npt.NDArray[np.float64]
    """(N, 2, 4) How the blend turns the hand now against where the glide ends, in the frame of the latter."""
    rotation: npt.NDArray[np.float64]
    turn_velocity: npt.NDArray[np.float64]
    turn_acceleration: npt.NDArray[np.float64]
    rotation_share: npt.NDArray[np.float64]
    rotation_rate: npt.NDArray[np.float64]
    turn: npt.NDArray[np.float64]
    """(N, 2) How far hands must turn at the apex against the examples, rad."""
    turn_before: npt.NDArray[np.float64]
    """(N, 2, 3) How hands were turned against the examples when a rotation came to be asked for, rad."""
    missing_place: npt.NDArray[np.float64]
    missing_turn: npt.NDArray[np.float64]
    example: npt.NDArray[np.int32]
    """(N, 2, 72) Examples that are blended; slots of weight 0 are free."""
    example_weight: npt.NDArray[np.float64]
    example_weight_rate: npt.NDArray[np.float64]
    example_weight_acceleration: npt.NDArray[np.float64]
    example_wanted: npt.NDArray[np.float64]
    example_count: npt.NDArray[np.int32]
    """(N, 2) Slots from here on are free."""
    looked_up: npt.NDArray[np.float64]
    """(N, 2, 3) Where the wrist was when examples were last looked up, root frame, m."""
    looked_up_pelvis: npt.NDArray[np.float64]
    looked_up_share: npt.NDArray[np.float64]


@inlined_kernel
def vector_of(array: Any, character: int, arm: int) -> Vector:
    """Read a vector of a hand."""
    return array[character, arm, 0], array[character, arm, 1], array[character, arm, 2]


@inlined_kernel
def set_vector(array: Any, character: int, arm: int, value: Vector) -> None:
    """Write a vector of a hand."""
    array[character, arm, 0] = value[0]
    array[character, arm, 1] = value[1]
    array[character, arm, 2] = value[2]


@inlined_kernel
def quaternion_of(array: Any, character: int, arm: int) -> Quaternion:
    """Read a rotation of a hand."""
    return (
        array[character, arm, 0],
        array[character, arm, 1],
        array[character, arm, 2],
        array[character, arm, 3],
    )


@inlined_kernel
def set_quaternion(array: Any, character: int, arm: int, value: Quaternion) -> None:
    """Write a rotation of a hand."""
    for component in range(4):
        array[character, arm, component] = value[component]
