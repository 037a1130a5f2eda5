"""COCO keypoints: the seventeen points of each person, seen from a camera."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from crowd.errors import SettingsError, describe
from crowd.export.output import whole_file
from crowd.export.selection import Selection
from crowd.export.tables import visit_numbers
from crowd.motion.rotation import rotate
from crowd.motion.skeleton import Skeleton

FloatArray = npt.NDArray[np.float64]

KEYPOINTS = (
    "nose", "left_eye", "right_eye", "left_ear", "right_ear",
    "left_shoulder", "right_shoulder", "left_elbow", "right_elbow", "left_wrist", "right_wrist",
    "left_hip", "right_hip", "left_knee", "right_knee", "left_ankle", "right_ankle",
)  # fmt: skip
JOINT_OF = {"shoulder": "upper_arm", "elbow": "forearm", "wrist": "hand", "hip": "thigh", "knee": "shank",
            "ankle": "foot", "eye": "eye"}  # fmt: skip
ON_HEAD = {
    "nose": (0.0, 0.035, 0.115),
    "left_ear": (0.075, 0.045, 0.015),
    "right_ear": (-0.075, 0.045, 0.015),
}
"""Points in the frame of the head joint at a stature of 1.75 m, m."""
EDGES = (
    (16, 14), (14, 12), (17, 15), (15, 13), (12, 13), (6, 12), (7, 13), (6, 7), (6, 8), (7, 9),
    (8, 10), (9, 11), (2, 3), (1, 2), (1, 3), (2, 4), (3, 5), (4, 6), (5, 7),
)  # fmt: skip
IN_PICTURE, OUTSIDE = 2, 0
NEAREST = 0.05
"""What is nearer to the camera, or behind it, is not seen, m."""


@dataclass(frozen=True)
class PictureCamera:
    """A pinhole camera.

    Attributes
    ----------
    eye, target : (float, float, float)
        Where it stands and what it looks at, world, m.
    field_of_view : float
        From the lower to the upper edge, deg.
    width, height : int
        Of the picture, pixels.
    """

    eye: tuple[float, float, float] = (0.0, 6.0, -16.0)
    target: tuple[float, float, float] = (0.0, 1.0, 0.0)
    field_of_view: float = 45.0
    width: int = 1280
    height: int = 720

    def __post_init__(self) -> None:
        """Refuse cameras that see nothing."""
        if not 1.0 <= self.field_of_view <= 170.0:
            raise SettingsError(
                describe("--field-of-view", "is out of range", self.field_of_view, "1 to 170")
            )
        if min(self.width, self.height) < 1:
            size = f"{self.width} x {self.height}"
            raise SettingsError(describe("--size", "must be positive", size, "pixels"))
        way = np.subtract(self.target, self.eye)
        if np.linalg.norm(np.cross(way, (0.0, 1.0, 0.0))) < 1e-6:
            raise SettingsError(describe("--eye and --target", "look straight up or down, or are one place"))

    def project(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Pixels (..., 2), from the upper left corner, and depths (...), m, of world points (..., 3)."""
        ahead = np.subtract(self.target, self.eye)
        ahead = ahead / np.linalg.norm(ahead)
        right = np.cross(ahead, (0.0, 1.0, 0.0))
        right /= np.linalg.norm(right)
        up = np.cross(right, ahead)
        way = points - np.array(self.eye)
        depth = way @ ahead
        focal = 0.5 * self.height / math.tan(math.radians(0.5 * self.field_of_view))
        scale = focal / np.maximum(depth, NEAREST)
        x = 0.5 * self.width + scale * (way @ right)
        y = 0.5 * self.height - scale * (way @ up)
        return np.stack([x, y], axis=-1), depth


def export_coco(
    selection: Selection, out: Path, on_block: Callable[[float], None], camera: PictureCamera | None = None
) -> None:
    """Write keypoints of everyone in every frame as COCO JSON.

    A point is marked 2 when it lies in the picture, 0 when it does not; whether somebody stands before it is
    not looked at. Image ids are frames from 1, file names ``000001.png`` and so on; the depth of each person,
    m, and its visit are further keys.

    Parameters
    ----------
    selection : Selection
    out : Path
    on_block : callable
        Called with the number of frames after each block.
    camera : PictureCamera, optional
    """
    view = camera or PictureCamera()
    recording = selection.recording
    number_of = visit_numbers(selection)
    with whole_file(out) as path, path.open("w", encoding="utf-8") as file:
        head = {"description": f"{recording.scenario_name}, simulated", "version": recording.version}
        category = {
            "id": 1, "name": "person", "supercategory": "person", "keypoints": KEYPOINTS, "skeleton": EDGES
        }  # fmt: skip
        file.write(f'{{"info": {json.dumps(head)}, "categories": [{json.dumps(category)}], "images": [\n')
        for frame in range(selection.frame_count):
            image = {
                "id": frame + 1,
                "file_name": f"{frame + 1:06d}.png",
                "width": view.width,
                "height": view.height,
            }
            file.write(("" if frame == 0 else ",\n") + json.dumps(image))
        file.write('\n], "annotations": [\n')
        written = 0
        for frames in selection.blocks():
            poses = recording.poses(frames, selection.slots)
            rotation, position = recording.posed(poses, selection.slots)
            scale = recording.stature[selection.slots] / recording.skeleton.stature
            points = keypoints(recording.skeleton, rotation, position, scale)
            pixels, depth = view.project(points)
            is_active = recording.read("is_active", frames)[:, selection.slots]
            for row, column in zip(*np.nonzero(is_active), strict=True):
                entry = annotation(pixels[row, column], depth[row, column], view)
                if entry is None:
                    continue
                written += 1
                frame = frames.start + int(row)
                visit = number_of(selection.slots[column : column + 1], np.array([frame]))[0]
                image_id = frame - selection.first + 1
                entry |= {"id": written, "image_id": image_id, "category_id": 1, "person": int(visit)}
                file.write(("" if written == 1 else ",\n") + json.dumps(entry))
            on_block(frames.stop - frames.start)
        file.write("\n]}\n")


def keypoints(
    skeleton: Skeleton, rotation: FloatArray, position: FloatArray, scale: FloatArray
) -> FloatArray:
    """The seventeen points (F, C, 17, 3), m, of posed people; `scale` (C,) is their size."""
    head = skeleton.joint("head")
    points = np.zeros((*position.shape[:2], len(KEYPOINTS), 3))
    for number, name in enumerate(KEYPOINTS):
        if name in ON_HEAD:
            offset = np.array(ON_HEAD[name]) * scale[None, :, None]
            points[:, :, number] = position[:, :, head] + rotate(rotation[:, :, head], offset)
        else:
            side, _, part = name.partition("_")
            points[:, :, number] = position[:, :, skeleton.joint(f"{side}_{JOINT_OF[part]}")]
    return points


def annotation(pixels: FloatArray, depth: FloatArray, view: PictureCamera) -> dict[str, object] | None:
    """One person's entry; None if no point lies in the picture."""
    inside = (pixels >= 0.0).all(axis=1) & (pixels[:, 0] < view.width) & (pixels[:, 1] < view.height)
    inside &= depth > NEAREST
    if not inside.any():
        return None
    flat = [
        value
        for (x, y), is_inside in zip(pixels.tolist(), inside.tolist(), strict=True)
        for value in ((round(x, 2), round(y, 2), IN_PICTURE) if is_inside else (0, 0, OUTSIDE))
    ]
    low, high = pixels[inside].min(axis=0), pixels[inside].max(axis=0)
    width, height = (high - low).tolist()
    return {
        "keypoints": flat,
        "num_keypoints": int(inside.sum()),
        "bbox": [round(float(low[0]), 2), round(float(low[1]), 2), round(width, 2), round(height, 2)],
        "area": round(width * height, 2),
        "iscrowd": 0,
        "depth_m": round(float(depth.mean()), 3),
    }
