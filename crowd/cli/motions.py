"""``crowd motions``: import captured motion into a library, and show what a library holds."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from crowd.errors import SettingsError, describe

if TYPE_CHECKING:
    from crowd.motion.clip import Clip
    from crowd.motion.importing.example_set import Coverage
    from crowd.motion.importing.folder import ImportReport
    from crowd.motion.library import Calibration, MotionLibrary

MOST_NAMES = 6
"""Examples of a need that are listed by name."""
CALIBRATION_POINTS = 120

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
    calibrate: Annotated[bool, typer.Option(help="Measure realised against asked motion.")] = True,
    strict: Annotated[bool, typer.Option(help="Stop at the first file that cannot be used.")] = False,
) -> int:
    """Read motion files, find their labels, and write a library that crowds run on."""
    from rich.console import Console
    from rich.progress import Progress

    from crowd.bench.plot import require_matplotlib
    from crowd.cli.output import require_folder
    from crowd.motion.importing import labels as label_files
    from crowd.motion.importing.folder import Request, import_motions
    from crowd.motion.importing.importer import ImportSettings
    from crowd.motion.library_file import save_library

    for option, path in (("--out", out), ("--write-labels", write_labels), ("--picture", picture)):
        require_folder(option, path)
    if picture is not None:
        require_matplotlib("--picture")
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
    library = report.examples.library
    if calibrate:
        with Console(stderr=True).status("measuring realised against asked motion"):
            library = calibrated(library)
        print_calibration(library.calibration)
    save_library(out, library)
    print(f"wrote {out}")
    if write_labels is not None:
        label_files.write_labels(write_labels, report.imported)
        print(f"wrote {write_labels}")
    if picture is not None:
        _draw(library, picture)
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
    print_calibration(loaded.calibration)
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
    for entry in report.imported:
        if entry.in_place:
            print(
                f"{entry.clip.name}: in place; the ground glides under its feet at {entry.in_place:.2f} m/s"
            )
    captured = {entry.clip.name: entry.captured for entry in report.imported}
    print_clips([entry.clip for entry in report.imported], captured)
    twins: dict[str, list[str]] = {}
    for twin, kept in report.examples.duplicates:
        twins.setdefault(kept, []).append(twin)
    for kept, others in twins.items():
        print(f"left out, since {kept} says the same: {', '.join(others)}")
    print_coverage(report.examples.coverage)
    for file, reason in report.unusable:
        print(f"not usable: {file}: {reason}")


def calibrated(library: MotionLibrary) -> MotionLibrary:
    """Measure what a crowd on a library realises of what it is asked, and keep that in the library."""
    from dataclasses import replace

    from crowd.bench.sweep import sweep
    from crowd.motion.library import Calibration

    found = sweep(CALIBRATION_POINTS, library)
    measured = Calibration(
        found.points,
        found.speed_rms_relative,
        found.turn_rms_deg_s,
        found.drift_mean_m,
        found.drift_p95_m,
    )
    return replace(library, calibration=measured)


def print_calibration(found: Calibration | None) -> None:
    """Print how well what is asked is realised."""
    if found is None:
        print("realised against asked motion: not measured")
        return
    print(
        f"realised against asked motion at {found.points} points of the locomotion space: speed "
        f"{100 * found.speed_rms_relative:.2f} % rms, turn {found.turn_rms_deg_s:.3f} deg/s rms, "
        f"planted feet drift {1000 * found.drift_mean_m:.2f} mm in the mean, "
        f"{1000 * found.drift_p95_m:.2f} mm at 95 %"
    )


def print_clips(clips: Sequence[Clip], captured: Mapping[str, Parameters | None] | None = None) -> None:
    """Print tables of clips, one for each kind: parameters, labels, quality.

    Parameters
    ----------
    clips : sequence of Clip
    captured : mapping, optional
        Forward m/s, turn rad/s and side m/s in the size of the source, by clip; columns more.
    """
    gaits = [clip for clip in clips if clip.kind.value == "locomotion"]
    jumps = [clip for clip in clips if clip.jump is not None]
    reaches = [clip for clip in clips if clip.reach is not None]
    shown = {id(clip) for clip in (*gaits, *jumps, *reaches)}
    others = [clip for clip in clips if id(clip) not in shown]
    moves = ("forward m/s", "turn deg/s", "side m/s")
    asked = {name: _moves(values) for name, values in (captured or {}).items() if values is not None}
    sources = () if captured is None else tuple(f"captured {move}" for move in moves)
    _print_rows(
        ("locomotion", "s", *moves, *sources, "drift cm", "loop deg", "strikes"),
        [
            (
                *_name_and_length(clip),
                *_moves(clip.parameters),
                *(() if captured is None else asked.get(clip.name, ("", "", ""))),
                _drift(clip),
                "" if clip.quality is None else f"{math.degrees(clip.quality.seam):.1f}",
                _strikes(clip),
            )
            for clip in gaits
        ],
    )
    air = ("take-off s", "apex s", "landing s", "length m", "in flight m", "rise m", "direction deg")
    _print_rows(
        ("jump", "s", *air, "flight m/s2", "drift cm"),
        [
            (
                *_name_and_length(clip),
                *(f"{value:.2f}" for value in (jump.take_off, jump.apex, jump.landing)),
                *(f"{value:.2f}" for value in (jump.length, jump.flight_length, jump.rise)),
                f"{math.degrees(jump.direction):.0f}",
                "" if clip.quality is None else f"{clip.quality.flight_gravity:.1f}",
                _drift(clip),
            )
            for clip in jumps
            if (jump := clip.jump) is not None
        ],
    )
    _print_rows(
        ("reach", "s", "hand", "apex s", "left m", "up m", "ahead m"),
        [
            (
                *_name_and_length(clip),
                clip.reach.side,
                f"{clip.reach.apex:.2f}",
                *(f"{value:+.2f}" for value in clip.reach.hand_position),
            )
            for clip in reaches
            if clip.reach is not None
        ],
    )
    _print_rows(
        ("other clip", "s", "serves", "drift cm", "strikes"),
        [(*_name_and_length(clip), clip.kind.value, _drift(clip), _strikes(clip)) for clip in others],
    )


def _name_and_length(clip: Clip) -> tuple[str, str]:
    return clip.name, f"{clip.duration:.2f}"


def _moves(parameters: Parameters) -> tuple[str, str, str]:
    # Adding 0 takes the sign of a mirrored zero away.
    forward, turn, side = (value + 0.0 for value in parameters)
    return f"{forward:.3f}", f"{math.degrees(turn):.1f}", f"{side:.3f}"


def _drift(clip: Clip) -> str:
    return "" if clip.quality is None else f"{100 * clip.quality.stance_drift:.1f}"


def _strikes(clip: Clip) -> str:
    return " ".join(
        f"{event.name[0]}{time:.2f}" for time, event in clip.foot_events if event.name in ("RHS", "LHS")
    )


def _print_rows(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table without cutting its cells, which are copied from it; nothing where there are no rows."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    if not rows:
        return
    table = Table(box=box.SIMPLE, pad_edge=False)
    for number, heading in enumerate(headings):
        is_text = number == 0 or not _is_number(next((row[number] for row in rows if row[number]), "-"))
        table.add_column(heading, justify="left" if is_text else "right", no_wrap=True)
    for row in rows:
        table.add_row(*row)
    needed = Console(width=10_000).measure(table).maximum
    Console(width=needed).print(table)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def print_coverage(coverage: tuple[Coverage, ...]) -> None:
    """Print what the examples cover and where they come from."""
    rows = []
    for entry in coverage:
        named = ", ".join(entry.clips[:MOST_NAMES])
        more = len(entry.clips) - MOST_NAMES
        rows.append((entry.need, entry.origin, f"{named} and {more} more" if more > 0 else named))
    _print_rows(("a crowd needs", "comes from", "examples"), rows)
