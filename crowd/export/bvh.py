"""BVH: one file for each person, metres and degrees, y up."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TextIO

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from crowd.export.output import whole_folder
from crowd.export.selection import Selection, Visit
from crowd.motion.skeleton import Skeleton

FloatArray = npt.NDArray[np.float64]

FILES_AT_ONCE = 200
END_LENGTH = 0.05
"""Length of the segments that end the chains, m."""
GIMBAL = 1.0 - 1e-12


def export_bvh(selection: Selection, out: Path, on_block: Callable[[float], None]) -> None:
    """Write a folder of BVH files in the proportions of each person.

    Parameters
    ----------
    selection : Selection
    out : Path
        Folder; files are called after the visits.
    on_block : callable
        Called with the number of frames after each block.
    """
    visits = selection.visits
    with whole_folder(out) as folder:
        for begin in range(0, len(visits), FILES_AT_ONCE):
            _write(selection, visits[begin : begin + FILES_AT_ONCE], folder, on_block)


def _write(
    selection: Selection, visits: Sequence[Visit], folder: Path, on_block: Callable[[float], None]
) -> None:
    recording = selection.recording
    slots = np.array(sorted({visit.slot for visit in visits}))
    column = {int(slot): number for number, slot in enumerate(slots)}
    offsets = recording.joint_offsets(slots)
    with ExitStack() as files:
        opened: list[TextIO] = []
        for visit in visits:
            file: TextIO = files.enter_context((folder / f"{visit.name}.bvh").open("w", encoding="utf-8"))
            file.write(hierarchy(recording.skeleton, offsets[column[visit.slot]]))
            file.write(f"MOTION\nFrames: {visit.frame_count}\nFrame Time: {selection.frame_seconds:.9f}\n")
            opened.append(file)
        for frames in selection.blocks(len(slots)):
            poses = recording.poses(frames, slots)
            for visit, file in zip(visits, opened, strict=True):
                first, last = max(visit.first, frames.start), min(visit.last, frames.stop - 1)
                if first <= last:
                    rows = slice(first - frames.start, last - frames.start + 1)
                    place = column[visit.slot]
                    file.write(
                        motion_rows(
                            recording.skeleton, poses.pelvis_world[rows, place], poses.rotation[rows, place]
                        )
                    )
            on_block(frames.stop - frames.start)


def hierarchy(skeleton: Skeleton, offset: FloatArray) -> str:
    """The HIERARCHY part: joints with offsets (J, 3) in m."""
    children: dict[int, list[int]] = {}
    for joint, parent in enumerate(skeleton.parent.tolist()):
        children.setdefault(parent, []).append(joint)
    lines = ["HIERARCHY"]

    def add(joint: int, depth: int) -> None:
        tab = "\t" * depth
        word = "JOINT" if depth else "ROOT"
        # The root's position channels carry its whole place.
        place = offset[joint] if depth else np.zeros(3)
        lines.append(f"{tab}{word} {skeleton.joint_names[joint]}\n{tab}{{")
        lines.append(f"{tab}\tOFFSET {place[0]:.7f} {place[1]:.7f} {place[2]:.7f}")
        positions = "" if depth else "Xposition Yposition Zposition "
        count = 3 if depth else 6
        lines.append(f"{tab}\tCHANNELS {count} {positions}Zrotation Yrotation Xrotation")
        for child in children.get(joint, []):
            add(child, depth + 1)
        if joint not in children:
            length = np.linalg.norm(offset[joint])
            end = offset[joint] / max(length, 1e-9) * END_LENGTH
            lines.append(
                f"{tab}\tEnd Site\n{tab}\t{{\n{tab}\t\tOFFSET {end[0]:.7f} {end[1]:.7f} {end[2]:.7f}"
            )
            lines.append(f"{tab}\t}}")
        lines.append(f"{tab}}}")

    add(0, 0)
    return "\n".join(lines) + "\n"


def motion_rows(skeleton: Skeleton, pelvis: FloatArray, rotation: FloatArray) -> str:
    """Rows of positions (F, 3) and local rotations (F, J, 4), joints in the order of the hierarchy."""
    angles = np.degrees(euler_zyx(rotation))[:, hierarchy_order(skeleton)]
    values = np.concatenate([pelvis, angles.reshape(len(pelvis), -1)], axis=1)
    return "\n".join(" ".join(f"{value:.6f}" for value in row) for row in values.tolist()) + "\n"


def hierarchy_order(skeleton: Skeleton) -> list[int]:
    """Joints in the order in which a hierarchy lists them: each one before its children, depth first."""
    children: dict[int, list[int]] = {}
    for joint, parent in enumerate(skeleton.parent.tolist()):
        children.setdefault(parent, []).append(joint)
    order: list[int] = []
    stack = [0]
    while stack:
        joint = stack.pop()
        order.append(joint)
        stack.extend(reversed(children.get(joint, [])))
    return order


def euler_zyx(rotation: FloatArray) -> FloatArray:
    """Angles (..., 3) about z, y, x in rad of rotations (..., 4): R = Rz Ry Rx."""
    matrix = Rotation.from_quat(rotation[..., [1, 2, 3, 0]].reshape(-1, 4)).as_matrix()
    sine = np.clip(-matrix[:, 2, 0], -1.0, 1.0)
    is_locked = np.abs(sine) > GIMBAL
    y = np.arcsin(sine)
    # Where y is a right angle, z and x turn about one axis: x is left at 0.
    z = np.where(
        is_locked,
        np.arctan2(-matrix[:, 0, 1], matrix[:, 1, 1]),
        np.arctan2(matrix[:, 1, 0], matrix[:, 0, 0]),
    )
    x = np.where(is_locked, 0.0, np.arctan2(matrix[:, 2, 1], matrix[:, 2, 2]))
    return np.stack([z, y, x], axis=-1).reshape(*rotation.shape[:-1], 3)
