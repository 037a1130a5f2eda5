"""The table at the end of a run."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from crowd.cli.expectations import Verdict


def flat(values: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Go through nested tables as dotted keys."""
    for key, value in values.items():
        if isinstance(value, Mapping):
            yield from flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def shown(value: Any) -> str:
    """Form a value for people: four significant digits."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.4g}"
    return "-" if value is None else str(value)


def print_summary(measured: Mapping[str, Any], verdicts: Sequence[Verdict], files: Sequence[Path]) -> None:
    """Print all metrics beside what the scenario expects of them, and the files that were written."""
    by_key = {verdict.key: verdict for verdict in verdicts}
    table = Table(box=None, pad_edge=False)
    table.add_column("metric", no_wrap=True)
    table.add_column("value", justify="right", no_wrap=True)
    if verdicts:
        table.add_column("expected", no_wrap=True)
        table.add_column("", no_wrap=True)
    rows = dict(flat(measured)) | {verdict.key: None for verdict in verdicts if verdict.value is None}
    for key, value in rows.items():
        verdict = by_key.get(key)
        cells = [key, shown(value)]
        if verdict is not None:
            cells += [verdict.allowed, "[green]met[/]" if verdict.is_met else "[red]not met[/]"]
        table.add_row(*cells)
    console = Console()
    console.print(table)
    for path in files:
        console.print(f"wrote {path}", highlight=False, soft_wrap=True)
