"""What lies over the scene in a window: lines of the layers, a line of text, the timeline, the pose mix."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crowd_viewer.controls import Playback
from crowd_viewer.ground_map import GroundMap
from crowd_viewer.inset import draw_inset, fill
from crowd_viewer.lines import Lines
from crowd_viewer.overlays import Overlays, Seen
from crowd_viewer.renderer import Renderer
from crowd_viewer.text import LINE_HEIGHT, Text

if TYPE_CHECKING:
    import moderngl

TIMELINE_TOP, TIMELINE_SIDE, TIMELINE_HEIGHT = 26, 14, 8
LINE_WIDTH, BAR_WIDTH = 2.0, 12.0
BACKDROP = (0.02, 0.03, 0.05, 0.35)
GROOVE, PASSED, KNOB = (0.02, 0.03, 0.05, 0.6), (0.35, 0.75, 1.0, 0.95), (1.0, 1.0, 1.0, 1.0)


class Display:
    """Draws over the renderer's picture."""

    def __init__(self, context: moderngl.Context, renderer: Renderer, overlays: Overlays) -> None:
        self.renderer = renderer
        self.overlays = overlays
        self.text = Text(context)
        self._lines = Lines(context, renderer.origin)
        self._thin, self._thick = Lines(context, np.zeros(3)), Lines(context, np.zeros(3))
        self._map = GroundMap(context, renderer.origin)

    def prepare(self, seen: Seen) -> None:
        """Choose what the renderer draws on the ground."""
        shows_map = "grid" in self.overlays.shown and seen.simulation is not None
        if shows_map and seen.simulation is not None:
            self._map.update(seen.simulation, seen.picked)
        self.renderer.ground_map = self._map if shows_map else None

    def draw(self, seen: Seen, status: list[str], timeline: Playback | None) -> None:
        """Draw everything over the picture; a recording has a timeline."""
        targets = self.renderer.targets
        targets.picture.use()
        self.overlays.draw(self._lines, seen)
        self._lines.draw(targets.size, LINE_WIDTH)
        self.renderer.use_pixels()
        if timeline is not None:
            self._draw_timeline(timeline, targets.size)
        has_mix = "mix" in self.overlays.shown and seen.picked >= 0
        if has_mix:
            draw_inset(self._thin, self._thick, self.text, seen, targets.size)
        if self.text.is_on:
            width = max(map(self.text.width, status))
            fill(self._thin, 6, 6, width + 14, LINE_HEIGHT * len(status) + 8, BACKDROP)
        self._thin.draw(targets.size, LINE_WIDTH)
        self._thick.draw(targets.size, BAR_WIDTH)
        self.text.write(status, 12, 10)
        self.text.draw(targets.size)

    def _draw_timeline(self, playback: Playback, size: tuple[int, int]) -> None:
        length = size[0] - 2 * TIMELINE_SIDE
        top = size[1] - TIMELINE_TOP
        done = playback.share * length
        fill(self._thin, TIMELINE_SIDE, top, length, TIMELINE_HEIGHT, GROOVE)
        fill(self._thin, TIMELINE_SIDE, top, done, TIMELINE_HEIGHT, PASSED)
        fill(self._thin, TIMELINE_SIDE + done - 3, top - 4, 6, TIMELINE_HEIGHT + 8, KNOB)
        end = f"{playback.last:.1f} s"
        self.text.write([f"{playback.first:.1f} s"], TIMELINE_SIDE, top - 24)
        self.text.write([end], size[0] - TIMELINE_SIDE - self.text.width(end), top - 24)


def time_share(x: float, width: int) -> float:
    """Place on the timeline below a pixel, 0 to 1."""
    return min(max((x - TIMELINE_SIDE) / max(width - 2.0 * TIMELINE_SIDE, 1.0), 0.0), 1.0)
