"""People drawn as characters that users bring: skinned meshes with pictures, driven by the crowd."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from crowd.characters import Character, Driver, MeshPart
from crowd.errors import describe
from crowd.motion.rotation import about, multiply, rotate
from crowd_viewer.context import INSTALL, ViewerError
from crowd_viewer.frame import CrowdFrame, Scene
from crowd_viewer.programs import PALETTE_UNIT, compile_program, set_units
from crowd_viewer.quality import Quality
from crowd_viewer.tables import Table

if TYPE_CHECKING:
    import moderngl

FloatArray = npt.NDArray[np.float64]
IMAGE_UNIT = 5
LEAST_HEIGHT = 12.0
"""Smaller people are drawn with the engine's own limbs, pixels."""
VERTEX_FORMAT = "3f4 3f4 2f4 4u2 4f4"
VERTEX_FIELDS = ("position", "normal", "texture_coordinate", "joint", "weight")


class Characters:
    """Those of the crowd who are characters of the user's, on the graphics side.

    Parameters
    ----------
    context : moderngl.Context
    scene : Scene
        Its cast says who is drawn as what.
    quality : Quality
        Its `mesh_count` bounds how many are drawn, the tallest on the screen first.
    """

    def __init__(self, context: moderngl.Context, scene: Scene, quality: Quality) -> None:
        self.scene = scene
        self.picked = -1
        cast = scene.cast
        self._number = cast.number
        self._most = quality.mesh_count
        self._places = np.zeros((0, 3), np.float32)
        self._programs = _compile(context) if cast.characters else {}
        self._figures = [
            _Figure(context, character, Driver(character, scene.skeleton), self._programs, self._most)
            for character in cast.characters
        ]

    def update(
        self,
        frame: CrowdFrame,
        planes: FloatArray,
        eye: FloatArray,
        pixels_at_one_metre: float,
        origin: FloatArray,
        *,
        is_perspective: bool = True,
    ) -> npt.NDArray[np.bool_]:
        """Choose who is drawn, pose them and upload their joints; see `People.update`.

        Returns
        -------
        (N,) bool
            Who is left to be drawn as a person: everyone in the scene but these.
        """
        if not self._figures:
            return frame.is_active
        chosen = self._choose(frame, planes, eye, pixels_at_one_metre, is_perspective)
        self._places = (frame.position_world[chosen] - origin).astype(np.float32)
        for number, figure in enumerate(self._figures):
            figure.pose(frame, chosen[self._number[chosen] == number], origin)
        left = frame.is_active.copy()
        left[chosen] = False
        return left

    def _choose(
        self, frame: CrowdFrame, planes: FloatArray, eye: FloatArray, pixels: float, is_perspective: bool
    ) -> npt.NDArray[np.int64]:
        """Slots of those who are seen, and tall enough on the screen."""
        there = np.flatnonzero(frame.is_active & (self._number >= 0))
        stature = self.scene.stature[there]
        middle = frame.position_world[there] + np.outer(0.5 * stature, (0.0, 1.0, 0.0))
        is_seen = (middle @ planes[:, :3].T + planes[:, 3] > -stature[:, None]).all(axis=1)
        away = np.linalg.norm(middle - eye, axis=1) if is_perspective else np.ones(len(there))
        height = np.where(is_seen, stature * pixels / np.maximum(away, 1e-3), 0.0)
        tallest = np.argsort(-height, kind="stable")[: self._most]
        return np.sort(there[tallest[height[tallest] >= LEAST_HEIGHT]])

    def seen_positions(self) -> npt.NDArray[np.float32]:
        """Roots of all who are drawn, counted from the origin, m. (D, 3)."""
        return self._places

    def draw(self, kind: str) -> None:
        """Draw everyone: ``"colour"``, ``"shadow"`` or ``"identity"``."""
        if not self._figures:
            return
        program = self._programs[kind]
        if "picked" in program:
            program["picked"] = self.picked
        for figure in self._figures:
            figure.draw(kind)

    def release(self) -> None:
        """Give the memory back."""
        for figure in self._figures:
            figure.release()


class _Figure:
    """One character and all who are drawn as it."""

    def __init__(
        self,
        context: moderngl.Context,
        character: Character,
        driver: Driver,
        programs: dict[str, moderngl.Program],
        most: int,
    ) -> None:
        self._driver = driver
        self._programs = programs
        self._count = 0
        self._palette = Table(context, most, 1 + 3 * character.joint_count, "f4")
        self._parts = [_Part(context, part, programs) for part in character.parts]

    def pose(self, frame: CrowdFrame, rows: npt.NDArray[np.int64], origin: FloatArray) -> None:
        """Compute and upload the joints of the people in some slots."""
        self._count = len(rows)
        if not len(rows):
            return
        heading = about(1, frame.yaw[rows])[:, None]
        rotation = multiply(heading, frame.joint_rotation_model[rows].astype(np.float64))
        position = rotate(heading, frame.joint_position_model[rows].astype(np.float64))
        position += (frame.position_world[rows] - origin)[:, None]
        matrices = self._driver.skin_matrices(rotation, position)
        table = np.zeros((len(rows), self._palette.width, 4), np.float32)
        table[:, 0, 0] = rows
        table[:, 1:] = matrices[:, :, :3].reshape(len(rows), -1, 4)
        self._palette.write(table.reshape(len(rows), -1))

    def draw(self, kind: str) -> None:
        if not self._count:
            return
        program = self._programs[kind]
        program["palette_width"] = self._palette.width
        self._palette.texture.use(PALETTE_UNIT)
        for part in self._parts:
            part.draw(kind, program, self._count)

    def release(self) -> None:
        self._palette.release()
        for part in self._parts:
            part.image.release()


class _Part:
    """A mesh of a character with its colour and picture."""

    def __init__(
        self, context: moderngl.Context, part: MeshPart, programs: dict[str, moderngl.Program]
    ) -> None:
        rows = np.zeros(
            len(part.position),
            [("p", "f4", 3), ("n", "f4", 3), ("t", "f4", 2), ("j", "u2", 4), ("w", "f4", 4)],
        )
        rows["p"], rows["n"], rows["t"] = part.position, part.normal, part.texture_coordinate
        rows["j"], rows["w"] = part.joint, part.weight
        vertices = context.buffer(rows.tobytes())
        triangles = context.buffer(np.ascontiguousarray(part.triangle, np.uint32).tobytes())
        self._arrays = {}
        for kind, program in programs.items():
            sizes = dict(zip(VERTEX_FIELDS, ("12x", "12x", "8x", "8x", "16x"), strict=True))
            forms = [
                form if name in program else sizes[name]
                for form, name in zip(VERTEX_FORMAT.split(), VERTEX_FIELDS, strict=True)
            ]
            used = [name for name in VERTEX_FIELDS if name in program]
            self._arrays[kind] = context.vertex_array(
                program, [(vertices, " ".join(forms), *used)], triangles
            )
        self._colour = tuple(float(value) for value in part.colour[:3])
        self.image = _texture(context, part.image)

    def draw(self, kind: str, program: moderngl.Program, count: int) -> None:
        if kind == "colour":
            program["base_colour"] = self._colour
            self.image.use(IMAGE_UNIT)
        self._arrays[kind].render(instances=count)


def _compile(context: moderngl.Context) -> dict[str, moderngl.Program]:
    programs = {}
    for kind in ("colour", "shadow", "identity"):
        program = compile_program(
            context,
            ("view.glsl", "character.vert"),
            ("view.glsl", "lighting.glsl", "character.frag"),
            **({} if kind == "colour" else {kind.upper(): ""}),
        )
        set_units(program)
        if "image" in program:
            program["image"] = IMAGE_UNIT
        programs[kind] = program
    return programs


def _texture(context: moderngl.Context, image: bytes) -> moderngl.Texture:
    """The picture of a material, white where there is none."""
    size, pixels = (1, 1), b"\xff\xff\xff"
    if image:
        try:
            from PIL import Image
        except ImportError as error:
            raise ViewerError(describe("viewer", "pillow is not installed", allowed=INSTALL)) from error
        try:
            with Image.open(io.BytesIO(image)) as opened:
                picture = opened.convert("RGB")
        except (OSError, ValueError) as error:
            raise ViewerError(describe("viewer", "a character's picture is broken", str(error))) from error
        size, pixels = picture.size, picture.tobytes()
    texture = context.texture(size, 3, pixels, alignment=1)
    texture.build_mipmaps()
    texture.filter = (context.LINEAR_MIPMAP_LINEAR, context.LINEAR)
    return texture
