"""``crowd bench``: the command line of the benchmarks."""

import math
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from crowd.errors import SettingsError, describe, nearest_first

app = typer.Typer(
    help="Measure frames per second against the number of characters, quality, kernels, SteerBench.",
    no_args_is_help=False,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)
EXIT_FAILED = 1
Threads = Annotated[int | None, typer.Option(min=1, help="Threads; all cores when left out.")]


@app.callback(invoke_without_command=True)
def frames(
    context: typer.Context,
    scenes: Annotated[str, typer.Option(help="Scenes, separated by commas.")] = "",
    characters: Annotated[str, typer.Option(help="Numbers of people, separated by commas.")] = "",
    seconds: Annotated[float, typer.Option(min=0.1, help="Simulated time of each row, s.")] = 2.0,
    threads: Threads = None,
    json: Annotated[Path | None, typer.Option(help="Write the results.")] = None,
    compare: Annotated[Path | None, typer.Option(help="Compare with an earlier --json file.")] = None,
    plot: Annotated[Path | None, typer.Option(help="Draw frames per second against people.")] = None,
) -> int:
    """Frames per second of standing and walking crowds, by stage of the frame."""
    if context.invoked_subcommand is not None:
        return 0
    from crowd.bench.frames import SCENES, SIZES, compile_kernels, measure_frames
    from crowd.bench.machine import describe_machine
    from crowd.bench.plot import draw, require_matplotlib
    from crowd.bench.report import print_controllers, print_frames, read_results, write_results

    chosen = choose_scenes(scenes, SCENES)
    sizes = choose_sizes(characters) or list(SIZES)
    earlier = read_results(compare) if compare is not None else []
    if plot is not None:
        require_matplotlib("--plot")
    console = Console(stderr=True)
    machine = describe_machine()
    with console.status("compiling kernels (first run only)"):
        compile_seconds = compile_kernels(threads)
    results = []
    for scene in chosen:
        for size in sizes:
            with console.status(f"{scene}, {size} people"):
                results.append(measure_frames(scene, size, threads, seconds))
    rows = [result.as_dict() | {"compile_seconds": compile_seconds, "machine": machine} for result in results]
    print(", ".join(f"{key} {value}" for key, value in machine.items()))
    print(f"kernels ready after {compile_seconds:.1f} s; stages in us per person and frame")
    regressions = print_frames(rows, earlier)
    for row in rows:
        if row["case"] == "everything":
            print_controllers(row)
    if json is not None:
        write_results(json, rows)
    if plot is not None:
        draw(rows, machine, plot)
    for line in regressions:
        print(line)
    return EXIT_FAILED if regressions or not all(result.ok for result in results) else 0


@app.command()
def drawing(
    characters: Annotated[str, typer.Option(help="Numbers of people, separated by commas.")] = "",
    json: Annotated[Path | None, typer.Option(help="Write the results.")] = None,
) -> int:
    """Pictures per second of crowds without a screen: limbs alone, a window's quality, and the best."""
    from crowd.bench.drawing import SIZES, measure_drawing, qualities, renderer_name
    from crowd.bench.machine import describe_machine
    from crowd.bench.report import write_results

    machine = describe_machine() | {"renderer": renderer_name()}
    sizes = choose_sizes(characters) or list(SIZES)
    table = Table(box=None, pad_edge=False)
    for title in ("quality", "people", "fps", "prepare us/person", "MB", "by level", "ok"):
        table.add_column(title, justify="left" if title == "quality" else "right", no_wrap=True)
    results = []
    for case in qualities():
        for size in sizes:
            with Console(stderr=True).status(f"{case}, {size} people"):
                results.append(measure_drawing(case, size))
            row = results[-1]
            table.add_row(
                row.case,
                f"{size:,}",
                f"{row.fps:,.1f}",
                f"{row.prepare_us_per_character:.2f}",
                f"{row.upload_mb:.2f}",
                " ".join(map(str, row.levels)),
                "yes" if row.ok else f"[red]{row.problem}[/]",
            )
    print(", ".join(f"{key} {value}" for key, value in machine.items()))
    Console(width=120).print(table)
    if json is not None:
        write_results(json, [result.as_dict() | {"machine": machine} for result in results])
    return 0 if all(result.ok for result in results) else EXIT_FAILED


@app.command()
def kernels(
    only: Annotated[str, typer.Option(help="Run cases whose name contains this.")] = "",
) -> int:
    """Time every kernel on one thread, check its answer, and time peers beside it."""
    try:
        from benchmarks.case import measure
        from benchmarks.registry import all_cases
    except ImportError as error:
        raise SettingsError(
            describe("crowd bench kernels", "needs the benchmarks folder", allowed="the root of a checkout")
        ) from error
    table = Table(box=None, pad_edge=False)
    for title in ("case", "size", "us/item", "peers (times)", "compile s", "ok"):
        table.add_column(title, justify="left" if title in ("case", "peers (times)") else "right")
    is_ok = True
    for case in all_cases():
        if only not in case.name:
            continue
        for size in case.sizes:
            result = measure(case, size)
            is_ok &= result.is_ok
            peers = ", ".join(
                f"{name} {us:.3f} ({us / result.us_per_item:.2f})" for name, us in result.peers.items()
            )
            table.add_row(
                result.case,
                f"{size:,}",
                f"{result.us_per_item:.3f}",
                peers,
                f"{result.compile_seconds:.1f}",
                "yes" if result.is_ok else f"[red]{result.problem}[/]",
            )
    Console(width=max(Console().width, 150)).print(table)
    return 0 if is_ok else EXIT_FAILED


@app.command()
def sweep(
    points: Annotated[int, typer.Option(min=50, help="Points of the locomotion space.")] = 300,
    motions: Annotated[
        Path | None, typer.Option(help="Motion library made by `crowd motions import`, or a folder.")
    ] = None,
) -> int:
    """Realised against commanded motion over the locomotion space, and joint pops at changes of motion."""
    from crowd.bench.sweep import sweep as run_sweep
    from crowd.bench.sweep import transitions
    from crowd.motion.importing.folder import load_or_import

    library = None if motions is None else load_or_import(motions)
    result = run_sweep(points, library)
    print(f"points {result.points}, stances {result.stances}")
    print(f"speed rms relative    {result.speed_rms_relative:.5f}")
    print(f"turn rms deg/s        {result.turn_rms_deg_s:.4f}")
    print(f"stance drift mean m   {result.drift_mean_m:.6f}")
    print(f"stance drift 95 % m   {result.drift_p95_m:.6f}")
    print(f"stance drift max m    {result.drift_max_m:.6f}")
    print(f"largest weight jump   {result.largest_weight_jump:.2e}")
    changes = transitions(library)
    print(f"largest joint acceleration of the examples: {changes.examples:.0f} rad/s^2")
    for name, value in changes.manoeuvres.items():
        print(f"  {name:24s} {value:6.0f} rad/s^2, {value / changes.examples:.2f} times")
    problems = result.problems + changes.problems
    for problem in problems:
        print(f"outside its bound: {problem}")
    return EXIT_FAILED if problems else 0


@app.command()
def reach(
    targets: Annotated[int, typer.Option(min=1, help="Targets in reach of each hand.")] = 10_000,
    far: Annotated[int, typer.Option(min=0, help="Targets out of reach of each hand.")] = 2_000,
    seed: Annotated[int, typer.Option(help="Key of all random choices.")] = 0,
) -> int:
    """Reach for random targets: how many are met, how exactly, how smoothly, what is reported."""
    from crowd.bench.reach import measure

    table = Table(box=None, pad_edge=False)
    for title in (
        "targets of the",
        "number",
        "met",
        "reported",
        "mm",
        "deg",
        "rad/s2",
        "times examples",
        "rad/s",
        "jitter mm",
        "beyond deg",
        "ok",
    ):
        table.add_column(title, justify="left" if title == "targets of the" else "right")
    results = measure(targets, far, seed)
    for row in results:
        table.add_row(
            row.name,
            f"{row.targets:,}",
            f"{row.reached:,}",
            f"{row.reported:,}",
            f"{1000.0 * row.error:.3f}",
            f"{math.degrees(row.angle):.3f}",
            f"{row.acceleration:.1f}",
            f"{row.acceleration_ratio:.2f}",
            f"{row.speed:.1f}",
            f"{1000.0 * row.jitter:.4f}",
            f"{math.degrees(row.beyond):.3f}",
            f"[red]{row.problem}[/]" if row.problem else "yes",
        )
    Console(width=150).print(table)
    return 0 if all(not row.problem for row in results) else EXIT_FAILED


@app.command()
def steerbench(
    folder: Annotated[Path, typer.Argument(help="Folder of SteerBench .xml files, or one file.")],
    only: Annotated[str, typer.Option(help="Run files whose name contains this.")] = "",
    threads: Threads = None,
) -> int:
    """Run SteerBench files with whole people and with plain discs, and print both scores."""
    from crowd.bench.steerbench import COLUMNS, find_files, row, run_file

    results = []
    print(COLUMNS)
    for path in find_files(folder):
        if only not in path.stem:
            continue
        for bodies in ("people", "discs"):
            results.append(run_file(path, bodies, threads))
            print(row(results[-1]), flush=True)
    return 0 if all(not result.problem for result in results if result.bodies == "people") else EXIT_FAILED


def choose_scenes(text: str, known: tuple[str, ...]) -> list[str]:
    """Scenes of a comma-separated list; all when it is empty."""
    chosen = [name.strip() for name in text.split(",") if name.strip()] or list(known)
    for name in chosen:
        if name not in known:
            raise SettingsError(describe("--scenes", "unknown scene", name, nearest_first(name, known)))
    return chosen


def choose_sizes(text: str) -> list[int]:
    """Numbers of a comma-separated list."""
    try:
        sizes = [int(part) for part in text.split(",") if part.strip()]
    except ValueError as error:
        raise SettingsError(describe("--characters", "must be whole numbers", text, "10,100,1000")) from error
    if any(size < 1 for size in sizes):
        raise SettingsError(describe("--characters", "must be positive", text, "10,100,1000"))
    return sizes
