"""Where a foot goes: planted it stays, lifted it finds back to its animation, dragged off it is let go."""

import math
from typing import Any, NamedTuple

import numpy as np

from crowd_kernels._jit import inlined_kernel, kernel
from crowd_kernels.gait import HEEL, SWING
from crowd_kernels.locomotion import ease, wrapped_angle
from crowd_kernels.quaternion import Quaternion, from_yaw, rotate
from crowd_kernels.vector import Vector, add, subtract

TWO = np.float64(2.0)


class LockLimits(NamedTuple):
    """When feet are let go, and how fast they find back."""

    release_distance: float
    """Offset of a planted foot from its animation at which it is let go, m at leg scale 1."""
    release_yaw: float
    """Turn of a planted foot against its animation at which it starts to pivot, rad."""
    stretch: float
    """Largest share of the leg's length that is used."""
    swing_rate: float
    """Rate at which the offset fades while the foot swings, 1/s."""
    ground_rate: float
    """Rate at which the height of a planted foot is corrected, 1/s."""
    pelvis_speed: float
    """Speed up to which the pelvis follows at once what a leg needs, m/s at leg scale 1."""
    pelvis_rate: float
    """Rate at which it follows what goes beyond, and settles when another leg decides, 1/s."""


@kernel
def heading_of(q: Quaternion) -> float:
    """Find the heading of a rotated z axis on the ground, rad."""
    return math.atan2(TWO * (q[1] * q[3] + q[0] * q[2]), 1.0 - TWO * (q[1] * q[1] + q[2] * q[2]))


@inlined_kernel
def plan_foot(
    character: int,
    leg: int,
    wanted: int,
    heel: Vector,
    ball: Vector,
    tip: Vector,
    foot: Quaternion,
    yaw_world: float,
    leg_scale: float,
    limits: LockLimits,
    dt: float,
    contact: Any,
    is_released: Any,
    anchor: Any,
    anchor_yaw: Any,
    offset: Any,
    offset_rate: Any,
    yaw_offset: Any,
    yaw_offset_rate: Any,
) -> None:
    """Decide where one foot goes: `offset` and `yaw_offset` of its animation, in place.

    Parameters
    ----------
    character, leg : int
        Row, and 0 right or 1 left.
    wanted : int
        Contact that the gait wants: 0 swing, 1 heel, 2 ball.
    heel, ball, tip : tuple of float
        Points of the sole in the animation, world, m.
    foot : tuple of float
        Rotation of the foot in the animation, root frame.
    yaw_world : float
        Heading of the character, rad.
    leg_scale : float
        Scale of the character's legs.
    limits : LockLimits
    dt : float
        s.
    contact : (N, 2) uint8
        In and out: contact in force.
    is_released : (N, 2) bool
        In and out: let go early; the foot is free until the gait lifts it.
    anchor : (N, 2, 2) float64
        In and out: x, z of the planted point, m.
    anchor_yaw : (N, 2) float64
        In and out: heading of the planted foot, rad.
    offset, offset_rate : (N, 2, 3) float64
        In and out: correction of the foot's place, world, m and m/s.
    yaw_offset, yaw_offset_rate : (N, 2) float64
        In and out: correction of its heading, rad and rad/s.
    """
    if wanted == SWING:
        is_released[character, leg] = False
    elif is_released[character, leg]:
        wanted = SWING
    point = heel if wanted == HEEL else ball
    before = (offset[character, leg, 0], offset[character, leg, 1], offset[character, leg, 2])
    yaw_before = yaw_offset[character, leg]
    if wanted != SWING:
        heading = heading_of(foot) + yaw_world
        if contact[character, leg] == SWING:
            anchor_yaw[character, leg] = heading + yaw_before
        if wanted != contact[character, leg]:
            # The heel lies behind the ball along the foot, which the yaw correction turns about the anchor.
            turn = from_yaw(yaw_before)
            old = heel if contact[character, leg] == HEEL else ball
            arm = rotate(turn, subtract(point, old))
            base = add(old, before) if contact[character, leg] != SWING else add(point, before)
            if contact[character, leg] != SWING:
                base = add(base, arm)
            anchor[character, leg, 0] = base[0]
            anchor[character, leg, 1] = base[2]
        x = anchor[character, leg, 0] - point[0]
        z = anchor[character, leg, 1] - point[2]
        yaw = wrapped_angle(anchor_yaw[character, leg] - heading)
        if abs(yaw) > limits.release_yaw:
            yaw = limits.release_yaw if yaw > 0.0 else -limits.release_yaw
            anchor_yaw[character, leg] = heading + yaw
        release = limits.release_distance * leg_scale
        if x * x + z * z > release * release:
            is_released[character, leg] = True
            wanted = SWING
        else:
            y, y_rate = ease(before[1], offset_rate[character, leg, 1], -point[1], limits.ground_rate, dt)
            offset[character, leg, 0] = x
            offset[character, leg, 1] = y
            offset[character, leg, 2] = z
            offset_rate[character, leg, 0] = (x - before[0]) / dt
            offset_rate[character, leg, 1] = y_rate
            offset_rate[character, leg, 2] = (z - before[2]) / dt
            yaw_offset[character, leg] = yaw
            yaw_offset_rate[character, leg] = (yaw - yaw_before) / dt
    if wanted == SWING:
        for axis in range(3):
            value, rate = ease(before[axis], offset_rate[character, leg, axis], 0.0, limits.swing_rate, dt)
            offset[character, leg, axis] = value
            offset_rate[character, leg, axis] = rate
        value, rate = ease(yaw_before, yaw_offset_rate[character, leg], 0.0, limits.swing_rate, dt)
        yaw_offset[character, leg] = value
        yaw_offset_rate[character, leg] = rate
    lowest = min(min(heel[1], ball[1]), tip[1]) if wanted != HEEL else min(heel[1], ball[1])
    if lowest + offset[character, leg, 1] < 0.0:
        offset[character, leg, 1] = -lowest
        offset_rate[character, leg, 1] = max(offset_rate[character, leg, 1], 0.0)
    contact[character, leg] = wanted
