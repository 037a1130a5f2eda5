"""Draw the locomotion space of a library: where its examples lie, and where they come from."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from crowd.bench.plot import require_matplotlib
from crowd.blending.parameter_space import ParameterSpace
from crowd.errors import SettingsError, describe
from crowd.motion.clip import Clip, ClipKind
from crowd.motion.importing.example_set import coverage_of, origin_of
from crowd.motion.library import MotionLibrary

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = {"captured": "C0", "mirrored": "C1", "built-in library": "C3", "missing": "0.5"}
PLANES = ((1, "turn, deg/s", math.degrees(1.0)), (2, "side speed, m/s", 1.0))
IN_PLANE = (0.0, 0.2, 0.1)
"""An example is drawn where the third parameter is nearer to 0 than this: -, rad/s, m/s."""
LONGEST_NAME = 38
LINE = 0.025
"""Height of a line of text, share of the picture."""


def draw_coverage(library: MotionLibrary, path: Path) -> None:
    """Draw forward speed against turn rate and against side speed, with the reach of the space.

    Parameters
    ----------
    library : MotionLibrary
    path : Path
        Picture; the format follows its ending.

    Raises
    ------
    SettingsError
        Matplotlib is missing, or the picture cannot be written.
    """
    require_matplotlib("--picture")
    from matplotlib.figure import Figure

    clips = library.of_kind(ClipKind.LOCOMOTION)
    points = np.array([clip.parameters for clip in clips])
    durations = np.array([clip.cycle_duration for clip in clips])
    space = ParameterSpace.build(points, durations, [clip.name for clip in clips])
    figure = Figure(figsize=(17, 8), layout="constrained")
    *planes, legend = figure.subplots(1, 3, width_ratios=(1.0, 0.8, 1.1))
    order = sorted(range(len(clips)), key=lambda k: (-points[k, 0], points[k, 1], points[k, 2]))
    number = {k: rank for rank, k in enumerate(order, 1)}
    for axes, (axis, label, unit) in zip(planes, PLANES, strict=True):
        _draw_reach(axes, space, axis, unit)
        other = 3 - axis
        for k, clip in enumerate(clips):
            if abs(points[k, other]) < IN_PLANE[other]:
                place = (points[k, axis] * unit, points[k, 0])
                colour = COLOURS[origin_of([clip])]
                axes.plot(*place, "o", color=colour, markersize=5)
                axes.annotate(str(number[k]), place, (4, 3), textcoords="offset points", color=colour)
        axes.set(xlabel=f"{label} (left positive)", ylabel="forward speed, m/s")
        axes.margins(x=0.1)
        axes.grid(alpha=0.3)
    _write_legend(legend, library, [(number[k], clips[k]) for k in order])
    figure.suptitle(f"{library.name}: {len(clips)} locomotion examples, {space.simplex_count} tetrahedra")
    try:
        figure.savefig(path, dpi=130)
    except (OSError, ValueError) as error:
        raise SettingsError(describe(str(path), "cannot be drawn", str(error))) from error


def _draw_reach(axes: Axes, space: ParameterSpace, axis: int, unit: float) -> None:
    """Shade what the space covers where the third parameter is 0."""
    low, high = space.parameters[:, 0].min(), space.parameters[:, 0].max()
    forward = np.linspace(low + 1e-3, high - 1e-3, 121)
    origin = forward[:, None] * np.array([1.0, 0.0, 0.0])
    left, right = (space.extent(origin, sign * np.eye(3)[axis]) for sign in (1.0, -1.0))
    axes.fill_betweenx(forward, -right * unit, left * unit, color="0.92")


def _write_legend(axes: Axes, library: MotionLibrary, clips: Sequence[tuple[int, Clip]]) -> None:
    """List the examples by number, then what a crowd needs and where it comes from."""
    axes.axis("off")
    lines = [("examples", "black")]
    for number, clip in clips:
        # Adding 0 takes the sign of a mirrored zero away.
        forward, turn, side = (value + 0.0 for value in clip.parameters)
        name = clip.name if len(clip.name) <= LONGEST_NAME else clip.name[: LONGEST_NAME - 1] + "\u2026"
        origin = origin_of([clip])
        moves = f"{forward:5.2f} m/s {math.degrees(turn):6.1f} deg/s {side:5.2f} m/s"
        lines.append((f"{number:2d} {name:{LONGEST_NAME}s} {moves}", COLOURS[origin]))
    lines.append(("", "black"))
    lines.append(("a crowd needs: comes from", "black"))
    lines += [(f"{entry.need}: {entry.origin}", COLOURS[entry.origin]) for entry in coverage_of(library)]
    height = min(LINE, 1.0 / len(lines))
    for row, (text, colour) in enumerate(lines):
        size = 7.5 * height / LINE
        axes.text(0.0, 1.0 - row * height, text, color=colour, fontsize=size, family="monospace", va="top")
