"""Readers of motion files on 60 joints, with pybvh beside them where it is installed."""

import atexit
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from benchmarks.case import Case
from crowd.motion.formats import read_motions
from crowd.motion.source import SourceMotion

JOINTS = 60
BOUND_US = 50.0
"""A thousand frames take 50 ms."""


@dataclass
class File:
    """A file to read, and what was read last."""

    path: Path
    frame_count: int
    motion: SourceMotion | None = None


def bvh(frames: int, rng: np.random.Generator) -> dict[str, str]:
    """A chain of joints with Euler angles."""
    joint = "JOINT j{}\n{{\nOFFSET 0 1 0\nCHANNELS 3 Zrotation Yrotation Xrotation\n"
    chain = "".join(joint.format(number) for number in range(JOINTS)).replace("JOINT", "ROOT", 1)
    chain = chain.replace("CHANNELS 3", "CHANNELS 6 Xposition Yposition Zposition", 1)
    chain += "End Site\n{\nOFFSET 0 1 0\n}\n" + "}\n" * JOINTS
    values = rng.normal(0, 50, (frames, 3 + 3 * JOINTS))
    rows = "\n".join(" ".join(f"{value:.4f}" for value in row) for row in values)
    return {".bvh": f"HIERARCHY\n{chain}MOTION\nFrames: {frames}\nFrame Time: 0.0083333\n{rows}\n"}


def acclaim(frames: int, rng: np.random.Generator) -> dict[str, str]:
    """A chain of bones, each with a line in each frame."""
    bone = "begin\nname j{}\ndirection 0 1 0\nlength 2\naxis 0 0 20 XYZ\ndof rx ry rz\nend\n"
    bones = "".join(bone.format(number) for number in range(1, JOINTS))
    links = "root j1\n" + "".join(f"j{number} j{number + 1}\n" for number in range(1, JOINTS - 1))
    root = ":root\norder TX TY TZ RX RY RZ\naxis XYZ\nposition 0 0 0\norientation 0 0 0\n"
    lines = [":FULLY-SPECIFIED", ":DEGREES"]
    for frame in range(frames):
        lines += [str(frame + 1), "root 0 0 0 0 0 0"]
        angles = rng.normal(0, 50, (JOINTS, 3))
        lines += [f"j{number} {x:.4f} {y:.4f} {z:.4f}" for number, (x, y, z) in enumerate(angles) if number]
    asf = f":units\nlength 0.45\nangle deg\n{root}:bonedata\n{bones}:hierarchy\nbegin\n{links}end\n"
    return {".asf": asf, ".amc": "\n".join(lines) + "\n"}


def smartbody(frames: int, rng: np.random.Generator) -> dict[str, str]:
    """A chain of joints with rotation vectors."""
    joint = "joint j{} {{ offset 0 1 0 prerot axis 0 1 0 ang 3 channel Quat\n"
    chain = "".join(joint.format(number) for number in range(JOINTS)).replace("joint", "root", 1)
    channels = "".join(f"j{number} Quat\n" for number in range(JOINTS))
    rows = "\n".join(
        f"kt {frame / 30:.6f} fr " + " ".join(f"{value:.6f}" for value in row)
        for frame, row in enumerate(rng.normal(0, 1, (frames, 3 * JOINTS)))
    )
    skm = f"SkMotion\nchannels {JOINTS}\n{channels}frames {frames}\n{rows}\n"
    return {".sk": f"skeleton\n{chain}{'}' * JOINTS}\nend\n", ".skm": skm}


def set_up(write: Callable[[int, np.random.Generator], dict[str, str]]) -> Callable[..., File]:
    """Write a motion and its skeleton, to be removed at the end."""

    def make(frames: int, rng: np.random.Generator) -> File:
        folder = Path(tempfile.mkdtemp(prefix="crowd_formats_"))
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
        for suffix, text in write(frames, rng).items():
            path = folder / f"clip{suffix}"
            path.write_text(text)
        return File(path, frames)

    return make


def read(file: File) -> None:
    """Read the file."""
    file.motion = read_motions(file.path)[0]


def read_with_pybvh(file: File) -> None:
    """Read the file with pybvh, which keeps Euler angles."""
    import_module("pybvh").read_bvh_file(str(file.path))


def check(file: File) -> str | None:
    """All frames of all joints are there, as rotations."""
    motion = file.motion
    if motion is None or motion.frame_count != file.frame_count:
        return "frames are missing"
    if int(motion.skeleton.is_animated.sum()) != JOINTS:
        return "joints are missing"
    error = float(np.abs(np.linalg.norm(motion.rotation_local, axis=-1) - 1.0).max())
    return None if error < 1e-9 else f"a rotation has length 1 + {error:.2g}"


PEERS = {"pybvh": read_with_pybvh} if find_spec("pybvh") else {}

CASES = [
    Case("read bvh", (1000,), set_up(bvh), read, check, peers=PEERS, bound_us=BOUND_US),
    Case("read amc", (1000,), set_up(acclaim), read, check, bound_us=BOUND_US),
    Case("read skm", (1000,), set_up(smartbody), read, check, bound_us=BOUND_US),
]
