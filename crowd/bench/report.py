"""Tables, JSON and comparison of benchmark results."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from crowd.errors import SettingsError, describe

REGRESSION = 1.10
"""A frame that takes this many times as long as before is reported."""


def read_results(path: Path) -> list[dict[str, Any]]:
    """Read an earlier ``--json`` file.

    Raises
    ------
    SettingsError
        It cannot be read, or holds something else.
    """
    try:
        rows = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise SettingsError(describe(str(path), "cannot be read", error.strerror)) from error
    except ValueError as error:
        raise SettingsError(describe(str(path), "is not JSON", str(error))) from error
    wanted = {"case", "characters", "threads", "fps"}
    if not isinstance(rows, list) or not all(isinstance(row, dict) and wanted <= row.keys() for row in rows):
        raise SettingsError(
            describe(str(path), "holds no benchmark results", allowed="a file of crowd bench --json")
        )
    return rows


def write_results(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write results as JSON; the file appears whole or not at all."""
    partial = path.with_name(path.name + ".partial")
    try:
        partial.write_text(json.dumps(list(rows), indent=1) + "\n", encoding="utf-8")
        partial.replace(path)
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise SettingsError(describe(str(path), "cannot be written", error.strerror)) from error


def print_frames(rows: Sequence[Mapping[str, Any]], earlier: Sequence[Mapping[str, Any]] = ()) -> list[str]:
    """Print the table of frames per second; returns one line for each regression against earlier results."""
    before = {(row["case"], row["characters"], row["threads"]): row for row in earlier}
    stages = list(rows[0]["stages"]) if rows else []
    table = Table(box=None, pad_edge=False)
    for title in ("scene", "people", "threads", "fps", "us/person", *stages, "MB", "ok"):
        table.add_column(title, justify="left" if title == "scene" else "right", no_wrap=True)
    if earlier:
        table.add_column("times", justify="right")
    regressions = []
    for row in rows:
        cells = [row["case"], f"{row['characters']:,}", str(row["threads"]), f"{row['fps']:,.0f}"]
        cells.append(f"{row['us_per_character']:.2f}")
        cells += [f"{row['stages'][stage]:.2f}" for stage in stages]
        cells += [f"{row['peak_memory_mb']:.0f}", "yes" if row["ok"] else f"[red]{row['problem']}[/]"]
        old = before.get((row["case"], row["characters"], row["threads"]))
        if earlier:
            ratio = old["fps"] / row["fps"] if old else None
            cells.append(f"{ratio:.2f}" if ratio else "-")
            if ratio and ratio > REGRESSION:
                regressions.append(
                    f"{row['case']} with {row['characters']} people takes {ratio:.2f} times as long as before"
                )
        table.add_row(*cells)
    console = Console(width=max(Console().width, 150))
    console.print(table)
    return regressions


# Feng, Xu, Shapiro, table 2, milliseconds per character and update.
PAPER_MILLISECONDS = {
    "locomotion": 0.21,
    "steering": 0.70,
    "reach (blending)": 0.42,
    "reach (inverse kinematics)": 0.28,
    "gaze": 0.07,
    "total": 1.68,
}
CONTROLLERS = ("Reach (blending)", "Reach (inverse kinematics)", "Grab", "Gaze", "Constraint")


def print_controllers(row: Mapping[str, Any]) -> None:
    """Print one row as the paper's table 2: each controller beside the paper's own time."""
    stages, layers = row["stages"], row["layers"]
    parts = {
        "locomotion": stages["locomote"] + layers["Locomotion"],
        "steering": stages["navigate"] + stages["steer"],
    }
    parts |= {name.lower(): layers[name] for name in CONTROLLERS}
    parts["total"] = row["us_per_character"]
    table = Table(box=None, pad_edge=False)
    for title in ("controller", "us/person", "paper, us", "times"):
        table.add_column(title, justify="left" if title == "controller" else "right")
    for name, microseconds in parts.items():
        paper = PAPER_MILLISECONDS.get(name)
        cells = ("-", "-") if paper is None else (f"{1e3 * paper:,.0f}", f"{1e3 * paper / microseconds:,.0f}")
        table.add_row(name, f"{microseconds:.2f}", *cells)
    Console().print(f"{row['case']}, {row['characters']:,} people, {row['threads']} threads", highlight=False)
    Console().print(table)
