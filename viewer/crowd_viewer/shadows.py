"""The sun, and the map of the ground that it sees."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from crowd_viewer.quality import Quality

if TYPE_CHECKING:
    import moderngl

FloatArray = npt.NDArray[np.float64]
DIRECTION = np.array([-0.52, 0.76, 0.39])
MARGIN = 2.5
"""Ground around the outermost people that still gets shadows, m."""
SPREAD = 0.022
"""Radius over which the rim of a shadow fades, m."""
STAND_OFF = 0.02
HALF_DEPTH = 400.0
STEP = 1.15
"""The side of the map grows in steps of this factor, so that it rarely changes while people move."""


class Light:
    """One distant light with a map of depths fitted to the people who are seen."""

    def __init__(self, context: moderngl.Context, quality: Quality) -> None:
        self.direction = DIRECTION / np.linalg.norm(DIRECTION)
        self.is_on = quality.shadow_size > 0
        self.size = max(quality.shadow_size, 1)
        self.reach = quality.shadow_reach
        self.matrix: FloatArray = np.eye(4)
        self.softness = 1.0
        self.bias = 0.0
        self.map = context.depth_texture((self.size, self.size))
        self.map.compare_func = "<="
        self.map.repeat_x = self.map.repeat_y = False
        self._framebuffer = context.framebuffer(depth_attachment=self.map)
        across = np.cross([0.0, 1.0, 0.0], self.direction)
        across /= np.linalg.norm(across)
        self._axes = np.stack([across, np.cross(self.direction, across), self.direction])

    def aim(self, seen: npt.NDArray[np.float32], eye: FloatArray, ahead: FloatArray) -> None:
        """Fit the map to people, (D, 3) m, those near the eye first."""
        if not self.is_on:
            return
        away = ((seen - eye) ** 2).sum(axis=1)
        # Who is far away is small on the screen, and so are the steps of a coarser map.
        reach = max(self.reach, 0.8 * float(np.sqrt(away.min()))) if len(seen) else self.reach
        near = seen[away < (2.5 * reach) ** 2]
        if len(near) == 0:
            near = np.asarray(eye + min(20.0, reach) * ahead, np.float32)[None] * [1.0, 0.0, 1.0]
        points = near @ self._axes.T
        low, high = points.min(axis=0), points.max(axis=0)
        wanted = max(0.5 * float((high - low)[:2].max()) + MARGIN, 4.0)
        half = min(4.0 * STEP ** np.ceil(np.log(wanted / 4.0) / np.log(STEP)), reach)
        middle = 0.5 * (low + high)
        if wanted > reach:
            closest = np.clip(self._axes @ (eye + 0.8 * reach * ahead * [1.0, 0.0, 1.0]), low, high)
            middle[:2] = closest[:2]
        texel = 2.0 * half / self.size
        # Whole texels: shadows would crawl along their rims otherwise.
        middle[:2] = np.round(middle[:2] / texel) * texel
        matrix = np.eye(4)
        matrix[:2, :3] = self._axes[:2] / half
        matrix[:2, 3] = -middle[:2] / half
        matrix[2, :3] = -self._axes[2] / HALF_DEPTH
        matrix[2, 3] = middle[2] / HALF_DEPTH
        self.matrix = matrix
        self.softness = max(1.2, SPREAD / texel)
        self.bias = (STAND_OFF + 0.6 * texel) / (2.0 * HALF_DEPTH)

    def use(self) -> None:
        """Draw into the map, emptied."""
        self._framebuffer.use()
        self._framebuffer.clear(depth=1.0)

    def release(self) -> None:
        """Give the memory back."""
        self._framebuffer.release()
        self.map.release()
