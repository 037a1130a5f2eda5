"""Find the skeleton file that a motion file needs."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

from crowd.errors import MotionError, describe
from crowd.motion.formats.smartbody_channels import ChannelData, SmartBodySkeleton, choose_skeleton
from crowd.motion.formats.smartbody_skeleton import read_sk

NEAR_GROUPS = 2
"""Groups of folders whose skeletons are meant for a clip: a broken one among these is an error."""


def skeleton_files(path: Path, suffix: str) -> Iterator[list[Path]]:
    """Skeleton files by nearness: beside a motion file; in its parent folder and that one's other folders;
    above, and in folders of folders there."""
    own = path.absolute().parent
    above = own.parent.parent
    yield from (
        [
            file
            for folder in folders
            for file in sorted(folder.glob("*"))
            if file.suffix.lower() == suffix and file.is_file()
        ]
        for folders in (
            [own],
            [own.parent, *sorted(own.parent.glob("*/"))],
            [above, *sorted(above.glob("*/")), *sorted(above.glob("*/*/"))],
        )
    )


def smartbody_skeleton(data: ChannelData, stated: Path | None) -> SmartBodySkeleton:
    """Read the skeleton of a clip: the stated one, or the nearest that has its channels.

    Further folders are searched only where no near skeleton has half of the joints.
    """
    if stated is not None:
        return read_sk(stated)
    joints = {joint for joint, _ in data.channels}
    tried: list[SmartBodySkeleton] = []
    for number, files in enumerate(skeleton_files(data.path, ".sk")):
        bodies = []
        broken: MotionError | None = None
        for file in files:
            try:
                bodies.append(_cached(file, file.stat().st_mtime_ns))
            except MotionError as error:
                broken = broken or error
        if any(2 * len(joints.intersection(body.skeleton.joint_names)) >= len(joints) for body in bodies):
            return choose_skeleton(data.path, data.channels, bodies)
        if broken is not None and number < NEAR_GROUPS:
            raise broken
        tried += bodies
    return choose_skeleton(data.path, data.channels, tried)


def nearest_asf(path: Path) -> Path:
    """The .asf file of an .amc file: the nearest that its name starts with, or the only near one.

    Raises
    ------
    MotionError
        There is none, or several and the name does not tell.
    """
    for files in skeleton_files(path, ".asf"):
        named = [file for file in files if path.stem.lower().startswith(file.stem.lower())]
        if named:
            return max(named, key=lambda file: len(file.stem))
        if len(files) > 1:
            names = ", ".join(str(file) for file in files)
            raise MotionError(describe(str(path), "several skeletons may belong to it", names, "one, stated"))
        if files:
            return files[0]
    raise MotionError(describe(str(path), "finds no .asf file beside or above it"))


@lru_cache(maxsize=16)
def _cached(path: Path, _changed: int) -> SmartBodySkeleton:
    """Folders of clips share their skeletons."""
    return read_sk(path)
