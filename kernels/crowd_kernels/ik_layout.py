"""Rows of numbers that inverse kinematics works on: a joint, an effector, sixteen characters as lanes.

A joint is one flat row of `JOINT_ROW` numbers, an effector one of `EFFECTOR_ROW`; the constants below name
where each of their parts begins. All vectors and world rotations are in the root frame.
"""

from typing import Any

import numpy as np

from crowd_kernels._jit import inlined_kernel
from crowd_kernels.lanes import LANES
from crowd_kernels.quaternion import Quaternion
from crowd_kernels.vector import Vector

# A joint.
ROTATION = 0
"""Local rotation, 4."""
REFERENCE = 4 * LANES
"""Local rotation of the reference pose, 4."""
PLACE = 8 * LANES
"""Position, m, 3."""
FRAME = 11 * LANES
"""World rotation, 4."""
MOBILITY = 15 * LANES
"""Symmetric matrix that turns a torque into a rotation: xx, xy, xz, yy, yz, zz. Only where `IS_FIXED`; joints
that turn freely have their weight in its place."""
DRIFT = 21 * LANES
"""Rotation vector that the joint turns by without any torque, rad, 3."""
STEP = 24 * LANES
"""Rotation vector of this iteration, rad, 3."""
NEXT = 27 * LANES
"""Local rotation after this iteration, 4."""
SWING_BOUND = 31 * LANES
"""Largest value of the swing ellipse, 1 and more."""
TWIST_BOUND = 32 * LANES
"""Least and largest twist, 2."""
HELD = 34 * LANES
"""Swing x and y and twist of the reference pose, 3."""
NEXT_SWING = 37 * LANES
"""Swing x and y and twist of the next rotation, 3."""
ROOM = 40 * LANES
"""Bounds of this iteration: largest value of the swing ellipse, least and largest twist, 3."""
LAST = 43 * LANES
"""Swing x and y and twist of the last pose, 3."""
WAY_SHARE = 46 * LANES
"""How much of the way from the last swing to the next one the joint goes in this iteration, 0 to 1."""
EXCESS = 47 * LANES
"""How far swing and twist of the next rotation are beyond the room, rad, 2."""
IS_FIXED = 49 * LANES
"""Not 0 in the first lane where some direction does not turn freely in some lane."""
IS_OUTSIDE = IS_FIXED + 1
"""Not 0 where the next rotation leaves its room in some lane, or some axis never turns."""
JOINT_ROW = 50 * LANES
# An effector.
POINT = 0
"""The point of the joint that has a target, in the joint's frame, m, 3."""
TARGET = 3 * LANES
"""Where the point should be, m, 3."""
TARGET_FRAME = 6 * LANES
"""World rotation that its joint should have, 4."""
WANTS_PLACE = 10 * LANES
"""1 where the position is asked for, else 0."""
WANTS_FRAME = 11 * LANES
"""1 where the rotation is asked for, else 0."""
TIP = 12 * LANES
"""Where the point is, m, 3."""
MISS = 15 * LANES
"""Step wanted now: position, m, and rotation vector, rad, 6."""
DISTANCE = 21 * LANES
"""Distance to the target, m."""
ANGLE = 22 * LANES
"""Angle to the target's rotation, rad."""
LENGTH = 23 * LANES
"""Length of the chain that can bring the point to the target, m."""
IS_FAR = 24 * LANES
"""1 where the target lies beyond that length."""
TURNS = 25 * LANES
"""1 where the rotation is sought in this iteration, else 0."""
EFFECTOR_ROW = 26 * LANES
PUSH = 6 * LANES
"""Right side of the system at an effector, and then its solution: 3 for the position, 3 for the rotation."""
BLOCK = 9 * LANES
"""A block of the system, 3 rows and 3 columns."""
ZERO: Any = np.float32(0.0)
ONE: Any = np.float32(1.0)
HALF: Any = np.float32(0.5)
TWO: Any = np.float32(2.0)
TINY: Any = np.float32(1e-12)


@inlined_kernel
def vector_at(row: Any, begin: int, lane: int) -> Vector:
    """Read a vector of one lane."""
    first = begin + lane
    return row[first], row[first + LANES], row[first + 2 * LANES]


@inlined_kernel
def quaternion_at(row: Any, begin: int, lane: int) -> Quaternion:
    """Read a quaternion of one lane."""
    first = begin + lane
    return row[first], row[first + LANES], row[first + 2 * LANES], row[first + 3 * LANES]


@inlined_kernel
def put_vector(row: Any, begin: int, lane: int, value: Vector) -> None:
    """Write a vector of one lane."""
    first = begin + lane
    row[first] = value[0]
    row[first + LANES] = value[1]
    row[first + 2 * LANES] = value[2]


@inlined_kernel
def put_quaternion(row: Any, begin: int, lane: int, value: Quaternion) -> None:
    """Write a quaternion of one lane."""
    first = begin + lane
    row[first] = value[0]
    row[first + LANES] = value[1]
    row[first + 2 * LANES] = value[2]
    row[first + 3 * LANES] = value[3]


@inlined_kernel
def unit_quaternion(q: Quaternion) -> Quaternion:
    """Scale a quaternion that is not zero to unit length."""
    scale = ONE / np.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return q[0] * scale, q[1] * scale, q[2] * scale, q[3] * scale
