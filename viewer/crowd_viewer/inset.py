"""A small drawing beside the scene: how the picked person's pose is mixed."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from crowd.simulation import Simulation
from crowd_viewer.lines import Colour, Lines
from crowd_viewer.overlays import Seen
from crowd_viewer.text import Text

FloatArray = npt.NDArray[np.float64]

WIDTH, SPACE_HEIGHT, ROW, PAD = 320, 240, 20, 12
BAR_LEFT = 190
PANEL, FAINT, CORNER, POINT = (
    (0.05, 0.06, 0.08, 0.72),
    (0.7, 0.75, 0.8, 0.28),
    (1.0, 0.75, 0.2, 0.95),
    (0.3, 1.0, 0.5, 1.0),
)
BAR, GROOVE = (0.35, 0.75, 1.0, 0.95), (1.0, 1.0, 1.0, 0.12)
TURN, TILT = 0.6, 0.45
"""From where the parameter space is seen, rad."""
AXES = ("forward", "turn", "side")
LAYERS = (
    ("locomotion", "locomotion_weight"),
    ("animation", "play_weight"),
    ("reach", "reach_weight"),
    ("grab", "grab_weight"),
    ("gaze", "gaze_weight"),
    ("constraint", "constraint_weight"),
)
"""Controllers with a weight, in the order of the stack."""


@dataclass(frozen=True)
class Bar:
    """A name and a share of 1."""

    name: str
    share: float


def layer_bars(seen: Seen) -> list[Bar]:
    """Weights of the controllers for the picked person; idle has what locomotion leaves."""
    bars = []
    for name, field in LAYERS:
        values = seen.quantity(field)
        if values is not None:
            bars.append(Bar(name, float(np.max(values[seen.picked]))))
            if name == "locomotion":
                bars.insert(0, Bar("idle", 1.0 - bars[-1].share))
    return bars


def example_bars(simulation: Simulation, row: int) -> list[Bar]:
    """Weights of the locomotion examples that are blended, the largest first."""
    state, names = simulation.state, simulation.model.space.names
    pairs = zip(state.example[row].tolist(), state.example_weight[row].tolist(), strict=True)
    return [Bar(names[example], weight) for example, weight in sorted(pairs, key=lambda pair: -pair[1])]


def draw_inset(lines: Lines, thick: Lines, text: Text, seen: Seen, size: tuple[int, int]) -> None:
    """Draw in pixels, at the lower left: the parameter space, then bars.

    Parameters
    ----------
    lines, thick : Lines
        Of 2 and of `ROW` - 8 pixels.
    text : Text
    seen : Seen
        With a picked person.
    size : tuple of int
        Of the picture, pixels.
    """
    row, simulation = seen.picked, seen.simulation
    groups = [("controllers", layer_bars(seen))]
    has_space = simulation is not None
    if simulation is not None:
        groups.append(("examples", example_bars(simulation, row)))
    count = sum(len(bars) + 1 for _, bars in groups)
    height = 2 * PAD + ROW * count + (SPACE_HEIGHT + ROW if has_space else 0)
    left, top = 12, max(size[1] - height - 54, 4)
    fill(lines, left, top, WIDTH, height, PANEL)
    y = top + PAD
    if simulation is not None:
        values = simulation.state.locomotion_parameter[row]
        told = f"{values[0]:.2f} m/s   {values[1]:+.2f} rad/s   {values[2]:+.2f} m/s"
        text.write([told], left + PAD, y - 2)
        _space(lines, text, simulation, row, (left + PAD, y + ROW))
        y += SPACE_HEIGHT + ROW
    for title, bars in groups:
        text.write([title], left + PAD, y)
        y += ROW
        for bar in bars:
            text.write([bar.name], left + 2 * PAD, y)
            begin, length = left + BAR_LEFT, WIDTH - BAR_LEFT - PAD
            for share, colour in ((1.0, GROOVE), (min(max(bar.share, 0.0), 1.0), BAR)):
                end = begin + max(share * length, 1.0)
                thick.add(_point(begin, y + 9), _point(end, y + 9), colour)
            y += ROW


def fill(lines: Lines, left: float, top: float, width: float, height: float, colour: Colour) -> None:
    """Fill a rectangle with level lines of 2 pixels."""
    y = np.arange(top + 1.0, top + height, 2.0)
    start = np.stack([np.full(len(y), left), y, np.zeros(len(y))], axis=1)
    lines.add(start, start + [width, 0.0, 0.0], colour)


def _point(x: float, y: float) -> FloatArray:
    return np.array([[x, y, 0.0]])


def _space(lines: Lines, text: Text, simulation: Simulation, row: int, corner: tuple[float, float]) -> None:
    """Examples, the tetrahedron whose corners are blended, and the point in it."""
    space, state = simulation.model.space.arrays, simulation.state
    middle = 0.5 * (space.example.min(axis=0) + space.example.max(axis=0))
    scale = 0.98 * (SPACE_HEIGHT - 2 * PAD)

    def on_screen(points: FloatArray) -> FloatArray:
        forward, turn, side = np.moveaxis(points - middle, -1, 0)
        # Forward points up, turning goes to the side, side speed into the depth.
        across = math.cos(TURN) * turn + math.sin(TURN) * side
        depth = math.cos(TURN) * side - math.sin(TURN) * turn
        up = math.cos(TILT) * forward + math.sin(TILT) * depth
        x = corner[0] + 0.5 * (WIDTH - 2 * PAD) + scale * across
        y = corner[1] + 0.5 * SPACE_HEIGHT - scale * up
        return np.stack([x, y, np.zeros_like(x)], axis=-1)

    examples = on_screen(space.example)
    edges = np.unique(np.sort(space.hull_face[:, [[0, 1], [1, 2], [0, 2]]].reshape(-1, 2), axis=1), axis=0)
    lines.add(examples[edges[:, 0]], examples[edges[:, 1]], FAINT)
    lines.add(examples - [1.5, 0.0, 0.0], examples + [1.5, 0.0, 0.0], (1.0, 1.0, 1.0, 0.7))
    corners = examples[state.example[row]]
    first, second = np.triu_indices(4, 1)
    lines.add(corners[first], corners[second], CORNER)
    point = on_screen(state.library_parameter[[row]] / space.axis_range)
    for offset in (-2.0, 0.0, 2.0):
        lines.add(point + [-4.0, offset, 0.0], point + [4.0, offset, 0.0], POINT)
    low, high = space.example.min(axis=0), space.example.max(axis=0)
    for axis, name in enumerate(AXES):
        end = middle.copy()
        end[axis] = high[axis] + 0.06 * (high[axis] - low[axis])
        x, y, _ = on_screen(end[None])[0]
        length = text.width(name)
        place = min(max(x - 0.5 * length, corner[0]), corner[0] + WIDTH - 2 * PAD - length)
        text.write([name], place, min(max(y - 9, corner[1]), corner[1] + SPACE_HEIGHT - 16))
