"""Files that appear whole or not at all."""

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from crowd.errors import SettingsError, describe


def require_folder(option: str, path: Path | None) -> None:
    """Refuse an output file that could not be written, before a long run begins.

    Raises
    ------
    SettingsError
        The folder is missing, or the path is a folder.
    """
    if path is None:
        return
    folder = path.absolute().parent
    if path.is_dir():
        raise SettingsError(describe(option, "is a folder", str(path), "the name of a file"))
    if not folder.is_dir():
        raise SettingsError(describe(option, "there is no such folder", str(folder), "an existing folder"))
    if not os.access(folder, os.W_OK):
        raise SettingsError(
            describe(option, "the folder cannot be written", str(folder), "a writable folder")
        )


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Write JSON under another name first, then give it its own.

    Raises
    ------
    SettingsError
        The file cannot be written; nothing is left of it.
    """
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        partial.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
        partial.replace(path)
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise SettingsError(describe(str(path), "cannot be written", error.strerror or str(error))) from error
