"""Readers of motion files: BVH, ASF/AMC, SK/SKM/SKMB, animated glTF."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from crowd.errors import MotionError, describe
from crowd.motion.source import SourceMotion

EXTENSIONS = (".bvh", ".amc", ".skm", ".skmb", ".gltf", ".glb")
SKELETON_FOLDERS_UP = 3
"""Skeletons are looked for beside a motion, this many folders above, and in folders called skeletons."""

__all__ = ["EXTENSIONS", "find_motion_files", "read_motions"]


def find_motion_files(paths: Iterable[Path]) -> list[Path]:
    """List the motion files in files and folders, folders searched to the bottom, in order of names.

    Raises
    ------
    MotionError
        A path does not exist, a file has another ending, or a folder holds no motion.
    """
    found: dict[Path, None] = {}
    for path in paths:
        if path.is_dir():
            inside = sorted(file for file in path.rglob("*") if file.suffix.lower() in EXTENSIONS)
            if not inside:
                raise MotionError(describe(str(path), "holds no motion files", allowed=", ".join(EXTENSIONS)))
            found.update(dict.fromkeys(inside))
        elif not path.exists():
            raise MotionError(describe(str(path), "there is no such file or folder"))
        elif path.suffix.lower() not in EXTENSIONS:
            allowed = ", ".join(EXTENSIONS)
            raise MotionError(describe(str(path), "is no known kind of motion file", path.suffix, allowed))
        else:
            found[path] = None
    return list(found)


def read_motions(
    path: Path, *, skeleton: Path | None = None, frame_rate: float | None = None
) -> tuple[SourceMotion, ...]:
    """Read all motions of a file.

    Parameters
    ----------
    path : Path
    skeleton : Path, optional
        For formats that keep it apart; the nearest one that fits is taken otherwise.
    frame_rate : float, optional
        Hz; for AMC, which states none, and for glTF, whose keys are not uniform.

    Raises
    ------
    MotionError
        The file is broken, or its skeleton is not found.
    """
    match path.suffix.lower():
        case ".bvh":
            from crowd.motion.formats.bvh import read_bvh

            return (read_bvh(path),)
        case ".amc":
            from crowd.motion.formats.acclaim import read_amc

            return (read_amc(path, skeleton or nearest_asf(path), frame_rate),)
        case ".skm":
            from crowd.motion.formats.smartbody import read_channels, read_skm

            names = [channel.joint for channel in read_channels(path)]
            return (read_skm(path, skeleton or nearest_sk(path, names)),)
        case ".skmb":
            from crowd.motion.formats.smartbody_binary import read_channels as read_binary_channels
            from crowd.motion.formats.smartbody_binary import read_skmb

            names = [channel.joint for channel in read_binary_channels(path)]
            return (read_skmb(path, skeleton or nearest_sk(path, names)),)
        case ".gltf" | ".glb":
            from crowd.motion.formats.gltf import read_gltf

            return read_gltf(path, frame_rate)
        case other:
            allowed = ", ".join(EXTENSIONS)
            raise MotionError(describe(str(path), "is no known kind of motion file", other, allowed))


def skeletons_near(path: Path, suffix: str) -> list[Path]:
    """Skeleton files beside a motion and above it, the nearest first."""
    folder = path.absolute().parent
    found: dict[Path, None] = {}
    for place in [folder, *list(folder.parents)[:SKELETON_FOLDERS_UP]]:
        for where in (place, place / "skeletons"):
            if where.is_dir():
                found.update(dict.fromkeys(sorted(where.glob(f"*{suffix}"))))
    return list(found)


def nearest_asf(path: Path) -> Path:
    """The ASF skeleton of an AMC motion: the nearest whose name begins the motion's, or the only nearest one.

    Raises
    ------
    MotionError
        There is none, or several and no name fits.
    """
    near = skeletons_near(path, ".asf")
    named = [file for file in near if path.stem.startswith(file.stem)]
    if named:
        return named[0]
    first = [file for file in near if file.parent == near[0].parent] if near else []
    if len(first) == 1:
        return first[0]
    names = ", ".join(file.name for file in first) or None
    raise MotionError(
        describe(str(path), "its skeleton is not clear; say --skeleton", names, "one .asf file")
    )


def nearest_sk(path: Path, joints: Iterable[str]) -> Path:
    """The SK skeleton that has most of a motion's joints; among equals the one of its name, or the nearest.

    Skeletons of neighbouring sets are looked at when those nearby have none of the joints.

    Raises
    ------
    MotionError
        There is none.
    """
    from crowd.motion.formats.smartbody import read_sk

    wanted = set(joints)
    near = skeletons_near(path, ".sk")
    coverage = [len(wanted & set(read_sk(file).skeleton.joint_names)) for file in near]
    if not any(coverage):
        near = sorted(path.absolute().parent.parent.parent.glob("*/skeletons/*.sk"))
        coverage = [len(wanted & set(read_sk(file).skeleton.joint_names)) for file in near]
    if not any(coverage):
        raise MotionError(
            describe(str(path), "its skeleton is not found; say --skeleton", allowed="a .sk file")
        )

    def rank(place: int) -> tuple[int, bool, int]:
        return coverage[place], path.stem.startswith(near[place].stem), -place

    return near[max(range(len(near)), key=rank)]
