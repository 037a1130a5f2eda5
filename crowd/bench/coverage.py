"""Draw the locomotion space of a library: where its examples lie, and where they come from."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from crowd.blending.parameter_space import ParameterSpace
from crowd.errors import SettingsError, describe
from crowd.motion.clip import ClipKind
from crowd.motion.importing.example_set import origin_of
from crowd.motion.library import MotionLibrary

COLOURS = {"captured": "C0", "mirrored": "C1", "built-in library": "C3"}
PLANES = ((1, "turn, deg/s", math.degrees(1.0)), (2, "side speed, m/s", 1.0))


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
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise SettingsError(
            describe("--picture", "matplotlib is not installed", allowed='pip install "crowd-engine[bench]"')
        ) from error
    clips = library.of_kind(ClipKind.LOCOMOTION)
    points = np.array([clip.parameters for clip in clips])
    durations = np.array([clip.cycle_duration for clip in clips])
    space = ParameterSpace.build(points, durations, [clip.name for clip in clips])
    figure = Figure(figsize=(12, 5), layout="constrained")
    for axes, (axis, label, unit) in zip(figure.subplots(1, 2), PLANES, strict=True):
        _draw_reach(axes, space, axis, unit)
        in_plane = np.abs(points[:, 3 - axis]) < (0.1 if axis == 1 else 0.2)
        for origin, colour in COLOURS.items():
            chosen = [k for k, clip in enumerate(clips) if in_plane[k] and origin_of([clip]) == origin]
            axes.plot(points[chosen, axis] * unit, points[chosen, 0], "o", color=colour, label=origin)
        for clip, inside in zip(clips, in_plane, strict=True):
            if inside:
                place = (clip.parameters[axis] * unit, clip.parameters[0])
                axes.annotate(clip.name, place, (3, 3), textcoords="offset points", fontsize=5)
        axes.set(xlabel=f"{label} (left positive)", ylabel="forward speed, m/s")
        axes.grid(alpha=0.3)
    figure.axes[0].legend(fontsize=8)
    figure.suptitle(f"{library.name}: {len(clips)} locomotion examples, {space.simplex_count} tetrahedra")
    try:
        figure.savefig(path, dpi=130)
    except (OSError, ValueError) as error:
        raise SettingsError(describe(str(path), "cannot be drawn", str(error))) from error


def _draw_reach(axes: object, space: ParameterSpace, axis: int, unit: float) -> None:
    """Shade what the space covers where the third parameter is 0."""
    low, high = space.parameters[:, 0].min(), space.parameters[:, 0].max()
    forward = np.linspace(low + 1e-3, high - 1e-3, 121)
    origin = forward[:, None] * np.array([1.0, 0.0, 0.0])
    left, right = (space.extent(origin, sign * np.eye(3)[axis]) for sign in (1.0, -1.0))
    axes.fill_betweenx(forward, -right * unit, left * unit, color="0.92")  # type: ignore[attr-defined]
