"""Foot locking: planted feet stay where they are while the body above moves, and are let go softly."""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from crowd_kernels._jit import inlined_kernel, kernel, parallel_kernel, prange
from crowd_kernels.gait import HEEL, SWING
from crowd_kernels.limb_ik import bend_rotations, turned
from crowd_kernels.locomotion import ease, wrapped_angle
from crowd_kernels.pose import joint_rotation, set_joint_rotation
from crowd_kernels.quaternion import Quaternion, conjugate, from_yaw, multiply, normalized, rotate
from crowd_kernels.vector import Vector, add, norm, subtract

CHUNKS = 32
TWO = np.float64(2.0)
UNKNOWN, NEITHER, FIRST_LEG = 0, 1, 2
"""What decides how far the pelvis is lowered: not known yet, no leg, or from here on one of the legs."""
TINY = 1e-12
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
    sole: npt.NDArray[np.float64]
    """(2, 3, 3) Heel, ball and tip on the sole: heel and ball in the foot's frame, tip in the toe's, m."""
    leg_segment: int
    """Column that stretches the pelvis position."""
    foot_segment: int
    """Column that stretches the sole."""


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


@inlined_kernel
def scaled_offset(legs: LegArrays, leg: int, part: int, scale: Any) -> Vector:
    """Find the rest offset of a leg joint in a character's own proportions."""
    s = float(scale[legs.segment[leg, part]])
    return legs.offset[leg, part, 0] * s, legs.offset[leg, part, 1] * s, legs.offset[leg, part, 2] * s


@inlined_kernel
def sole_point(legs: LegArrays, leg: int, point: int, scale: Any) -> Vector:
    """Find a point of the sole in a character's own proportions: 0 heel, 1 ball, 2 tip."""
    s = float(scale[legs.foot_segment])
    return legs.sole[leg, point, 0] * s, legs.sole[leg, point, 1] * s, legs.sole[leg, point, 2] * s


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
    heading: float,
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
    heading : float
        Heading of the foot in the animation, world, rad.
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


@inlined_kernel
def needed_drop(hip: Vector, target: Vector, length: float, stretch: float) -> float:
    """Find how far the hip must come down for a foot: softly more as the leg comes near its largest stretch.

    The nearer a leg is to straight, the faster its knee turns with the way to the foot: at a bare limit a
    knee that straightens would stop dead.

    Parameters
    ----------
    hip, target : tuple of float
        Hip in the animation and place of the ankle, in one frame, m.
    length : float
        Of the straight leg, m.
    stretch : float
        Largest share of it that is used.

    Returns
    -------
    float
        m, not negative.
    """
    away = (target[0] - hip[0]) ** 2 + (target[2] - hip[2]) ** 2
    height = hip[1] - target[1]
    least = max(1.0 - stretch, TINY)
    # What lacks from straight: all of it where the leg is bent, `least` where it would have to be straight.
    slack = max(1.0 - math.sqrt(away + height * height) / length, 0.0)
    used = (1.0 - slack - least * math.exp(-slack / least)) * length
    return max(height - math.sqrt(max(used * used - away, 0.0)), 0.0)


@inlined_kernel
def followed_rate(need: float, before: float, fastest: float, dt: float) -> float:
    """Find how fast the pelvis follows a leg's need at once, m/s."""
    return min(max((need - before) / dt, -fastest), fastest)


@inlined_kernel
def lower_pelvis(
    character: int,
    right: float,
    left: float,
    leg_scale: float,
    limits: LockLimits,
    dt: float,
    contact: Any,
    leg_need: Any,
    deciding: Any,
    drop_gap: Any,
    drop: Any,
) -> None:
    """Lower the pelvis as far as the planted leg needs that needs most, in place.

    While one leg decides, the pelvis follows its need at once, so that the leg never comes to its limit with
    speed. Where another one takes over, needs and rates differ: the difference becomes a gap that is eased
    away, as is what feet need that are dragged off faster than people sink.

    Parameters
    ----------
    character : int
    right, left : float
        What each leg needs, planted or not, m.
    leg_scale : float
        Scale of the character's legs.
    limits : LockLimits
    dt : float
        s.
    contact : (N, 2) uint8
        Contact in force.
    leg_need : (N, 2) float64
        In and out: what the legs needed in the last step, m.
    deciding : (N,) uint8
        In and out: `UNKNOWN`, `NEITHER` or `FIRST_LEG` and on.
    drop_gap : (N, 2) float64
        In and out: how far the pelvis is lower than the deciding leg needs, m, and its rate, m/s.
    drop : (N,) float64
        Written: how far the pelvis is lowered, m.

    Notes
    -----
    **Source:** Bollo, "Inertialization: high-performance animation transitions in Gears of War", 2018.
    **Differs from the source:** the gap fades as a critically damped spring instead of a polynomial.
    """
    fastest = limits.pelvis_speed * leg_scale
    now, need, rate = NEITHER, 0.0, 0.0
    if contact[character, 0] != SWING and right > need:
        now, need = FIRST_LEG, right
    if contact[character, 1] != SWING and left > need:
        now, need = FIRST_LEG + 1, left
    before = deciding[character]
    gap, gap_rate = drop_gap[character, 0], drop_gap[character, 1]
    if before != UNKNOWN:
        right_rate = followed_rate(right, leg_need[character, 0], fastest, dt)
        left_rate = followed_rate(left, leg_need[character, 1], fastest, dt)
        if before >= FIRST_LEG:
            gap += leg_need[character, before - FIRST_LEG]
            gap_rate += right_rate if before == FIRST_LEG else left_rate
        if now >= FIRST_LEG:
            rate = right_rate if now == FIRST_LEG else left_rate
        gap, gap_rate = ease(gap - (need - rate * dt), gap_rate - rate, 0.0, limits.pelvis_rate, dt)
    lowered = min(max(need + gap, 0.0), LOWEST * leg_scale)
    if lowered != need + gap:
        gap, gap_rate = lowered - need, 0.0
    leg_need[character, 0], leg_need[character, 1] = right, left
    deciding[character] = now
    drop_gap[character, 0], drop_gap[character, 1] = gap, gap_rate
    drop[character] = lowered


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
    """Plan and solve both legs of one character; arguments as in `lock_feet_crowd`."""
    row = pose_rotation[character]
    scale = segment_scale[character]
    leg_scale = float(scale[legs.leg_segment])
    pelvis = (
        float(pose_pelvis[character, 0]) * leg_scale,
        float(pose_pelvis[character, 1]) * leg_scale,
        float(pose_pelvis[character, 2]) * leg_scale,
    )
    pelvis_rotation = joint_rotation(row, 0)
    facing = from_yaw(yaw[character])
    unfacing = conjugate(facing)
    place = (position_world[character, 0], 0.0, position_world[character, 2])
    needs = (0.0, 0.0)
    # The two feet are planned first, because both decide how far the pelvis must come down.
    for leg in range(2):
        thigh = normalized(multiply(pelvis_rotation, joint_rotation(row, legs.joint[leg, 0])))
        shank = normalized(multiply(thigh, joint_rotation(row, legs.joint[leg, 1])))
        foot = normalized(multiply(shank, joint_rotation(row, legs.joint[leg, 2])))
        toe = normalized(multiply(foot, joint_rotation(row, legs.joint[leg, 3])))
        hip = add(pelvis, rotate(pelvis_rotation, scaled_offset(legs, leg, 0, scale)))
        upper = scaled_offset(legs, leg, 1, scale)
        lower = scaled_offset(legs, leg, 2, scale)
        ankle = add(add(hip, rotate(thigh, upper)), rotate(shank, lower))
        heel = add(ankle, rotate(foot, sole_point(legs, leg, 0, scale)))
        ball = add(ankle, rotate(foot, sole_point(legs, leg, 1, scale)))
        toe_joint = add(ankle, rotate(foot, scaled_offset(legs, leg, 3, scale)))
        tip = add(toe_joint, rotate(toe, sole_point(legs, leg, 2, scale)))
        heading = heading_of(foot) + yaw[character]
        plan_foot(
            character,
            leg,
            contact_wanted[character, leg],
            add(place, rotate(facing, heel)),
            add(place, rotate(facing, ball)),
            add(place, rotate(facing, tip)),
            heading,
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
        # The foot turns about its planted point.
        pivot = heel if contact[character, leg] == HEEL else ball
        turn = from_yaw(yaw_offset[character, leg])
        moved = (offset[character, leg, 0], offset[character, leg, 1], offset[character, leg, 2])
        target = add(add(pivot, rotate(unfacing, moved)), rotate(turn, subtract(ankle, pivot)))
        out_foot_point_world[character, leg, 0, 0] = target[0]
        out_foot_point_world[character, leg, 0, 1] = target[1]
        out_foot_point_world[character, leg, 0, 2] = target[2]
        length = norm(upper) + norm(lower)
        need = min(needed_drop(hip, target, length, limits.stretch), LOWEST * leg_scale)
        needs = (need, needs[1]) if leg == 0 else (needs[0], need)
    lower_pelvis(
        character,
        needs[0],
        needs[1],
        leg_scale,
        limits,
        dt,
        contact,
        leg_need,
        deciding,
        drop_gap,
        drop,
    )
    pelvis = (pelvis[0], pelvis[1] - drop[character], pelvis[2])
    pose_pelvis[character, 1] = pelvis[1] / leg_scale
    for leg in range(2):
        thigh = normalized(multiply(pelvis_rotation, joint_rotation(row, legs.joint[leg, 0])))
        shank = normalized(multiply(thigh, joint_rotation(row, legs.joint[leg, 1])))
        foot = normalized(multiply(shank, joint_rotation(row, legs.joint[leg, 2])))
        hip = add(pelvis, rotate(pelvis_rotation, scaled_offset(legs, leg, 0, scale)))
        knee = add(hip, rotate(thigh, scaled_offset(legs, leg, 1, scale)))
        ankle = add(knee, rotate(shank, scaled_offset(legs, leg, 2, scale)))
        target = (
            out_foot_point_world[character, leg, 0, 0],
            out_foot_point_world[character, leg, 0, 1],
            out_foot_point_world[character, leg, 0, 2],
        )
        hinge = rotate(thigh, (1.0, 0.0, 0.0))
        first, second, _ = bend_rotations(hip, knee, ankle, target, hinge, limits.stretch)
        new_thigh = normalized(multiply(first, thigh))
        new_shank = turned(first, second, shank)
        new_foot = normalized(multiply(from_yaw(yaw_offset[character, leg]), foot))
        set_joint_rotation(row, legs.joint[leg, 0], multiply(conjugate(pelvis_rotation), new_thigh))
        set_joint_rotation(row, legs.joint[leg, 1], multiply(conjugate(new_thigh), new_shank))
        set_joint_rotation(row, legs.joint[leg, 2], multiply(conjugate(new_shank), new_foot))
        ankle = add(
            add(hip, rotate(new_thigh, scaled_offset(legs, leg, 1, scale))),
            rotate(new_shank, scaled_offset(legs, leg, 2, scale)),
        )
        for point in range(2):
            final = add(ankle, rotate(new_foot, sole_point(legs, leg, point, scale)))
            final = add(place, rotate(facing, final))
            out_foot_point_world[character, leg, point, 0] = final[0]
            out_foot_point_world[character, leg, point, 1] = final[1]
            out_foot_point_world[character, leg, point, 2] = final[2]
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
