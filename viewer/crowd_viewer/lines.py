"""Lines and discs over the picture that show what people plan: one batch a frame."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from crowd_viewer.programs import compile_program

if TYPE_CHECKING:
    import moderngl

FloatArray = npt.NDArray[np.float64]
Colour = tuple[float, float, float, float]
CAPACITY = 65536


class Lines:
    """Segments in the scene, some pixels wide on any driver."""

    def __init__(self, context: moderngl.Context, origin: FloatArray) -> None:
        self.context = context
        self.origin = origin
        self._rows: list[npt.NDArray[np.float32]] = []
        self._program = compile_program(context, ("view.glsl", "line.vert"), ("line.frag",))
        self._buffer = context.buffer(reserve=CAPACITY * 40, dynamic=True)
        self._array = context.vertex_array(
            self._program, [(self._buffer, "3f4 3f4 4f4/i", "start", "end", "tint")]
        )

    def add(self, start: FloatArray, end: FloatArray, colour: Colour) -> None:
        """Add segments from points (S, 3) to points (S, 3), m."""
        if len(start):
            tint = np.broadcast_to(np.array(colour), (len(start), 4))
            self._rows.append(np.hstack([start - self.origin, end - self.origin, tint]).astype(np.float32))

    def path(self, points: FloatArray, colour: Colour) -> None:
        """Add a broken line through points (P, 3)."""
        self.add(points[:-1], points[1:], colour)

    def circles(self, middle: FloatArray, radius: FloatArray, colour: Colour, corners: int = 20) -> None:
        """Add level circles around points (C, 3)."""
        angle = np.linspace(0.0, 2.0 * math.pi, corners + 1)
        ring = np.stack([np.cos(angle), 0.0 * angle, np.sin(angle)], axis=1)
        points = middle[:, None] + radius[:, None, None] * ring
        self.add(points[:, :-1].reshape(-1, 3), points[:, 1:].reshape(-1, 3), colour)

    def arrows(self, start: FloatArray, vector: FloatArray, colour: Colour) -> None:
        """Add level arrows (A, 3)."""
        end = start + vector
        across = np.cross(vector, [0.0, 1.0, 0.0])
        self.add(start, end, colour)
        for sign in (1.0, -1.0):
            self.add(end, end - 0.22 * vector + sign * 0.12 * across, colour)

    def draw(self, size: tuple[int, int], width: float = 2.0) -> None:
        """Draw all segments and forget them; the view must be written already."""
        if not self._rows:
            return
        rows = np.concatenate(self._rows)[:CAPACITY]
        self._rows.clear()
        self._buffer.write(rows.tobytes())
        context = self.context
        context.enable(context.BLEND)
        context.blend_func = context.SRC_ALPHA, context.ONE_MINUS_SRC_ALPHA
        self._program["size_and_width"] = (*size, width)
        self._array.render(context.TRIANGLE_STRIP, vertices=4, instances=len(rows))
        context.disable(context.BLEND)
