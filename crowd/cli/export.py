"""``crowd export``: take a recording to other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from crowd.errors import SettingsError, describe


def export(
    recording: Annotated[Path, typer.Argument(help="Recording made by `crowd run --record`.")],
    to: Annotated[str, typer.Option(help="bvh, gltf, usd, jupedsim, csv, npz or coco.")],
    out: Annotated[Path, typer.Option(help="File to write; a folder for bvh and gltf.")],
    characters: Annotated[str, typer.Option(help="Slots or names, separated by commas; all.")] = "",
    start: Annotated[float | None, typer.Option(help="Simulated time of the first frame, s.")] = None,
    stop: Annotated[float | None, typer.Option(help="Simulated time of the last frame, s.")] = None,
    character: Annotated[
        list[Path] | None, typer.Option(help="gltf, usd: character instead of the recorded ones; repeat it.")
    ] = None,
    eye: Annotated[str, typer.Option(help="coco: camera, x,y,z, m.")] = "0,6,-16",
    target: Annotated[str, typer.Option(help="coco: what the camera looks at, x,y,z, m.")] = "0,1,0",
    field_of_view: Annotated[float, typer.Option(help="coco: from lower to upper edge, deg.")] = 45.0,
    size: Annotated[str, typer.Option(help="coco: width,height of the picture, pixels.")] = "1280,720",
) -> int:
    """Write a recording for other programs: BVH, glTF, USD, JuPedSim, CSV, NumPy, COCO."""
    from rich.console import Console
    from rich.progress import Progress

    from crowd.characters import load_character
    from crowd.cli.output import require_folder
    from crowd.export.coco import PictureCamera
    from crowd.export.formats import FORMATS, ExportSettings
    from crowd.export.formats import export as write
    from crowd.export.selection import Selection
    from crowd.recording import Recording

    if to in FORMATS and not FORMATS[to].startswith("a folder"):
        require_folder("--out", out)
    chosen: list[int | str] | None = [name.strip() for name in characters.split(",") if name.strip()] or None
    x, y, z = numbers("--eye", eye, 3)
    u, v, w = numbers("--target", target, 3)
    width, height = (int(value) for value in numbers("--size", size, 2))
    settings = ExportSettings(
        tuple(load_character(path) for path in character or ()),
        PictureCamera((x, y, z), (u, v, w), field_of_view, width, height),
    )
    with Recording(recording) as opened:
        selection = Selection(opened, chosen, start, stop)
        with Progress(console=Console(stderr=True), transient=True) as progress:
            task = progress.add_task(f"exporting {to}", total=selection.frame_count)
            write(selection, to, out, settings, lambda frames: progress.update(task, advance=frames))
        people, frames = len(selection.visits), selection.frame_count
    print(f"wrote {out}: {FORMATS[to]}; {people} people, {frames} frames")
    return 0


def numbers(option: str, text: str, count: int) -> list[float]:
    """Some numbers separated by commas.

    Raises
    ------
    SettingsError
        They are not that many numbers.
    """
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) != count:
        raise SettingsError(describe(option, f"takes {count} numbers separated by commas", text))
    return values
