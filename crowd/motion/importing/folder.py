"""Import many files at once: find them, read them, make clips, gather licences, assemble a library."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from crowd.errors import MotionError, describe
from crowd.motion.body import build_skeleton
from crowd.motion.formats import find_motion_files, read_motions
from crowd.motion.importing.example_set import ExampleSet, assemble
from crowd.motion.importing.importer import Imported, ImportSettings, import_clip
from crowd.motion.importing.labels import FILE_NAME, Correction, check_names, read_labels
from crowd.motion.library import MotionLibrary
from crowd.motion.library_file import load_library

LICENCE_PATTERNS = ("LICENSE*", "LICENCE*", "COPYING*", "NOTICE*", "license*", "licence*")
FOLDERS_UP = 2
"""Licence texts are looked for beside the files and this many folders above."""
NO_LICENCE = "No licence text was found beside the files; state one with --licence."


@dataclass(frozen=True)
class ImportReport:
    """What an import found.

    Attributes
    ----------
    imported : tuple of Imported
        Usable clips, by file.
    unusable : tuple of (str, str)
        Files or clips that could not be used, with the reason.
    examples : ExampleSet
    """

    imported: tuple[Imported, ...]
    unusable: tuple[tuple[str, str], ...]
    examples: ExampleSet


@dataclass(frozen=True)
class Request:
    """What to import.

    Attributes
    ----------
    paths : sequence of Path
        Files and folders.
    name : str
        Of the library.
    settings : ImportSettings
    skeleton : Path or None
        Skeleton file for formats that keep it apart.
    frame_rate : float or None
        For formats that do not state it, Hz.
    labels : Path or None
        File of labels; those found beside the clips when None.
    source, licence : str
        Instead of what is found.
    fills : bool
        Whether gaps are filled from the built-in library.
    stops_at_unusable : bool
        Raise instead of leaving a file out.
    """

    paths: Sequence[Path]
    name: str
    settings: ImportSettings = field(default_factory=ImportSettings)
    skeleton: Path | None = None
    frame_rate: float | None = None
    labels: Path | None = None
    source: str = ""
    licence: str = ""
    fills: bool = True
    stops_at_unusable: bool = False


def import_motions(request: Request, on_file: Callable[[int, int, str], None] | None = None) -> ImportReport:
    """Import files and folders.

    Parameters
    ----------
    request : Request
    on_file : callable, optional
        Called before each file with its number, how many there are, and its name.

    Raises
    ------
    MotionError
        Nothing usable is found, or `Request.stops_at_unusable` and something is not usable.
    """
    files = find_motion_files(request.paths)
    labels: Mapping[str, Correction] = {} if request.labels is None else read_labels(request.labels)
    skeleton = build_skeleton()
    imported: list[Imported] = []
    unusable: list[tuple[str, str]] = []
    unmirrored: set[str] = set()
    left_out: set[str] = set()
    names: set[str] = set()
    told: dict[Path, Mapping[str, Correction]] = {}
    for number, file in enumerate(files):
        if on_file is not None:
            on_file(number, len(files), file.name)
        beside = (
            told.setdefault(file.parent, _labels_beside(file.parent)) if request.labels is None else labels
        )
        try:
            motions = read_motions(file, skeleton=request.skeleton, frame_rate=request.frame_rate)
            for motion in motions:
                named = replace(motion, name=_unique(motion.name, file, names))
                names.add(named.name)
                correction = beside.get(named.name, Correction())
                if not correction.use:
                    left_out.add(named.name)
                    continue
                imported.append(import_clip(named, skeleton, request.settings, correction))
                if not correction.mirror:
                    unmirrored.add(named.name)
        except MotionError as error:
            if request.stops_at_unusable:
                raise
            unusable.append((file.name, str(error)))
    if request.labels is not None:
        check_names(request.labels, labels, names)
    if not imported:
        first = f"; first: {unusable[0][1]}" if unusable else ""
        where = ", ".join(str(path) for path in request.paths)
        raise MotionError(describe(where, f"no usable motion in {len(files)} files{first}"))
    source = request.source or ", ".join(str(path) for path in request.paths)
    licence = request.licence or licence_texts(files)
    clips = [entry.clip for entry in imported]
    examples = assemble(clips, request.name, source, licence, unmirrored, request.fills)
    return ImportReport(tuple(imported), tuple(unusable), examples)


def load_or_import(path: Path) -> MotionLibrary:
    """Load a library, or import a folder of motion files, with the labels beside them.

    Raises
    ------
    MotionError
        It is neither.
    """
    if path.is_dir():
        return import_motions(Request([path], path.name)).examples.library
    return load_library(path)


def _labels_beside(folder: Path) -> Mapping[str, Correction]:
    path = folder / FILE_NAME
    return read_labels(path) if path.is_file() else {}


def _unique(name: str, file: Path, taken: set[str]) -> str:
    """A clip name that is not taken: the format, then a number is added."""
    if name not in taken:
        return name
    name = f"{name}_{file.suffix.lstrip('.')}"
    number, unique = 2, name
    while unique in taken:
        unique, number = f"{name}_{number}", number + 1
    return unique


def licence_texts(files: Sequence[Path]) -> str:
    """Texts of all licence files beside the given files and above them."""
    folders: dict[Path, None] = {}
    for file in files:
        for folder in [file.absolute().parent, *file.absolute().parents[1 : FOLDERS_UP + 1]]:
            folders.setdefault(folder)
    found: dict[Path, str] = {}
    for folder in folders:
        for pattern in LICENCE_PATTERNS:
            for path in sorted(folder.glob(pattern)):
                if path.is_file() and path.suffix.lower() in ("", ".txt", ".md"):
                    found.setdefault(path, path.read_text("utf-8", errors="replace"))
    if not found:
        return NO_LICENCE
    return "\n\n".join(f"===== {path.name} =====\n{text.strip()}\n" for path, text in found.items())
