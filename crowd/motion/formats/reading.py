"""Find motion files and read them, whatever their format."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from crowd.errors import MotionError, describe
from crowd.motion.formats.acclaim import read_amc
from crowd.motion.formats.bvh import read_bvh
from crowd.motion.formats.companions import nearest_asf, smartbody_skeleton
from crowd.motion.formats.gltf import read_gltf
from crowd.motion.formats.smartbody import read_skm
from crowd.motion.formats.smartbody_binary import read_skmb
from crowd.motion.formats.smartbody_channels import make_motion
from crowd.motion.source import SourceMotion

EXTENSIONS = (".bvh", ".amc", ".skm", ".skmb", ".gltf", ".glb")
SKELETON_EXTENSIONS = (".asf", ".sk")


def find_motion_files(paths: Iterable[Path]) -> list[Path]:
    """List motion files: those named, and all in the folders named and below, sorted.

    Raises
    ------
    MotionError
        A path is missing, or has another extension; a folder holds no motion file.
    """
    found: dict[Path, None] = {}
    for path in paths:
        if path.is_dir():
            files = sorted(
                file for file in path.rglob("*") if file.suffix.lower() in EXTENSIONS and file.is_file()
            )
            if not files:
                raise MotionError(describe(str(path), "holds no motion file", allowed=", ".join(EXTENSIONS)))
            found.update(dict.fromkeys(files))
            continue
        if not path.exists():
            raise MotionError(describe(str(path), "there is no such file or folder"))
        _require_known(path)
        found.setdefault(path)
    return list(found)


def read_motions(
    path: Path, *, skeleton: Path | None = None, frame_rate: float | None = None
) -> tuple[SourceMotion, ...]:
    """Read all motions of a file in the names, units and axes of the file.

    Parameters
    ----------
    path : Path
        .bvh, .amc, .skm, .skmb, .gltf or .glb.
    skeleton : Path, optional
        Skeleton of .amc (.asf) and of .skm and .skmb (.sk); found beside or above the file when left out.
    frame_rate : float, optional
        Frames per second where the format states none: of .amc (120 when left out), and at which glTF and
        uneven .skm keys are sampled.

    Raises
    ------
    MotionError
        The file or its skeleton is broken, names file and line; or no skeleton fits.
    """
    match _require_known(path):
        case ".bvh":
            return (read_bvh(path),)
        case ".amc":
            return (read_amc(path, skeleton or nearest_asf(path), frame_rate),)
        case ".gltf" | ".glb":
            return read_gltf(path, frame_rate)
        case suffix:
            data = read_skm(path) if suffix == ".skm" else read_skmb(path)
            return (make_motion(data, smartbody_skeleton(data, skeleton), frame_rate),)


def _require_known(path: Path) -> str:
    """Extension of a motion file, in lower case."""
    suffix = path.suffix.lower()
    if suffix not in EXTENSIONS:
        what = "is a skeleton without motion" if suffix in SKELETON_EXTENSIONS else "is no motion file"
        raise MotionError(describe(str(path), what, path.suffix or "no extension", ", ".join(EXTENSIONS)))
    return suffix
