"""The renderer: passes that make one picture of a crowd in its surroundings."""

from __future__ import annotations

import math
from dataclasses import replace
from types import TracebackType
from typing import TYPE_CHECKING, Self

import numpy as np
import numpy.typing as npt

from crowd_viewer.bodies import Body
from crowd_viewer.camera import Camera, view_planes
from crowd_viewer.characters import Characters
from crowd_viewer.frame import CrowdFrame, Scene
from crowd_viewer.ground_map import GroundMap
from crowd_viewer.people import People
from crowd_viewer.programs import SHADOW_UNIT, VIEW_BINDING
from crowd_viewer.quality import FINE, Quality
from crowd_viewer.shadows import Light
from crowd_viewer.surroundings import Surroundings
from crowd_viewer.targets import Targets
from crowd_viewer.things import Things

if TYPE_CHECKING:
    import moderngl

FloatArray = npt.NDArray[np.float64]
Picture = npt.NDArray[np.uint8]
FARTHEST = 3000.0
ALPHA_TO_COVERAGE = 0x809E


class Renderer:
    """Draws frames of one scene; use it in a ``with`` block.

    Parameters
    ----------
    context : moderngl.Context
    scene : Scene
    size : tuple of int
        Width and height of pictures, pixels.
    quality : Quality
    bodies : tuple of Body, optional
        One for each build; the built-in ones when left out.
    """

    def __init__(
        self,
        context: moderngl.Context,
        scene: Scene,
        size: tuple[int, int],
        quality: Quality = FINE,
        bodies: tuple[Body, ...] | None = None,
    ) -> None:
        self.context = context
        self.scene = scene
        self.quality = quality
        low_x, high_x, low_z, high_z = scene.bounds
        self.origin = np.array([0.5 * (low_x + high_x), 0.0, 0.5 * (low_z + high_z)])
        self.targets = Targets(context, size, quality.samples)
        self.light = Light(context, quality)
        self.people = People(context, scene, quality, bodies)
        self.characters = Characters(context, scene, quality)
        self.surroundings = Surroundings(context, scene, self.origin)
        self.things = Things(context, scene.objects)
        self.ground_map: GroundMap | None = None
        """Drawn on the ground, below the people."""
        self._view = context.buffer(reserve=208, dynamic=True)

    def resize(self, size: tuple[int, int]) -> None:
        """Draw pictures of another size from now on."""
        if size != self.targets.size:
            before, self.targets = self.targets, Targets(self.context, size, self.quality.samples)
            # moderngl returns to the framebuffer in use when it makes one: that may not be a deleted one.
            self.targets.use_picture()
            before.release()

    def draw(self, frame: CrowdFrame, camera: Camera, *, keeps_levels: bool = True) -> None:
        """Draw a frame into `targets.picture`."""
        self.prepare(frame, camera, keeps_levels=keeps_levels)
        if self.light.is_on:
            self._draw_shadows(frame)
        self._draw_colours(frame)

    def picture(self) -> Picture:
        """What was drawn last. (H, W, 3), the upper left pixel first."""
        return self.targets.read_picture()

    def identities(
        self, frame: CrowdFrame, camera: Camera
    ) -> tuple[npt.NDArray[np.uint32], npt.NDArray[np.float32]]:
        """Who is seen where, and how far away.

        Returns
        -------
        identity : (H, W) uint32
            Slot + 1; 0 where there is nobody.
        depth : (H, W) float32
            Distance along the camera's axis, m; infinite for the sky.
        """
        self.prepare(frame, camera, keeps_levels=False)
        context, targets = self.context, self.targets
        self._write_view(self._to_clip)
        targets.use_identity()
        context.enable_only(context.DEPTH_TEST)
        self.surroundings.draw_solids(frame.time, is_plain=True)
        self.things.draw(is_plain=True)
        self.people.draw("identity")
        self.characters.draw("identity")
        return targets.read_identity(), self._metres(targets.read_depth())

    def use_pixels(self) -> None:
        """Let what is drawn now have places in pixels, the upper left one first."""
        width, height = self.targets.size
        matrix = np.zeros((4, 4))
        matrix[0, 0], matrix[0, 3] = 2.0 / width, -1.0
        matrix[1, 1], matrix[1, 3] = -2.0 / height, 1.0
        matrix[3, 3] = 1.0
        self._write_view(matrix)

    def release(self) -> None:
        """Give the memory of the pictures back."""
        self.targets.release()
        self.light.release()
        self.people.release()
        self.characters.release()
        self.things.release()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()

    # ---- passes

    def prepare(self, frame: CrowdFrame, camera: Camera, *, keeps_levels: bool = True) -> None:
        """Compute matrices, and choose and upload who is seen."""
        width, height = self.targets.size
        self.camera = camera
        projection = camera.projection(width / height, FARTHEST)
        self._projection = projection
        self._to_clip = projection @ camera.view(self.origin)
        self._eye = np.asarray(camera.eye) - self.origin
        planes = view_planes(projection @ camera.view(np.zeros(3)))
        eye, pixels = np.asarray(camera.eye, np.float64), camera.pixels_at_one_metre(height)
        is_perspective = camera.is_perspective
        self.things.update(frame, self.origin)
        left = self.characters.update(frame, planes, eye, pixels, self.origin, is_perspective=is_perspective)
        self.people.update(
            replace(frame, is_active=left),
            planes,
            eye,
            pixels,
            self.origin,
            is_perspective=is_perspective,
            keeps_levels=keeps_levels,
        )
        seen = np.concatenate([self.people.seen_positions(), self.characters.seen_positions()])
        self.light.aim(seen, self._eye, camera.axes()[2])

    def _write_view(self, to_clip: FloatArray) -> None:
        ahead = self.camera.axes()[2]
        low_x, high_x, low_z, high_z = self.scene.bounds
        origin = self.origin
        values = [
            *to_clip.T.ravel(),
            *self.light.matrix.T.ravel(),
            *self._eye,
            float(self.camera.is_perspective),
            *ahead,
            self.light.softness,
            *self.light.direction,
            self.light.bias,
            low_x - origin[0],
            low_z - origin[2],
            high_x - origin[0],
            high_z - origin[2],
            float(self.quality.shadow_taps),
            0.0,
            0.0,
            0.0,
        ]
        self._view.write(np.array(values, np.float32).tobytes())
        self._view.bind_to_uniform_block(VIEW_BINDING)

    def _draw_shadows(self, frame: CrowdFrame) -> None:
        context = self.context
        self._write_view(self.light.matrix)
        self.light.use()
        context.enable_only(context.DEPTH_TEST)
        self.surroundings.draw_solids(frame.time, is_plain=True)
        self.things.draw(is_plain=True)
        self.people.draw("shadow")
        self.characters.draw("shadow")

    def _draw_colours(self, frame: CrowdFrame) -> None:
        context = self.context
        self._write_view(self._to_clip)
        self.targets.use_picture()
        self.light.map.use(SHADOW_UNIT)
        context.enable_only(context.DEPTH_TEST)
        context.depth_func = "<="
        self.surroundings.draw_solids(frame.time)
        self.things.draw()
        if self.quality.samples:
            context.enable_direct(ALPHA_TO_COVERAGE)
        self.people.draw("colour")
        self.characters.picked = self.people.picked
        self.characters.draw("colour")
        if self.quality.samples:
            context.disable_direct(ALPHA_TO_COVERAGE)
        self.surroundings.draw_ground(self._eye)
        self.surroundings.draw_sky(np.linalg.inv(self._to_clip).astype(np.float64))
        context.enable(context.BLEND)
        context.blend_func = context.SRC_ALPHA, context.ONE_MINUS_SRC_ALPHA
        if self.ground_map is not None:
            self.ground_map.draw()
        self.people.draw_blobs()
        context.disable(context.BLEND)
        self.targets.resolve()

    def _metres(self, depth: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        """Distance along the camera's axis from what the depth buffer holds."""
        clip = 2.0 * depth.astype(np.float64) - 1.0
        matrix = self._projection
        if self.camera.is_perspective:
            distance = matrix[2, 3] / (clip + matrix[2, 2])
        else:
            distance = -(clip - matrix[2, 3]) / matrix[2, 2]
        return np.where(depth >= 1.0, math.inf, np.abs(distance)).astype(np.float32)
