"""Files of an export appear whole or not at all."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from crowd.errors import RecordingError, describe


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give a name to write to; it becomes `path` when the block ends well, and is removed otherwise.

    Raises
    ------
    RecordingError
        The file cannot be written, or `path` is a folder.
    """
    if path.is_dir():
        raise RecordingError(describe(str(path), "is a folder", allowed="the name of a file"))
    unfinished = path.with_name(f".part_{path.name}")
    try:
        yield unfinished
        unfinished.replace(path)
    except OSError as error:
        raise RecordingError(
            describe(str(path), "cannot be written", error.strerror or str(error))
        ) from error
    finally:
        unfinished.unlink(missing_ok=True)


@contextmanager
def whole_folder(path: Path) -> Iterator[Path]:
    """Give a folder to write to; its files move to `path` when the block ends well.

    Raises
    ------
    RecordingError
        The folder cannot be written, or `path` is a file.
    """
    if path.exists() and not path.is_dir():
        raise RecordingError(describe(str(path), "is a file", allowed="a folder: there is one file a person"))
    # A folder that is there already need not have a name: "." and "/" have none.
    unfinished = (path if path.is_dir() else path.parent) / f".part_{path.name}"
    try:
        shutil.rmtree(unfinished, ignore_errors=True)
        unfinished.mkdir(parents=True)
        yield unfinished
        path.mkdir(exist_ok=True)
        for file in sorted(unfinished.iterdir()):
            target = path / file.name
            if target.is_dir():
                shutil.rmtree(target)
            file.replace(target)
    except OSError as error:
        raise RecordingError(
            describe(str(path), "cannot be written", error.strerror or str(error))
        ) from error
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)
