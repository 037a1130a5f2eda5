"""Sky, ground, walls and obstacles."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from crowd_viewer.frame import Scene
from crowd_viewer.programs import compile_program, set_units

if TYPE_CHECKING:
    import moderngl

FloatArray = npt.NDArray[np.float64]
GROUND_REACH = 4000.0


class Surroundings:
    """What people walk on and around."""

    def __init__(self, context: moderngl.Context, scene: Scene, origin: FloatArray) -> None:
        self.context = context
        triangle = context.buffer(np.array([-1, -1, 3, -1, -1, 3], np.float32).tobytes())
        corners = context.buffer(np.array([-1, -1, -1, 1, 1, -1, 1, 1], np.float32).tobytes())
        light = ("view.glsl", "lighting.glsl")
        self._sky = compile_program(context, ("view.glsl", "sky.vert"), (*light, "sky.frag"))
        self._ground = compile_program(context, ("view.glsl", "ground.vert"), (*light, "ground.frag"))
        self._sky_array = context.vertex_array(self._sky, [(triangle, "2f4", "corner")])
        self._ground_array = context.vertex_array(self._ground, [(corners, "2f4", "corner")])
        self._solid = compile_program(context, ("view.glsl", "solid.vert"), (*light, "solid.frag"))
        self._plain = compile_program(context, ("view.glsl", "plain.vert"), ("plain.frag",))
        for program in (self._sky, self._ground, self._solid):
            set_units(program)
        self._solids: list[tuple[float, float, moderngl.VertexArray, moderngl.VertexArray]] = []
        times = sorted({(solid.appear_at, solid.disappear_at) for solid in scene.solids})
        for appear_at, disappear_at in times:
            together = [
                s.vertex for s in scene.solids if (s.appear_at, s.disappear_at) == (appear_at, disappear_at)
            ]
            vertex = np.concatenate(together)
            vertex[:, :3] -= origin.astype(np.float32)
            buffer = context.buffer(np.ascontiguousarray(vertex).tobytes())
            shaded = context.vertex_array(
                self._solid, [(buffer, "3f4 3f4 1f4", "position", "normal", "height")]
            )
            plain = context.vertex_array(self._plain, [(buffer, "3f4 16x", "position")])
            self._solids.append((appear_at, disappear_at, shaded, plain))

    def draw_ground(self, eye: FloatArray) -> None:
        """Draw the ground around a point counted from the origin."""
        self._ground["middle_and_reach"] = (float(eye[0]), float(eye[2]), GROUND_REACH)
        self._ground_array.render(self.context.TRIANGLE_STRIP)

    def draw_sky(self, from_clip: FloatArray) -> None:
        """Draw the sky where nothing else is."""
        self._sky["from_clip"].write(from_clip.T.astype(np.float32).tobytes())  # type: ignore[union-attr]
        self._sky_array.render()

    def draw_solids(self, time: float, *, is_plain: bool = False) -> None:
        """Draw the walls and obstacles that are there at a time, s; plain ones have no colour."""
        for appear_at, disappear_at, shaded, plain in self._solids:
            if appear_at <= time < disappear_at:
                # What comes or goes is of wood, as doors and barriers are.
                self._solid["wood"] = float(appear_at > 0.0 or disappear_at < math.inf)
                (plain if is_plain else shaded).render()
