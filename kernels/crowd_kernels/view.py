"""What a renderer draws of a crowd: who is seen at which level of detail, and their pose as 16-bit texels."""

import math
from typing import Any

import numpy as np

from crowd_kernels._jit import inlined_kernel, kernel, parallel_kernel, prange

CHUNKS = 32
SPHERE_HEIGHT = 0.9
SPHERE_RADIUS = 1.1
"""The bounding sphere of a character: its centre above the ground, and its radius, m."""
HYSTERESIS = 0.1
"""Share by which the height on the screen must pass a limit before the level changes."""
HIDDEN = -1
REACH = 4.0
"""Joints are at most this far from the root along each axis, m; scales are at most as large."""
STEPS32 = np.float32(32767.0)
STEPS_PER_METRE = np.float32(32767.0 / REACH)
HALF = np.float32(0.5)


@parallel_kernel
def levels_crowd(
    position_world: Any,
    is_active: Any,
    stature: Any,
    plane: Any,
    eye: Any,
    pixels_at_one_metre: float,
    is_perspective: bool,
    least_height: Any,
    out_level: Any,
) -> None:
    """Choose the level of detail of each character, or none when it is outside the view.

    Parameters
    ----------
    position_world : (N, 3) float64
        Roots on the ground, m.
    is_active : (N,) bool
        Whether there is a person in the slot.
    stature : (N,) float64
        m.
    plane : (P, 4) float64
        Planes of the view: unit normals that point inwards, and offsets, m.
    eye : (3,) float64
        Place of the camera, m.
    pixels_at_one_metre : float
        Height on the screen of one metre one metre away, or at any distance without perspective.
    is_perspective : bool
        Whether things look smaller far away.
    least_height : (L,) float64
        Descending: level k is for characters at least so many pixels high, and level L for all smaller ones.
    out_level : (N,) int32
        Read as the levels of the last picture, for hysteresis; written: 0 to L, or -1 for who is not seen.

    Notes
    -----
    **Source:** view-frustum culling with bounding spheres, and levels of detail by projected size (Luebke and
    others, "Level of detail for 3D graphics", 2003).
    """
    count = position_world.shape[0]
    for k in prange(CHUNKS):
        chunk = (k * 37) % CHUNKS
        for row in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            x = position_world[row, 0]
            y = position_world[row, 1] + SPHERE_HEIGHT
            z = position_world[row, 2]
            is_seen = bool(is_active[row])
            for side in range(plane.shape[0]):
                distance = plane[side, 0] * x + plane[side, 1] * y + plane[side, 2] * z + plane[side, 3]
                is_seen = is_seen and distance > -SPHERE_RADIUS
            before = out_level[row]
            level = HIDDEN
            if is_seen:
                height = stature[row] * pixels_at_one_metre
                if is_perspective:
                    away = math.sqrt((x - eye[0]) ** 2 + (y - eye[1]) ** 2 + (z - eye[2]) ** 2)
                    height /= max(away, 0.01)
                level = 0
                for limit in range(least_height.shape[0]):
                    margin = 1.0
                    if before != HIDDEN:
                        margin = 1.0 - HYSTERESIS if before <= limit else 1.0 + HYSTERESIS
                    if height < least_height[limit] * margin:
                        level = limit + 1
            out_level[row] = level


@kernel
def sort_rows(level: Any, build: Any, build_count: int, out_begin: Any, out_row: Any) -> None:
    """List the characters that are seen by level and build, in ascending order within each.

    Parameters
    ----------
    level : (N,) int32
        As `levels_crowd` writes.
    build : (N,) int32
        Kind of body, 0 to `build_count` - 1.
    build_count : int
    out_begin : (L * build_count + 1,) int32
        Written: bucket level * build_count + build holds `out_row` from its entry to the next one's.
    out_row : (N,) int32
        Written up to the last entry of `out_begin`.

    Notes
    -----
    **Source:** counting sort (Knuth, "The art of computer programming", volume 3, section 5.2).
    """
    out_begin[:] = 0
    for row in range(level.shape[0]):
        if level[row] != HIDDEN:
            out_begin[level[row] * build_count + build[row] + 1] += 1
    for bucket in range(1, out_begin.shape[0]):
        out_begin[bucket] += out_begin[bucket - 1]
    for row in range(level.shape[0]):
        if level[row] != HIDDEN:
            bucket = level[row] * build_count + build[row]
            out_row[out_begin[bucket]] = row
            out_begin[bucket] += 1
    for bucket in range(out_begin.shape[0] - 1, 0, -1):
        out_begin[bucket] = out_begin[bucket - 1]
    out_begin[0] = 0


@inlined_kernel
def joint_texels(position_row: Any, rotation_row: Any, scale_row: Any, joint: Any, out_row: Any) -> None:
    """Pack some joints of one character.

    Parameters
    ----------
    position_row : (3 * J,) float32
        m.
    rotation_row : (4 * J,) float32
        Unit quaternions.
    scale_row : (J,) int16
    joint : (K,) int32
        Which joints.
    out_row : (8 * K,) int16
        Written.
    """
    for place in range(joint.shape[0]):
        number = joint[place]
        for part in range(4):
            turned = rotation_row[4 * number + part] * STEPS32
            out_row[8 * place + part] = np.int32(turned + np.copysign(HALF, turned))
        for part in range(3):
            moved = min(max(position_row[3 * number + part] * STEPS_PER_METRE, -STEPS32), STEPS32)
            out_row[8 * place + 4 + part] = np.int32(moved + np.copysign(HALF, moved))
        out_row[8 * place + 7] = scale_row[number]


@parallel_kernel
def pack_crowd(
    position_world: Any,
    yaw: Any,
    joint_position_model: Any,
    joint_rotation_model: Any,
    joint_scale: Any,
    build: Any,
    drawn: Any,
    joint: Any,
    origin: Any,
    out_root: Any,
    out_palette: Any,
) -> None:
    """Pack roots and joints of the drawn characters as texels of 16 bytes a joint.

    Parameters
    ----------
    position_world : (N, 3) float64
        Roots, m.
    yaw : (N,) float64
        Headings, rad.
    joint_position_model : (N, J, 3) float32
        Joints in the root frame, each coordinate in (-4, 4) m.
    joint_rotation_model : (N, J, 4) float32
        Unit quaternions in the root frame.
    joint_scale : (N, J) int16
        Size of the flesh around each joint, in units of 4 / 32767.
    build : (N,) int32
        Kind of body.
    drawn : (D,) int32
        Characters to pack, 0 to N - 1.
    joint : (K,) int32
        Joints to pack, in this order.
    origin : (3,) float64
        Point that becomes 0, m.
    out_root : (>= D, 8) float32
        Written in rows up to D: position and row; sine and cosine of yaw, build, 0.
    out_palette : (>= D, 8 * K) int16
        Written in rows up to D: for each joint (w, x, y, z) / 32767, then (x, y, z, scale) * 4 / 32767.

    Notes
    -----
    **Source:** pose textures for instanced skinning (Dudash, "Skinned instancing", NVIDIA, 2007).
    **Differs from the source:** rotation, position and scale in 16 bits each instead of matrices, a third of
    the bytes; positions count from the root, so that they are right to 0.1 mm anywhere in the world.
    """
    count = drawn.shape[0]
    joint_count = joint_rotation_model.shape[1]
    position_rows = joint_position_model.reshape(joint_position_model.shape[0], 3 * joint_count)
    rotation_rows = joint_rotation_model.reshape(joint_rotation_model.shape[0], 4 * joint_count)
    for k in prange(CHUNKS):
        chunk = (k * 37) % CHUNKS
        for index in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            row = drawn[index]
            out_root[index, 0] = position_world[row, 0] - origin[0]
            out_root[index, 1] = position_world[row, 1] - origin[1]
            out_root[index, 2] = position_world[row, 2] - origin[2]
            out_root[index, 3] = row
            out_root[index, 4] = math.sin(yaw[row])
            out_root[index, 5] = math.cos(yaw[row])
            out_root[index, 6] = build[row]
            out_root[index, 7] = 0.0
            joint_texels(position_rows[row], rotation_rows[row], joint_scale[row], joint, out_palette[index])
