"""Steps of a gaze over rows of 16 characters, as `crowd_kernels.gaze` calls them one after the other.

A block is laid out as flat rows of lanes: one row for each joint of the chain, one for each eye, and one that
is carried along the chain. Names in capitals are places in such rows. All numbers are float32, angles in rad.
"""

from typing import Any

import numpy as np

from crowd_kernels._jit import inlined_kernel
from crowd_kernels.lanes import LANES
from crowd_kernels.polynomial import HALF, ONE, PI, TWO, ZERO, acute_sine_cosine, arc_tangent, sine_cosine

ROTATION, TURN, RATE, WANTED, AHEAD, EYE = 0, 64, 112, 160, 208, 256
SHARE, SCALE, JOINT_ROW = 304, 320, 336
"""Joint: local rotation, turn and its rate, turn that is wanted, the head's forward axis and the point
between the eyes in the joint's frame, share of what is missing, proportion."""
POSITION, TARGET, WEIGHT, WEIGHT_RATE, GOAL, SIDE, TRUNK, SUM, SPEED, EXCESS, MEAN, FOLLOW, CARRY_ROW = (
    64, 112, 160, 176, 192, 208, 224, 240, 256, 272, 288, 304, 320,
)  # fmt: skip
"""Carried: rotation, position, target, weight with rate and goal, side of the present turn, share of the
trunk, sum of shares, speed, how far the target is out of the eyes' limits, mean weight of the step,
how readily joints follow."""
OFFSET, EYE_SCALE, ERROR, EYE_ROW = 96, 128, 144, 160
"""Eye: local rotation, turn (2), saccade (2), proportion, remaining error."""

TINY = np.float32(1e-12)
NEAREST_SQUARE, FARTHEST_SQUARE = np.float32(0.01), np.float32(1e12)
"""Squared distances from the eyes between which a target is accepted, m^2."""
BEHIND = np.float32(np.radians(150.0))
"""Targets farther round are looked at over the shoulder of the present turn, so that nobody wavers."""
STEEP = np.float32(2.0)
"""Targets steeper than 60 degrees turn the heading less, because straight above there is none."""


@inlined_kernel
def product(aw: Any, ax: Any, ay: Any, az: Any, bw: Any, bx: Any, by: Any, bz: Any) -> Any:
    """Compose two rotations: first b, then a."""
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


@inlined_kernel
def rotated(w: Any, x: Any, y: Any, z: Any, vx: Any, vy: Any, vz: Any) -> Any:
    """Rotate a vector by a unit quaternion."""
    tx = TWO * (y * vz - z * vy)
    ty = TWO * (z * vx - x * vz)
    tz = TWO * (x * vy - y * vx)
    return vx + w * tx + y * tz - z * ty, vy + w * ty + z * tx - x * tz, vz + w * tz + x * ty - y * tx


@inlined_kernel
def exponential(x: Any, y: Any, z: Any) -> Any:
    """Turn a rotation vector of at most half a turn into a unit quaternion."""
    angle = np.sqrt(x * x + y * y + z * z + TINY)
    sine, cosine = acute_sine_cosine(HALF * angle)
    scale = sine / angle
    return cosine, x * scale, y * scale, z * scale


@inlined_kernel
def within_ellipse(pitch: Any, heading: Any, inverse_pitch: Any, inverse_heading: Any) -> Any:
    """Find the factor that brings a turn into the ellipse of its limits, given inverse, at most 1."""
    p = pitch * inverse_pitch
    h = heading * inverse_heading
    return ONE / np.sqrt(max(p * p + h * h, ONE))


@inlined_kernel
def spring_step(value: Any, rate: Any, goal: Any, frequency: Any, decay: Any, dt: Any) -> Any:
    """Step a critically damped spring exactly over `dt`; `decay` is exp(-frequency dt)."""
    offset = value - goal
    slope = rate + frequency * offset
    return goal + (offset + slope * dt) * decay, (rate - frequency * slope * dt) * decay


@inlined_kernel
def look_back_row(
    row: Any, carry: Any, x: Any, y: Any, z: Any, share: Any, is_trunk: bool, out_above: Any
) -> None:
    """Find the share of a joint, and express head and eyes in the frame of the joint above it.

    Parameters
    ----------
    row : (JOINT_ROW,) float32
        The joint; its share is written.
    carry : (CARRY_ROW,) float32
        Sum of the shares from the eyes up to here, in and out.
    x, y, z : float32
        Rest offset, m.
    share : float32
        Relative part.
    is_trunk : bool
        The part depends on the character's posture.
    out_above : (JOINT_ROW,) float32
        Written: `AHEAD` and `EYE` of the joint above.

    Notes
    -----
    **Source:** w_i = 1 / (p + 1 - i) of what is missing (Thiebaux, Lance, Marsella, "Real-time expressive
    gaze animation for virtual humans", 2009), that is, equal parts of the whole.
    **Differs from the source:** parts may be unequal, w_i = s_i / (s_i + ... + s_p).
    """
    for lane in range(LANES):
        part = share * carry[TRUNK + lane] if is_trunk else share
        total = carry[SUM + lane] + part
        carry[SUM + lane] = total
        row[SHARE + lane] = part / total
        w = row[ROTATION + lane]
        i = row[ROTATION + LANES + lane]
        j = row[ROTATION + 2 * LANES + lane]
        k = row[ROTATION + 3 * LANES + lane]
        scale = row[SCALE + lane]
        fx, fy, fz = rotated(
            w, i, j, k, row[AHEAD + lane], row[AHEAD + LANES + lane], row[AHEAD + 2 * LANES + lane]
        )
        ex, ey, ez = rotated(
            w, i, j, k, row[EYE + lane], row[EYE + LANES + lane], row[EYE + 2 * LANES + lane]
        )
        out_above[AHEAD + lane] = fx
        out_above[AHEAD + LANES + lane] = fy
        out_above[AHEAD + 2 * LANES + lane] = fz
        out_above[EYE + lane] = x * scale + ex
        out_above[EYE + LANES + lane] = y * scale + ey
        out_above[EYE + 2 * LANES + lane] = z * scale + ez


@inlined_kernel
def begin_row(pelvis: Any, carry: Any, frequency: Any, decay: Any, dt: Any) -> None:
    """Refuse targets that cannot be looked at, and ease the weight of the gaze.

    Parameters
    ----------
    pelvis : (JOINT_ROW,) float32
        Head and eyes in the pelvis' frame.
    carry : (CARRY_ROW,) float32
        Pelvis and target. A target that is refused is replaced by a point ahead, and its goal becomes -1.
    frequency, decay, dt : float32
        Of the weight: 1/s, exp(-frequency dt), s.
    """
    for lane in range(LANES):
        w = carry[ROTATION + lane]
        i = carry[ROTATION + LANES + lane]
        j = carry[ROTATION + 2 * LANES + lane]
        k = carry[ROTATION + 3 * LANES + lane]
        ex, ey, ez = rotated(
            w, i, j, k, pelvis[EYE + lane], pelvis[EYE + LANES + lane], pelvis[EYE + 2 * LANES + lane]
        )
        fx, fy, fz = rotated(
            w, i, j, k, pelvis[AHEAD + lane], pelvis[AHEAD + LANES + lane], pelvis[AHEAD + 2 * LANES + lane]
        )
        ex += carry[POSITION + lane]
        ey += carry[POSITION + LANES + lane]
        ez += carry[POSITION + 2 * LANES + lane]
        tx = carry[TARGET + lane]
        ty = carry[TARGET + LANES + lane]
        tz = carry[TARGET + 2 * LANES + lane]
        square = (tx - ex) * (tx - ex) + (ty - ey) * (ty - ey) + (tz - ez) * (tz - ez)
        # A target that is no number fails both comparisons.
        near = square > NEAREST_SQUARE
        far = square < FARTHEST_SQUARE
        carry[TARGET + lane] = tx if near and far else ex + TWO * fx
        carry[TARGET + LANES + lane] = ty if near and far else ey + TWO * fy
        carry[TARGET + 2 * LANES + lane] = tz if near and far else ez + TWO * fz
        goal = carry[GOAL + lane]
        goal = goal if near and far else -goal
        carry[GOAL + lane] = goal
        value, rate = spring_step(
            carry[WEIGHT + lane], carry[WEIGHT_RATE + lane], max(goal, ZERO), frequency, decay, dt
        )
        value = min(max(value, ZERO), ONE)
        # Joints follow the mean over the step, so that its length does not matter.
        carry[MEAN + lane] = HALF * (carry[WEIGHT + lane] + value)
        carry[WEIGHT + lane] = value
        carry[WEIGHT_RATE + lane] = rate
        carry[SPEED + lane] = ZERO


@inlined_kernel
def frame_below(row: Any, carry: Any, x: Any, y: Any, z: Any, lane: int) -> Any:
    """Find rotation and position of a joint below the carried frame, turned as its row tells."""
    scale = row[SCALE + lane]
    w = carry[ROTATION + lane]
    i = carry[ROTATION + LANES + lane]
    j = carry[ROTATION + 2 * LANES + lane]
    k = carry[ROTATION + 3 * LANES + lane]
    ox, oy, oz = rotated(w, i, j, k, x * scale, y * scale, z * scale)
    rotation = product(
        w, i, j, k,
        row[ROTATION + lane], row[ROTATION + LANES + lane],
        row[ROTATION + 2 * LANES + lane], row[ROTATION + 3 * LANES + lane],
    )  # fmt: skip
    px, py, pz = (carry[POSITION + lane], carry[POSITION + LANES + lane], carry[POSITION + 2 * LANES + lane])
    return rotation, (px + ox, py + oy, pz + oz)


@inlined_kernel
def put_frame(rotation: Any, position: Any, carry: Any, lane: int) -> None:
    """Write the carried frame of one lane."""
    for component in range(4):
        carry[ROTATION + component * LANES + lane] = rotation[component]
    for axis in range(3):
        carry[POSITION + axis * LANES + lane] = position[axis]


@inlined_kernel
def aim_joint_row(
    row: Any, carry: Any, x: Any, y: Any, z: Any, pitch: Any, heading: Any, roll: Any,
    bias_x: Any, bias_y: Any, bias_z: Any,
) -> None:  # fmt: skip
    """Find a joint's part of the turn by which the head misses the target, within the joint's limits.

    Parameters
    ----------
    row : (JOINT_ROW,) float32
        The joint; `WANTED` is written: a rotation vector in its frame, rad.
    carry : (CARRY_ROW,) float32
        Target; frame of the joint above, replaced by the joint's with the turn that is wanted.
    x, y, z : float32
        Rest offset, m.
    pitch, heading, roll : float32
        Limits, rad.
    bias_x, bias_y, bias_z : float32
        Added, rad.

    Notes
    -----
    **Differs from the source:** heading about the vertical and rise about the horizontal, instead of the
    shortest rotation, so that heads stay level and people turn round for what is behind them instead of
    bending over backwards.
    """
    inverse_pitch, inverse_heading = ONE / pitch, ONE / heading
    for lane in range(LANES):
        (w, i, j, k), (px, py, pz) = frame_below(row, carry, x, y, z, lane)
        fx, fy, fz = rotated(
            w, i, j, k, row[AHEAD + lane], row[AHEAD + LANES + lane], row[AHEAD + 2 * LANES + lane]
        )
        ex, ey, ez = rotated(
            w, i, j, k, row[EYE + lane], row[EYE + LANES + lane], row[EYE + 2 * LANES + lane]
        )
        tx = carry[TARGET + lane] - px - ex
        ty = carry[TARGET + LANES + lane] - py - ey
        tz = carry[TARGET + 2 * LANES + lane] - pz - ez
        across = np.sqrt(tx * tx + tz * tz)
        distance = np.sqrt(across * across + ty * ty + TINY)
        level = np.sqrt(fx * fx + fz * fz + TINY)
        turn = arc_tangent(fz * tx - fx * tz, fx * tx + fz * tz)
        rise = arc_tangent(ty * level - fy * across, across * level + ty * fy)
        side = carry[SIDE + lane]
        wrong_side = turn * side < ZERO
        turn = turn + TWO * PI * side if abs(turn) > BEHIND and wrong_side else turn
        turn *= row[SHARE + lane] * min(STEEP * across / distance, ONE)
        rise *= row[SHARE + lane] / level
        # The axis of the rise is to the left of the heading half-way through the turn.
        sine, cosine = sine_cosine(HALF * turn)
        a, b, c = rotated(
            w, -i, -j, -k, rise * (fx * sine - fz * cosine), turn, rise * (fx * cosine + fz * sine)
        )
        factor = within_ellipse(a, b, inverse_pitch, inverse_heading)
        a, b, c = a * factor + bias_x, b * factor + bias_y, min(max(c, -roll), roll) + bias_z
        row[WANTED + lane] = a
        row[WANTED + LANES + lane] = b
        row[WANTED + 2 * LANES + lane] = c
        put_frame(product(w, i, j, k, *exponential(a, b, c)), (px, py, pz), carry, lane)


@inlined_kernel
def excess_row(eye_x: Any, eye_y: Any, eye_z: Any, eye: Any, pitch: Any, heading: Any, carry: Any) -> None:
    """Find how far the target stays out of the eyes' limits once the body has turned; above 1: too far."""
    for lane in range(LANES):
        scale = eye[EYE_SCALE + lane]
        w = carry[ROTATION + lane]
        i = carry[ROTATION + LANES + lane]
        j = carry[ROTATION + 2 * LANES + lane]
        k = carry[ROTATION + 3 * LANES + lane]
        ox, oy, oz = rotated(w, i, j, k, eye_x * scale, eye_y * scale, eye_z * scale)
        x, y, z = rotated(
            w, -i, -j, -k,
            carry[TARGET + lane] - carry[POSITION + lane] - ox,
            carry[TARGET + LANES + lane] - carry[POSITION + LANES + lane] - oy,
            carry[TARGET + 2 * LANES + lane] - carry[POSITION + 2 * LANES + lane] - oz,
        )  # fmt: skip
        across = np.sqrt(x * x + y * y + TINY)
        angle = arc_tangent(across, z) / across
        a = y * angle / pitch
        b = x * angle / heading
        carry[EXCESS + lane] = np.sqrt(a * a + b * b)


@inlined_kernel
def swing_row(row: Any, carry: Any, frequency: Any, decay: Any, dt: Any) -> None:
    """Let a joint swing towards its wanted turn; `WANTED` becomes the step it would take.

    Parameters
    ----------
    row : (JOINT_ROW,) float32
        The joint; its rate is updated.
    carry : (CARRY_ROW,) float32
        Weight; the speed of the head grows by the joint's.
    frequency, decay, dt : float32
        1/s, exp(-frequency dt), s.
    """
    inverse_step = ONE / dt
    for lane in range(LANES):
        follow = carry[FOLLOW + lane]
        share = follow * carry[MEAN + lane]
        keep = ONE - follow
        x, x_rate = spring_step(
            row[TURN + lane], row[RATE + lane], share * row[WANTED + lane] + keep * row[TURN + lane],
            frequency, decay, dt,
        )  # fmt: skip
        y, y_rate = spring_step(
            row[TURN + LANES + lane], row[RATE + LANES + lane],
            share * row[WANTED + LANES + lane] + keep * row[TURN + LANES + lane],
            frequency, decay, dt,
        )  # fmt: skip
        z, z_rate = spring_step(
            row[TURN + 2 * LANES + lane], row[RATE + 2 * LANES + lane],
            share * row[WANTED + 2 * LANES + lane] + keep * row[TURN + 2 * LANES + lane],
            frequency, decay, dt,
        )  # fmt: skip
        x -= row[TURN + lane]
        y -= row[TURN + LANES + lane]
        z -= row[TURN + 2 * LANES + lane]
        row[WANTED + lane] = x
        row[WANTED + LANES + lane] = y
        row[WANTED + 2 * LANES + lane] = z
        row[RATE + lane] = x_rate
        row[RATE + LANES + lane] = y_rate
        row[RATE + 2 * LANES + lane] = z_rate
        carry[SPEED + lane] += np.sqrt(x * x + y * y + z * z) * inverse_step


@inlined_kernel
def settle_row(row: Any, carry: Any, x: Any, y: Any, z: Any, most_speed: Any) -> None:
    """Take the step of a joint, slowed down so that the head keeps its largest speed, and turn the joint.

    Parameters
    ----------
    row : (JOINT_ROW,) float32
        The joint: turn, rate and rotation are updated.
    carry : (CARRY_ROW,) float32
        Speed of the head; frame of the joint above, replaced by the joint's.
    x, y, z : float32
        Rest offset, m.
    most_speed : float32
        rad/s.
    """
    for lane in range(LANES):
        slow = most_speed / max(carry[SPEED + lane], most_speed)
        a = row[TURN + lane] + slow * row[WANTED + lane]
        b = row[TURN + LANES + lane] + slow * row[WANTED + LANES + lane]
        c = row[TURN + 2 * LANES + lane] + slow * row[WANTED + 2 * LANES + lane]
        row[TURN + lane] = a
        row[TURN + LANES + lane] = b
        row[TURN + 2 * LANES + lane] = c
        row[RATE + lane] *= slow
        row[RATE + LANES + lane] *= slow
        row[RATE + 2 * LANES + lane] *= slow
        turned = product(
            row[ROTATION + lane], row[ROTATION + LANES + lane],
            row[ROTATION + 2 * LANES + lane], row[ROTATION + 3 * LANES + lane],
            *exponential(a, b, c),
        )  # fmt: skip
        for component in range(4):
            row[ROTATION + component * LANES + lane] = turned[component]
        rotation, position = frame_below(row, carry, x, y, z, lane)
        put_frame(rotation, position, carry, lane)


@inlined_kernel
def aim_eye_row(
    eye: Any, carry: Any, x: Any, y: Any, z: Any, pitch: Any, heading: Any, most_step: Any
) -> None:
    """Aim one eye at the target within its limits, and tell by how much its ray misses.

    Parameters
    ----------
    eye : (EYE_ROW,) float32
        The eye; turn and error are updated.
    carry : (CARRY_ROW,) float32
        The head as it is now; target; goal, above 0 where there is something to look at.
    x, y, z : float32
        Rest offset from the head, m.
    pitch, heading : float32
        Limits, rad.
    most_step : float32
        Largest change of the turn, rad.
    """
    inverse_pitch, inverse_heading = ONE / pitch, ONE / heading
    for lane in range(LANES):
        scale = eye[EYE_SCALE + lane]
        w = carry[ROTATION + lane]
        i = carry[ROTATION + LANES + lane]
        j = carry[ROTATION + 2 * LANES + lane]
        k = carry[ROTATION + 3 * LANES + lane]
        ox, oy, oz = rotated(w, i, j, k, x * scale, y * scale, z * scale)
        w, i, j, k = product(
            w, i, j, k,
            eye[ROTATION + lane], eye[ROTATION + LANES + lane],
            eye[ROTATION + 2 * LANES + lane], eye[ROTATION + 3 * LANES + lane],
        )  # fmt: skip
        tx, ty, tz = rotated(
            w, -i, -j, -k,
            carry[TARGET + lane] - carry[POSITION + lane] - ox,
            carry[TARGET + LANES + lane] - carry[POSITION + LANES + lane] - oy,
            carry[TARGET + 2 * LANES + lane] - carry[POSITION + 2 * LANES + lane] - oz,
        )  # fmt: skip
        across = np.sqrt(tx * tx + ty * ty + TINY)
        angle = arc_tangent(across, tz) / across
        angle = angle if carry[GOAL + lane] > ZERO else ZERO
        a = -ty * angle
        b = tx * angle
        factor = within_ellipse(a, b, inverse_pitch, inverse_heading)
        a = a * factor - eye[TURN + lane]
        b = b * factor - eye[TURN + LANES + lane]
        factor = most_step / max(np.sqrt(a * a + b * b), most_step)
        a = eye[TURN + lane] + factor * a
        b = eye[TURN + LANES + lane] + factor * b
        eye[TURN + lane] = a
        eye[TURN + LANES + lane] = b
        angle = np.sqrt(a * a + b * b + TINY)
        sine, cosine = acute_sine_cosine(angle)
        sine /= angle
        rx = b * sine
        ry = -a * sine
        cx = ry * tz - cosine * ty
        cy = cosine * tx - rx * tz
        cz = rx * ty - ry * tx
        eye[ERROR + lane] = arc_tangent(np.sqrt(cx * cx + cy * cy + cz * cz), rx * tx + ry * ty + cosine * tz)


@inlined_kernel
def turn_eye_row(eye: Any, pitch: Any, heading: Any) -> None:
    """Turn the local rotation of an eye by gaze and saccade together, within the eye's limits."""
    inverse_pitch, inverse_heading = ONE / pitch, ONE / heading
    for lane in range(LANES):
        a = eye[TURN + lane] + eye[OFFSET + lane]
        b = eye[TURN + LANES + lane] + eye[OFFSET + LANES + lane]
        factor = within_ellipse(a, b, inverse_pitch, inverse_heading)
        a, b, c, d = exponential(a * factor, b * factor, ZERO)
        w, i, j, k = product(
            eye[ROTATION + lane], eye[ROTATION + LANES + lane],
            eye[ROTATION + 2 * LANES + lane], eye[ROTATION + 3 * LANES + lane],
            a, b, c, d,
        )  # fmt: skip
        eye[ROTATION + lane] = w
        eye[ROTATION + LANES + lane] = i
        eye[ROTATION + 2 * LANES + lane] = j
        eye[ROTATION + 3 * LANES + lane] = k
