"""Feed broken motion files to the readers: every one must be read or refused with one line, soon.

Run as ``python -m benchmarks.fuzz_formats FOLDER --minutes 60``; the folder holds whole motion files.
"""

from __future__ import annotations

import argparse
import random
import shutil
import tempfile
import time
from collections import Counter
from pathlib import Path

from crowd.errors import MotionError
from crowd.motion.formats import read_motions
from crowd.motion.formats.companions import skeleton_files

SUFFIXES = (".bvh", ".amc", ".skm", ".skmb", ".gltf", ".glb")
SLOWEST = 10.0
"""A file that takes longer hangs, s of the processor: others may work beside."""
LARGEST = 300_000
"""Longer text files are cut first, so that many can be tried, bytes."""
NUMBERS = (
    b"nan",
    b"inf",
    b"-inf",
    b"1e999",
    b"10000000000",
    b"-1",
    b"0",
    b"",
    b"x",
    b"1e-320",
    b"\xff\xfe",
    b"9" * 30,
)


def broken(content: bytes, rng: random.Random) -> bytes:
    """Break a file in one to four ways."""
    data = bytearray(content)
    for _ in range(rng.randint(1, 4)):
        if not data:
            break
        at = rng.randrange(len(data))
        match rng.randrange(9):
            case 0:
                del data[at:]
            case 1:
                data[at] = rng.randrange(256)
            case 2:
                del data[at : at + rng.randint(1, 200)]
            case 3:
                data[at:at] = data[at : at + rng.randint(1, 400)]
            case 4:
                data[at:at] = rng.choice(NUMBERS)
            case 5:
                lines = bytes(data).split(b"\n")
                one, two = rng.randrange(len(lines)), rng.randrange(len(lines))
                lines[one], lines[two] = lines[two], lines[one]
                data = bytearray(b"\n".join(lines))
            case 6:
                lines = bytes(data).split(b"\n")
                del lines[rng.randrange(len(lines))]
                data = bytearray(b"\n".join(lines))
            case 7:
                words = bytes(data[at : at + 4000]).split(b" ")
                words[rng.randrange(len(words))] = rng.choice(NUMBERS)
                data[at : at + 4000] = b" ".join(words)
            case 8:
                data[at : at + 8] = rng.randbytes(8)
    return bytes(data)


def skeleton_of(path: Path) -> Path | None:
    """A skeleton file near a motion whose format keeps it apart."""
    suffix = {".amc": ".asf", ".skm": ".sk", ".skmb": ".sk"}.get(path.suffix.lower())
    near = [file for files in skeleton_files(path, suffix) for file in files] if suffix else []
    return near[0] if near else None


def outcome_of(target: Path, skeleton: Path | None) -> str:
    """Read a broken file: ``"read"``, ``"refused"``, or what is wrong with the refusal."""
    try:
        read_motions(target, skeleton=skeleton)
    except MotionError as error:
        message = str(error)
        is_fine = "broken" in message and "\n" not in message
        return "refused" if is_fine else f"bad message: {message}"
    return "read"


def keep(target: Path, skeleton: Path | None, result: str) -> None:
    """Keep the files of a failure, and say where they are."""
    folder = Path(tempfile.mkdtemp(prefix="fuzz_failure_"))
    for path in (target, skeleton):
        if path is not None:
            shutil.copy(path, folder)
    print(f"{folder}: {result}", flush=True)


def fuzz(sources: list[Path], seconds: float, seed: int) -> Counter[str]:
    """Break and read files for some time.

    Parameters
    ----------
    sources : list of Path
        Whole motion files.
    seconds : float
    seed : int

    Returns
    -------
    Counter
        Files by outcome; all but ``"read"`` and ``"refused"`` are defects of a reader.
    """
    rng = random.Random(seed)
    outcome: Counter[str] = Counter()
    skeletons = {path: skeleton_of(path) for path in sources}
    end = time.monotonic() + seconds
    with tempfile.TemporaryDirectory() as folder:
        while time.monotonic() < end:
            source = rng.choice(sources)
            skeleton = skeletons[source]
            target = Path(folder) / f"broken{source.suffix}"
            content = source.read_bytes()
            content = content if source.suffix in (".glb", ".gltf") else content[:LARGEST]
            if skeleton is not None and rng.random() < 0.3:
                target.write_bytes(content)
                bad = Path(folder) / f"broken{skeleton.suffix}"
                bad.write_bytes(broken(skeleton.read_bytes(), rng))
                skeleton = bad
            else:
                target.write_bytes(broken(content, rng))
            begin = time.process_time()
            try:
                result = outcome_of(target, skeleton)
            except Exception as error:
                result = f"{type(error).__name__}: {error}"
            if time.process_time() - begin > SLOWEST:
                result = f"took more than {SLOWEST:g} s"
            outcome[result] += 1
            if result not in ("read", "refused"):
                keep(target, skeleton, result)
    return outcome


def main() -> None:
    """Fuzz from the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--minutes", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    sources = sorted(path for path in arguments.folder.rglob("*") if path.suffix.lower() in SUFFIXES)
    print(f"{len(sources)} files, {arguments.minutes:g} minutes")
    print(dict(fuzz(sources, 60.0 * arguments.minutes, arguments.seed)))


if __name__ == "__main__":
    main()
