"""``crowd motions``: import captured motion into a library, and show what a library holds."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from crowd.errors import SettingsError, describe

if TYPE_CHECKING:
    from rich.table import Table

    from crowd.motion.clip import Clip
    from crowd.motion.importing.example_set import Coverage
    from crowd.motion.importing.folder import ImportReport

LEAST_WIDTH = 170
"""Columns of a table, also where the terminal has fewer."""

Parameters = tuple[float, float, float]

app = typer.Typer(
    help="Import captured motion into a library, and show what a library holds.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


@app.command("import")
def import_(
    paths: Annotated[list[Path], typer.Argument(help="Files and folders: BVH, AMC, skm, skmb, glTF.")],
    out: Annotated[Path, typer.Option(help="Library to write.")],
    name: Annotated[str | None, typer.Option(help="Name of the library; that of the file.")] = None,
    skeleton: Annotated[Path | None, typer.Option(help="Skeleton file (.asf, .sk) of all clips.")] = None,
    joints: Annotated[Path | None, typer.Option(help="Mapping file: which joint is which (TOML).")] = None,
    units: Annotated[str | None, typer.Option(help="m, dm, cm, mm, inch, foot or acclaim.")] = None,
    up: Annotated[str | None, typer.Option(help="Up axis of the source, such as +z.")] = None,
    frame_rate: Annotated[float | None, typer.Option(help="Hz, where the format states none.")] = None,
    labels: Annotated[Path | None, typer.Option(help="Corrected labels (TOML).")] = None,
    write_labels: Annotated[Path | None, typer.Option(help="Write the labels that were found.")] = None,
    source: Annotated[str, typer.Option(help="Where the motion comes from.")] = "",
    licence: Annotated[Path | None, typer.Option(help="Licence text; those beside the files.")] = None,
    picture: Annotated[Path | None, typer.Option(help="Draw the parameter space.")] = None,
    fill: Annotated[bool, typer.Option(help="Fill gaps from the built-in library.")] = True,
    strict: Annotated[bool, typer.Option(help="Stop at the first file that cannot be used.")] = False,
) -> int:
    """Read motion files, find their labels, and write a library that crowds run on."""
    from rich.console import Console
    from rich.progress import Progress

    from crowd.cli.output import require_folder
    from crowd.motion.importing import labels as label_files
    from crowd.motion.importing.folder import Request, import_motions
    from crowd.motion.importing.importer import ImportSettings
    from crowd.motion.library_file import save_library

    for option, path in (("--out", out), ("--write-labels", write_labels), ("--picture", picture)):
        require_folder(option, path)
    if frame_rate is not None and not 1.0 <= frame_rate <= 1000.0:
        raise SettingsError(describe("--frame-rate", "is out of range", frame_rate, "1 to 1000 Hz"))
    request = Request(
        paths,
        name or out.stem,
        ImportSettings(units, up, joints),
        skeleton,
        frame_rate,
        labels,
        source,
        _text(licence),
        fill,
        strict,
    )
    with Progress(console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("importing", total=None)
        report = import_motions(
            request,
            lambda number, total, file: progress.update(
                task, completed=number, total=total, description=file
            ),
        )
    print_report(report)
    save_library(out, report.examples.library)
    print(f"wrote {out}")
    if write_labels is not None:
        label_files.write_labels(write_labels, report.imported)
        print(f"wrote {write_labels}")
    if picture is not None:
        _draw(report.examples.library, picture)
    return 0


@app.command()
def show(
    library: Annotated[Path, typer.Argument(help="Library made by `crowd motions import`.")],
    licence: Annotated[bool, typer.Option("--licence", help="Print the whole licence text.")] = False,
    picture: Annotated[Path | None, typer.Option(help="Draw the parameter space.")] = None,
) -> int:
    """Show clips, parameters, quality, coverage, source and licence of a library."""
    from crowd.cli.output import require_folder
    from crowd.motion.importing.example_set import coverage_of
    from crowd.motion.library_file import load_library

    require_folder("--picture", picture)
    loaded = load_library(library)
    print(f"{loaded.name}: {len(loaded.clips)} clips; source: {loaded.source}")
    print_clips(loaded.clips)
    print_coverage(coverage_of(loaded))
    lines = loaded.licence.splitlines() or ["none stated"]
    print("\nlicence:" if licence else "\nlicence (first lines; --licence prints all):")
    print("\n".join(lines if licence else [line for line in lines if line.strip()][:4]))
    if picture is not None:
        _draw(loaded, picture)
    return 0


def _text(path: Path | None) -> str:
    if path is None:
        return ""
    try:
        return path.read_text("utf-8", errors="replace")
    except OSError as error:
        raise SettingsError(describe("--licence", "cannot be read", str(path), error.strerror)) from error


def _draw(library: object, path: Path) -> None:
    from crowd.bench.coverage import draw_coverage
    from crowd.motion.library import MotionLibrary

    assert isinstance(library, MotionLibrary)
    draw_coverage(library, path)
    print(f"wrote {path}")


def print_report(report: ImportReport) -> None:
    """Print what an import found, by clip, and what it did about gaps."""
    conventions: dict[tuple[str, str], int] = {}
    for entry in report.imported:
        key = (entry.family, entry.convention)
        conventions[key] = conventions.get(key, 0) + 1
    for (family, convention), count in conventions.items():
        print(f"{count} clips: joints named like {family}; {convention}")
    mended = [(entry.clip.name, entry.popped) for entry in report.imported if entry.popped]
    for clip, frames in mended:
        print(f"{clip}: {frames} frames popped and were mended")
    captured = {entry.clip.name: entry.captured for entry in report.imported}
    print_clips([entry.clip for entry in report.imported], captured)
    for twin, kept in report.examples.duplicates:
        print(f"{twin}: same parameters as {kept}, left out of the examples")
    print_coverage(report.examples.coverage)
    for file, reason in report.unusable:
        print(f"not usable: {file}: {reason}")


def print_clips(
    clips: list[Clip] | tuple[Clip, ...], captured: Mapping[str, Parameters | None] | None = None
) -> None:
    """Print the table of clips: what they serve, parameters, quality.

    Parameters
    ----------
    clips : sequence of Clip
    captured : mapping, optional
        Forward m/s, turn rad/s and side m/s in the size of the source, by clip; a column more.
    """
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE, pad_edge=False)
    table.add_column("clip")
    table.add_column("serves")
    for heading in ("s", "forward m/s", "turn deg/s", "side m/s", "drift cm", "loop deg", "flight m/s2"):
        table.add_column(heading, justify="right")
    if captured is not None:
        table.add_column("as captured", justify="right")
    table.add_column("labels")
    for clip in clips:
        forward, turn, side = clip.parameters
        quality = clip.quality
        moves = clip.kind.value == "locomotion"
        table.add_row(
            clip.name,
            clip.kind.value,
            f"{clip.duration:.2f}",
            *((f"{forward:.3f}", f"{math.degrees(turn):.1f}", f"{side:.3f}") if moves else ("", "", "")),
            "" if quality is None else f"{100 * quality.stance_drift:.1f}",
            "" if quality is None or not moves else f"{math.degrees(quality.seam):.1f}",
            "" if quality is None or not quality.flight_gravity else f"{quality.flight_gravity:.1f}",
            *(() if captured is None else (_captured_in_words(captured.get(clip.name)),)),
            labels_in_words(clip),
        )
    print_wide(table)


def _captured_in_words(parameters: Parameters | None) -> str:
    if parameters is None:
        return ""
    forward, turn, side = parameters
    return f"{forward:.3f} m/s, {math.degrees(turn):.1f} deg/s, {side:.3f} m/s"


def print_wide(table: Table) -> None:
    """Print a table without folding its cells: names and figures are copied from it."""
    from rich.console import Console

    for column in table.columns:
        column.no_wrap = True
    console = Console()
    Console(width=max(console.width, LEAST_WIDTH)).print(table)


def labels_in_words(clip: Clip) -> str:
    """Labels of a clip in a few words: events, jump, reach."""
    if clip.jump is not None:
        jump = clip.jump
        air = f"{jump.take_off:.2f}-{jump.landing:.2f} s"
        return f"in the air {air}, {jump.length:.2f} m, rise {jump.rise:.2f} m"
    if clip.reach is not None:
        left, up, ahead = clip.reach.hand_position
        place = f"{left:+.2f} left, {up:.2f} up, {ahead:+.2f} ahead"
        return f"{clip.reach.side} hand at {clip.reach.apex:.2f} s: {place}"
    strikes = [
        f"{event.name[0]}{time:.2f}" for time, event in clip.foot_events if event.name in ("RHS", "LHS")
    ]
    return "strikes " + " ".join(strikes) if strikes else clip.source


def print_coverage(coverage: tuple[Coverage, ...]) -> None:
    """Print what the examples cover and where they come from."""
    from rich import box
    from rich.table import Table

    table = Table("a crowd needs", "comes from", "examples", box=box.SIMPLE, pad_edge=False)
    for entry in coverage:
        table.add_row(entry.need, entry.origin, ", ".join(entry.clips))
    print_wide(table)
