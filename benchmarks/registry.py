"""All benchmark cases: every ``cases_*.py`` beside this file lists its own in ``CASES``."""

from importlib import import_module
from pathlib import Path

from benchmarks.case import Case


def all_cases() -> list[Case]:
    """Cases in the order of their files."""
    names = sorted(path.stem for path in Path(__file__).parent.glob("cases_*.py"))
    return [case for name in names for case in import_module(f"benchmarks.{name}").CASES]
