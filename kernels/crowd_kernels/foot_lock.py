"""Foot locking: planted feet stay where they are while the body above moves, and are let go softly."""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from crowd_kernels._jit import inlined_kernel, parallel_kernel, prange
from crowd_kernels.foot_plan import LockLimits, plan_foot
from crowd_kernels.gait import HEEL
from crowd_kernels.limb_ik import bend_rotations
from crowd_kernels.pelvis_drop import lower_pelvis, needed_drop
from crowd_kernels.pose import joint_rotation, set_joint_rotation
from crowd_kernels.quaternion import Quaternion, conjugate, from_yaw, multiply, rotate
from crowd_kernels.vector import Vector, add, subtract

CHUNKS = 32
LOWEST = 0.12
"""How far the pelvis is lowered at most, m at leg scale 1."""


class LegArrays(NamedTuple):
    """Both legs of a skeleton, right before left, as the kernel reads them."""

    joint: npt.NDArray[np.int32]
    """(2, 4) Joints of thigh, shank, foot, toe."""
    offset: npt.NDArray[np.float64]
    """(2, 4, 3) Their rest offsets, m."""
    segment: npt.NDArray[np.int32]
    """(2, 4) Columns of the proportions that stretch the offsets."""
    length: npt.NDArray[np.float64]
    """(2, 4) Lengths of the offsets, m."""
    sole: npt.NDArray[np.float64]
    """(2, 3, 3) Heel, ball and tip on the sole: heel and ball in the foot's frame, tip in the toe's, m."""
    leg_segment: int
    """Column that stretches the pelvis position."""
    foot_segment: int
    """Column that stretches the sole."""


class PlannedLeg(NamedTuple):
    """A leg in the animation, and where its foot is to go; root frame, vectors in m."""

    hip: Vector
    to_knee: Vector
    """From hip to knee."""
    knee_to_ankle: Vector
    """From knee to ankle."""
    heel: Vector
    """From the ankle."""
    ball: Vector
    """From the ankle."""
    thigh: Quaternion
    shank: Quaternion
    foot: Quaternion
    """As it is to be turned, like heel and ball."""
    ankle: Vector
    """Where it is to go."""
    drop: float
    """How far the pelvis must come down for that, m."""


@inlined_kernel
def unit_rotation(pose_row: Any, joint: int) -> Quaternion:
    """Read the rotation of a joint, and bring it from float32 to unit length in float64.

    Its length is 1 up to float32's rounding, so that one of Newton's steps makes it exact, and products of
    such rotations stay of unit length.
    """
    w, x, y, z = joint_rotation(pose_row, joint)
    w, x, y, z = np.float64(w), np.float64(x), np.float64(y), np.float64(z)
    scale = 1.5 - 0.5 * (w * w + x * x + y * y + z * z)
    return w * scale, x * scale, y * scale, z * scale


@inlined_kernel
def turned_about_y(cosine: float, sine: float, v: Vector) -> Vector:
    """Turn a vector about +y, by an angle of which cosine and sine are known."""
    return cosine * v[0] + sine * v[2], v[1], cosine * v[2] - sine * v[0]


@inlined_kernel
def scaled_offset(legs: LegArrays, leg: int, part: int, scale: Any) -> Vector:
    """Find the rest offset of a leg joint in a character's own proportions."""
    s = float(scale[legs.segment[leg, part]])
    return legs.offset[leg, part, 0] * s, legs.offset[leg, part, 1] * s, legs.offset[leg, part, 2] * s


@inlined_kernel
def limb_length(legs: LegArrays, leg: int, part: int, scale: Any) -> float:
    """Find the length of a thigh or shank in a character's own proportions, m."""
    return float(legs.length[leg, part]) * float(scale[legs.segment[leg, part]])


@inlined_kernel
def sole_point(legs: LegArrays, leg: int, point: int, scale: Any) -> Vector:
    """Find a point of the sole in a character's own proportions: 0 heel, 1 ball, 2 tip."""
    s = float(scale[legs.foot_segment])
    return legs.sole[leg, point, 0] * s, legs.sole[leg, point, 1] * s, legs.sole[leg, point, 2] * s


@inlined_kernel
def plan_leg(
    character: int,
    leg: int,
    legs: LegArrays,
    limits: LockLimits,
    scale: Any,
    place: Vector,
    yaw: float,
    cosine: float,
    sine: float,
    pelvis: Vector,
    pelvis_rotation: Quaternion,
    wanted: int,
    dt: float,
    row: Any,
    contact: Any,
    is_released: Any,
    anchor: Any,
    anchor_yaw: Any,
    offset: Any,
    offset_rate: Any,
    yaw_offset: Any,
    yaw_offset_rate: Any,
) -> PlannedLeg:
    """Find a leg in the animation, and decide where its foot goes.

    Parameters
    ----------
    scale : (G,) float32
        Proportions.
    place : tuple of float
        Root on the ground, world, m.
    yaw, cosine, sine : float
        Heading of the character, rad, and its cosine and sine.
    pelvis : tuple of float
        Root frame, m.
    pelvis_rotation : tuple of float
    row : (256,) float32
        Pose row.

    Returns
    -------
    PlannedLeg

    Notes
    -----
    All other arguments are those of `plan_foot` and `lock_feet_crowd`.
    """
    leg_scale = np.float64(scale[legs.leg_segment])
    thigh = multiply(pelvis_rotation, unit_rotation(row, legs.joint[leg, 0]))
    shank = multiply(thigh, unit_rotation(row, legs.joint[leg, 1]))
    foot = multiply(shank, unit_rotation(row, legs.joint[leg, 2]))
    toe = multiply(foot, unit_rotation(row, legs.joint[leg, 3]))
    hip = add(pelvis, rotate(pelvis_rotation, scaled_offset(legs, leg, 0, scale)))
    to_knee = rotate(thigh, scaled_offset(legs, leg, 1, scale))
    knee_to_ankle = rotate(shank, scaled_offset(legs, leg, 2, scale))
    ankle = add(hip, add(to_knee, knee_to_ankle))
    heel = rotate(foot, sole_point(legs, leg, 0, scale))
    ball = rotate(foot, sole_point(legs, leg, 1, scale))
    tip = add(rotate(foot, scaled_offset(legs, leg, 3, scale)), rotate(toe, sole_point(legs, leg, 2, scale)))
    ankle_world = add(place, turned_about_y(cosine, sine, ankle))
    plan_foot(
        character,
        leg,
        wanted,
        add(ankle_world, turned_about_y(cosine, sine, heel)),
        add(ankle_world, turned_about_y(cosine, sine, ball)),
        add(ankle_world, turned_about_y(cosine, sine, tip)),
        foot,
        yaw,
        leg_scale,
        limits,
        dt,
        contact,
        is_released,
        anchor,
        anchor_yaw,
        offset,
        offset_rate,
        yaw_offset,
        yaw_offset_rate,
    )
    moved = turned_about_y(
        cosine, -sine, (offset[character, leg, 0], offset[character, leg, 1], offset[character, leg, 2])
    )
    # The foot turns about its planted point.
    turn = from_yaw(yaw_offset[character, leg])
    turned_heel, turned_ball = rotate(turn, heel), rotate(turn, ball)
    pivot = heel if contact[character, leg] == HEEL else ball
    turned_pivot = turned_heel if contact[character, leg] == HEEL else turned_ball
    target = add(add(ankle, moved), subtract(pivot, turned_pivot))
    length = limb_length(legs, leg, 1, scale) + limb_length(legs, leg, 2, scale)
    drop = min(needed_drop(hip, target, length, limits.stretch), LOWEST * leg_scale)
    return PlannedLeg(
        hip,
        to_knee,
        knee_to_ankle,
        turned_heel,
        turned_ball,
        thigh,
        shank,
        multiply(turn, foot),
        target,
        drop,
    )


@inlined_kernel
def bend_leg(
    character: int,
    leg: int,
    plan: PlannedLeg,
    legs: LegArrays,
    stretch: float,
    place: Vector,
    cosine: float,
    sine: float,
    drop: float,
    pelvis_rotation: Quaternion,
    row: Any,
    out_foot_point_world: Any,
) -> None:
    """Bend a leg until its foot is where it is planned, from a hip that has come down.

    Parameters
    ----------
    plan : PlannedLeg
    stretch : float
        See `LockLimits`.
    drop : float
        How far the pelvis has come down, m.
    row : (256,) float32
        In and out: pose row.

    Notes
    -----
    All other arguments are those of `plan_leg` and `lock_feet_crowd`.
    """
    hip = (plan.hip[0], plan.hip[1] - drop, plan.hip[2])
    knee = add(hip, plan.to_knee)
    hinge = rotate(plan.thigh, (1.0, 0.0, 0.0))
    first, second, _ = bend_rotations(hip, knee, add(knee, plan.knee_to_ankle), plan.ankle, hinge, stretch)
    thigh = multiply(first, plan.thigh)
    shank = multiply(first, multiply(second, plan.shank))
    set_joint_rotation(row, legs.joint[leg, 0], multiply(conjugate(pelvis_rotation), thigh))
    set_joint_rotation(row, legs.joint[leg, 1], multiply(conjugate(thigh), shank))
    set_joint_rotation(row, legs.joint[leg, 2], multiply(conjugate(shank), plan.foot))
    to_ankle = rotate(first, add(plan.to_knee, rotate(second, plan.knee_to_ankle)))
    ankle = add(place, turned_about_y(cosine, sine, add(hip, to_ankle)))
    heel = add(ankle, turned_about_y(cosine, sine, plan.heel))
    ball = add(ankle, turned_about_y(cosine, sine, plan.ball))
    for axis in range(3):
        out_foot_point_world[character, leg, 0, axis] = heel[axis]
        out_foot_point_world[character, leg, 1, axis] = ball[axis]


@inlined_kernel
def lock_character(
    character: int,
    legs: LegArrays,
    limits: LockLimits,
    segment_scale: Any,
    position_world: Any,
    yaw: Any,
    contact_wanted: Any,
    dt: float,
    pose_rotation: Any,
    pose_pelvis: Any,
    contact: Any,
    is_released: Any,
    anchor: Any,
    anchor_yaw: Any,
    offset: Any,
    offset_rate: Any,
    yaw_offset: Any,
    yaw_offset_rate: Any,
    leg_need: Any,
    deciding: Any,
    drop_gap: Any,
    drop: Any,
    out_foot_point_world: Any,
    out_foot_contact: Any,
) -> None:
    """Plan and bend both legs of one character; arguments as in `lock_feet_crowd`."""
    row = pose_rotation[character]
    scale = segment_scale[character]
    leg_scale = np.float64(scale[legs.leg_segment])
    pelvis = (
        np.float64(pose_pelvis[character, 0]) * leg_scale,
        np.float64(pose_pelvis[character, 1]) * leg_scale,
        np.float64(pose_pelvis[character, 2]) * leg_scale,
    )
    pelvis_rotation = unit_rotation(row, 0)
    cosine, sine = math.cos(yaw[character]), math.sin(yaw[character])
    place = (position_world[character, 0], 0.0, position_world[character, 2])
    # Both feet are planned first, because both decide how far the pelvis must come down.
    right = plan_leg(
        character,
        0,
        legs,
        limits,
        scale,
        place,
        yaw[character],
        cosine,
        sine,
        pelvis,
        pelvis_rotation,
        contact_wanted[character, 0],
        dt,
        row,
        contact,
        is_released,
        anchor,
        anchor_yaw,
        offset,
        offset_rate,
        yaw_offset,
        yaw_offset_rate,
    )
    left = plan_leg(
        character,
        1,
        legs,
        limits,
        scale,
        place,
        yaw[character],
        cosine,
        sine,
        pelvis,
        pelvis_rotation,
        contact_wanted[character, 1],
        dt,
        row,
        contact,
        is_released,
        anchor,
        anchor_yaw,
        offset,
        offset_rate,
        yaw_offset,
        yaw_offset_rate,
    )
    lower_pelvis(
        character,
        right.drop,
        left.drop,
        limits.pelvis_speed * leg_scale,
        limits.pelvis_rate,
        LOWEST * leg_scale,
        dt,
        contact,
        leg_need,
        deciding,
        drop_gap,
        drop,
    )
    pose_pelvis[character, 1] = (pelvis[1] - drop[character]) / leg_scale
    for leg in range(2):
        bend_leg(
            character,
            leg,
            right if leg == 0 else left,
            legs,
            limits.stretch,
            place,
            cosine,
            sine,
            drop[character],
            pelvis_rotation,
            row,
            out_foot_point_world,
        )
        out_foot_contact[character, leg] = contact[character, leg]


@parallel_kernel
def lock_feet_crowd(
    legs: LegArrays,
    limits: LockLimits,
    segment_scale: Any,
    position_world: Any,
    yaw: Any,
    contact_wanted: Any,
    active: Any,
    dt: float,
    pose_rotation: Any,
    pose_pelvis: Any,
    contact: Any,
    is_released: Any,
    anchor: Any,
    anchor_yaw: Any,
    offset: Any,
    offset_rate: Any,
    yaw_offset: Any,
    yaw_offset_rate: Any,
    leg_need: Any,
    deciding: Any,
    drop_gap: Any,
    drop: Any,
    out_foot_point_world: Any,
    out_foot_contact: Any,
) -> None:
    """Keep planted feet in place by bending the legs, in place.

    Parameters
    ----------
    legs : LegArrays
    limits : LockLimits
    segment_scale : (N, G) float32
        Proportions.
    position_world : (N, 3) float64
        Root, m.
    yaw : (N,) float64
        Heading, rad.
    contact_wanted : (N, 2) uint8
        Contact of right and left foot that the gait wants: 0 swing, 1 heel, 2 ball.
    active : (A,) int32
        Characters to process.
    dt : float
        s.
    pose_rotation : (N, 256) float32
        In and out: thighs, shanks and feet are rewritten.
    pose_pelvis : (N, 3) float32
        In and out: lowered when planted feet are out of reach.
    contact : (N, 2) uint8
        In and out: contact in force.
    is_released : (N, 2) bool
        In and out: planted foot that was let go.
    anchor : (N, 2, 2) float64
        In and out: x, z of planted points, m.
    anchor_yaw : (N, 2) float64
        In and out: headings of planted feet, rad.
    offset, offset_rate : (N, 2, 3) float64
        In and out: correction of each foot's place and its rate, m, m/s.
    yaw_offset, yaw_offset_rate : (N, 2) float64
        In and out: correction of each foot's heading and its rate, rad, rad/s.
    leg_need : (N, 2) float64
        In and out: how far each leg needs the pelvis lowered, m.
    deciding : (N,) uint8
        In and out: which leg decides how far it is lowered, see `lower_pelvis`.
    drop_gap : (N, 2) float64
        In and out: how far it is lower than that leg needs, m, and its rate, m/s.
    drop : (N,) float64
        How far the pelvis is lowered, m.
    out_foot_point_world : (N, 2, 2, 3) float64
        Heel and ball of each foot in the final pose, m.
    out_foot_contact : (N, 2) uint8
        Contact in force.

    Notes
    -----
    **Source:** Kovar, Schreiner, Gleicher, "Footskate cleanup for motion capture editing", 2002: planted
    points, lowering of the root, and blending of corrections.
    **Differs from the source:** on line, without look-ahead; the correction of a foot that is lifted fades as
    a critically damped spring, and the heel hands over to the ball at foot flat.
    """
    count = active.shape[0]
    for k in prange(CHUNKS):
        chunk = (k * 37) % CHUNKS
        for index in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            lock_character(
                active[index],
                legs,
                limits,
                segment_scale,
                position_world,
                yaw,
                contact_wanted,
                dt,
                pose_rotation,
                pose_pelvis,
                contact,
                is_released,
                anchor,
                anchor_yaw,
                offset,
                offset_rate,
                yaw_offset,
                yaw_offset_rate,
                leg_need,
                deciding,
                drop_gap,
                drop,
                out_foot_point_world,
                out_foot_contact,
            )
