"""Motion libraries as single HDF5 files: all clips, the skeleton, and the licence text of their source."""

from __future__ import annotations

import os
from dataclasses import asdict
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from crowd.errors import MotionError, describe
from crowd.motion.clip import Clip, ClipKind, ClipQuality, FootEvent, JointMask, JumpLabels, ReachLabels
from crowd.motion.library import Calibration, MotionLibrary
from crowd.motion.skeleton import Skeleton

FORMAT = 1
SKELETON_FIELDS = ("parent", "offset", "segment", "limit_lower", "limit_upper")


def save_library(path: str | os.PathLike[str], library: MotionLibrary) -> None:
    """Write a library to one file; it appears whole or not at all.

    Parameters
    ----------
    path : path
    library : MotionLibrary

    Raises
    ------
    MotionError
        The file cannot be written.
    """
    target = Path(path)
    unfinished = target.with_name(f".{target.name}.part")
    try:
        with h5py.File(unfinished, "w") as file:
            file.attrs["format"] = FORMAT
            file.attrs["name"] = library.name
            file.attrs["source"] = library.source
            # Texts of licences outgrow attributes.
            file.create_dataset("licence", data=library.licence)
            if library.calibration is not None:
                file.create_group("calibration").attrs.update(asdict(library.calibration))
            write_skeleton(file.create_group("skeleton"), library.skeleton)
            clips = file.create_group("clips")
            for number, clip in enumerate(library.clips):
                write_clip(clips.create_group(f"{number:05d}"), clip)
        unfinished.replace(target)
    except OSError as error:
        unfinished.unlink(missing_ok=True)
        raise MotionError(describe(str(target), "cannot be written", error.strerror or str(error))) from error


def load_library(path: str | os.PathLike[str]) -> MotionLibrary:
    """Read a library.

    Parameters
    ----------
    path : path

    Raises
    ------
    MotionError
        The file is missing, or is no library.
    """
    place = Path(path)
    if not place.is_file():
        raise MotionError(describe(str(place), "no such motion library; `crowd motions import` makes one"))
    try:
        with h5py.File(place, "r") as file:
            found = int(file.attrs.get("format", 0))
            if found != FORMAT or "clips" not in file:
                raise MotionError(
                    describe(str(place), "is no motion library", f"format {found}", str(FORMAT))
                )
            clips = tuple(read_clip(file["clips"][number]) for number in sorted(file["clips"]))
            return MotionLibrary(
                str(file.attrs["name"]),
                read_skeleton(file["skeleton"]),
                clips,
                str(file.attrs["source"]),
                str(file["licence"].asstr()[()]),
                _calibration(file["calibration"].attrs) if "calibration" in file else None,
            )
    except (OSError, KeyError, ValueError, RuntimeError, TypeError) as error:
        raise MotionError(describe(str(place), "is no motion library", str(error))) from error


def write_skeleton(group: Any, skeleton: Skeleton) -> None:
    """Write a skeleton into an HDF5 group."""
    group.attrs["stature"] = skeleton.stature
    group.create_dataset("joint_names", data=list(skeleton.joint_names))
    for name in SKELETON_FIELDS:
        group.create_dataset(name, data=getattr(skeleton, name))


def read_skeleton(group: Any) -> Skeleton:
    """Read a skeleton from an HDF5 group."""
    return Skeleton(
        joint_names=tuple(group["joint_names"].asstr()[:]),
        stature=float(group.attrs["stature"]),
        **{name: group[name][:] for name in SKELETON_FIELDS},
    )


def write_clip(group: Any, clip: Clip) -> None:
    """Write a clip into an HDF5 group."""
    for name in ("name", "kind", "mask", "source"):
        group.attrs[name] = str(getattr(clip, name))
    group.attrs["frame_rate"] = clip.frame_rate
    group.attrs["is_cyclic"] = clip.is_cyclic
    group.attrs["cycles"] = clip.cycles
    group.attrs["parameters"] = clip.parameters
    packed = {"compression": "gzip", "shuffle": True} if clip.frame_count > 1 else {}
    group.create_dataset("rotation_local", data=clip.rotation_local, **packed)
    for name in ("pelvis_position_root", "root_position", "root_yaw"):
        group.create_dataset(name, data=getattr(clip, name))
    group.create_dataset("event_time", data=np.array([time for time, _ in clip.foot_events], np.float64))
    group.create_dataset("event", data=np.array([int(event) for _, event in clip.foot_events], np.uint8))
    for name in ("jump", "reach", "quality"):
        labels = getattr(clip, name)
        if labels is not None:
            part = group.create_group(name)
            for key, value in asdict(labels).items():
                part.attrs[key] = value


def read_clip(group: Any) -> Clip:
    """Read a clip from an HDF5 group."""
    attributes = group.attrs
    events = zip(group["event_time"][:].tolist(), group["event"][:].tolist(), strict=True)
    forward, turn, side = (float(value) for value in attributes["parameters"])
    return Clip(
        str(attributes["name"]),
        ClipKind(attributes["kind"]),
        float(attributes["frame_rate"]),
        group["rotation_local"][:],
        group["pelvis_position_root"][:],
        group["root_position"][:],
        group["root_yaw"][:],
        is_cyclic=bool(attributes["is_cyclic"]),
        foot_events=tuple((float(time), FootEvent(event)) for time, event in events),
        parameters=(forward, turn, side),
        cycles=int(attributes["cycles"]),
        mask=JointMask(attributes["mask"]),
        jump=JumpLabels(**_numbers(group["jump"].attrs)) if "jump" in group else None,
        reach=_reach(group["reach"].attrs) if "reach" in group else None,
        quality=ClipQuality(**_numbers(group["quality"].attrs)) if "quality" in group else None,
        source=str(attributes["source"]),
    )


def _numbers(attributes: Any) -> dict[str, float]:
    return {key: float(value) for key, value in attributes.items()}


def _calibration(attributes: Any) -> Calibration:
    numbers = {key: float(value) for key, value in attributes.items()}
    return Calibration(points=int(numbers.pop("points")), **numbers)


def _reach(attributes: Any) -> ReachLabels:
    left, up, ahead = (float(value) for value in attributes["hand_position"])
    return ReachLabels(str(attributes["side"]), float(attributes["apex"]), (left, up, ahead))
