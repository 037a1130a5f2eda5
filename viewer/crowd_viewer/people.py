"""People: chosen by what the camera sees, packed, uploaded, and drawn as meshes and capsules."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from crowd.body import Skin
from crowd.body.looks import LOOK_COLUMNS, draw_builds, draw_looks
from crowd.body.stance import flesh_segments, rest_positions
from crowd_kernels.view import REACH, levels_crowd, pack_crowd, sort_rows
from crowd_viewer.bodies import (
    BY_PLACE,
    FIXED_MATERIAL,
    Body,
    built_in_bodies,
    joint_parts,
    landmarks,
    worn_where,
)
from crowd_viewer.frame import CrowdFrame, Scene
from crowd_viewer.programs import (
    LIMBS_UNIT,
    LOOKS_UNIT,
    MOST_JOINTS,
    PALETTE_UNIT,
    ROOTS_UNIT,
    compile_program,
    set_units,
)
from crowd_viewer.quality import Quality
from crowd_viewer.tables import Table

if TYPE_CHECKING:
    import moderngl

FloatArray = npt.NDArray[np.float64]
MESH_LEVELS = 3
LEVELS = 6
FEW_LIMBS = 13
"""Limbs of people who are far away: trunk, head, arms and legs."""
STROKES = 7
"""Strokes of people who are tiny: each takes the place of two of those limbs, but for the head."""


class People:
    """The crowd on the graphics side."""

    def __init__(
        self,
        context: moderngl.Context,
        scene: Scene,
        quality: Quality,
        bodies: tuple[Body, ...] | None = None,
    ) -> None:
        self.context = context
        self.scene = scene
        self.quality = quality
        self.picked = -1
        self.upload_bytes = 0
        count, skeleton = len(scene.stature), scene.skeleton
        self.bodies = bodies or built_in_bodies(skeleton)
        self.build_count = len(self.bodies)
        self._build = np.zeros(count, np.int32)
        self._level = np.full(count, -1, np.int32)
        self._begin = np.zeros(LEVELS * self.build_count + 1, np.int32)
        self._drawn = np.zeros(count, np.int32)
        scale = scene.segment_scale[:, flesh_segments(skeleton)]
        self._joint_scale = np.rint(scale * (32767.0 / REACH)).astype(np.int16)
        self._every_joint = np.arange(skeleton.joint_count, dtype=np.int32)
        self._few_joints = np.unique(np.concatenate([body.limbs.joint for body in self.bodies])).astype(
            np.int32
        )
        self._root = np.zeros((count, 8), np.float32)
        self._full = np.zeros((min(count, quality.mesh_count), 8 * skeleton.joint_count), np.int16)
        self._reduced = np.zeros((count, 8 * len(self._few_joints)), np.int16)
        self._roots = Table(context, count, 2, "f4")
        self._full_palette = Table(context, len(self._full), 2 * skeleton.joint_count, "ni2")
        self._reduced_palette = Table(context, count, 2 * len(self._few_joints), "ni2")
        self._looks = Table(context, count, LOOK_COLUMNS, "f4")
        self._identity = np.full(count, -1, np.int64)
        self._look = np.zeros((count, LOOK_COLUMNS, 4), np.float32)
        self._height_factor = 1.0
        self._compile()
        self._fill_limbs()
        self._fill_meshes()

    # ---- what the camera sees

    def update(
        self,
        frame: CrowdFrame,
        planes: FloatArray,
        eye: FloatArray,
        pixels_at_one_metre: float,
        origin: FloatArray,
        *,
        is_perspective: bool = True,
        keeps_levels: bool = True,
    ) -> None:
        """Choose who is drawn and how, pack the poses and upload them.

        Parameters
        ----------
        frame : CrowdFrame
        planes : (6, 4) float64
            Of the view, in world space.
        eye : (3,) float64
        pixels_at_one_metre : float
        origin : (3,) float64
            Point that becomes 0 on the graphics side.
        is_perspective, keeps_levels : bool
            Levels depend on those of the frame before, so that nobody flickers between two.
        """
        if not keeps_levels:
            self._level[:] = -1
        self._update_looks(frame)
        self._choose_levels(frame, planes, eye, pixels_at_one_metre, is_perspective)
        drawn = self._drawn[: self._begin[-1]]
        mesh_count = self.count_of_meshes()
        self._pack(frame, drawn[:mesh_count], self._every_joint, origin, self._root, self._full)
        root, reduced = self._root[mesh_count:], self._reduced[mesh_count:]
        self._pack(frame, drawn[mesh_count:], self._few_joints, origin, root, reduced)
        self.upload_bytes = self._roots.write(self._root[: len(drawn)])
        self.upload_bytes += self._full_palette.write(self._full[:mesh_count])
        self.upload_bytes += self._reduced_palette.write(self._reduced[mesh_count : len(drawn)])

    def _choose_levels(
        self, frame: CrowdFrame, planes: FloatArray, eye: FloatArray, pixels: float, is_perspective: bool
    ) -> None:
        self._height_factor = max(1.0, self._height_factor / 1.05)
        while True:
            heights = np.array(self.quality.least_height)
            heights[:MESH_LEVELS] *= self._height_factor if self.has_meshes else np.inf
            levels_crowd(
                frame.position_world,
                frame.is_active,
                self.scene.stature,
                planes,
                eye,
                pixels,
                is_perspective,
                heights,
                self._level,
            )
            sort_rows(self._level, self._build, self.build_count, self._begin, self._drawn)
            if self.count_of_meshes() <= len(self._full):
                return
            self._height_factor *= 1.25

    def _pack(
        self,
        frame: CrowdFrame,
        drawn: npt.NDArray[np.int32],
        joints: npt.NDArray[np.int32],
        origin: FloatArray,
        root: npt.NDArray[np.float32],
        palette: npt.NDArray[np.int16],
    ) -> None:
        pack_crowd(
            frame.position_world,
            frame.yaw,
            frame.joint_position_model,
            frame.joint_rotation_model,
            self._joint_scale,
            self._build,
            drawn,
            joints,
            origin,
            root,
            palette,
        )

    def _update_looks(self, frame: CrowdFrame) -> None:
        """Draw looks of people who are new in their slots."""
        changed = np.flatnonzero(frame.identity != self._identity)
        if changed.size:
            self._identity[changed] = frame.identity[changed]
            recipes = [body.recipe for body in self.bodies]
            identity = frame.identity[changed]
            build = draw_builds(identity, self.scene.stature[changed], recipes)
            self._build[changed] = build
            self._look[changed] = draw_looks(identity, build, recipes)
            self._looks.write(self._look.reshape(len(self._look), -1))

    def count_of_meshes(self) -> int:
        """People drawn as meshes in this frame."""
        return int(self._begin[MESH_LEVELS * self.build_count])

    def counts(self) -> tuple[int, ...]:
        """People drawn at each level."""
        ends = self._begin[:: self.build_count]
        return tuple(int(count) for count in np.diff(ends))

    def seen_positions(self) -> npt.NDArray[np.float32]:
        """Roots of all who are drawn, counted from the origin, m. (D, 3)."""
        return self._root[: self._begin[-1], :3]

    # ---- drawing

    @property
    def has_meshes(self) -> bool:
        """There are bodies with a skin."""
        return all(len(body.skins) == MESH_LEVELS for body in self.bodies)

    def draw(self, kind: str) -> None:
        """Draw everyone: ``"colour"``, ``"shadow"`` or ``"identity"``."""
        self._bind()
        for bucket in range(MESH_LEVELS * self.build_count if self.has_meshes else 0):
            self._draw_meshes(kind, bucket)
        near, far, tiny, end = self._begin[MESH_LEVELS * self.build_count :: self.build_count].tolist()
        self._draw_capsules(kind, near, far - near, self._limb_count)
        if kind == "shadow" and not self.quality.has_far_shadows:
            return
        few = min(FEW_LIMBS, self._limb_count)
        if kind != "colour":
            self._draw_capsules(kind, far, end - far, few)
        elif few < FEW_LIMBS:
            self._draw_capsules("far", far, end - far, few)
        else:
            self._draw_capsules("far", far, tiny - far, few)
            self._draw_capsules("tiny", tiny, end - tiny, STROKES)

    def draw_blobs(self) -> None:
        """Darken the ground below the feet of all but those far away."""
        self._bind()
        near, far = (int(self._begin[k * self.build_count]) for k in (MESH_LEVELS, MESH_LEVELS + 1))
        program = self._blob_program
        for first, count, feet in ((0, near, self._feet), (near, far - near, self._feet_reduced)):
            if count:
                program["feet"] = feet
                self._set_rows(program, first, reduced=first == near)
                self._blobs.render(self.context.TRIANGLE_STRIP, instances=2 * count)

    def _draw_meshes(self, kind: str, bucket: int) -> None:
        first, count = int(self._begin[bucket]), int(self._begin[bucket + 1] - self._begin[bucket])
        if count == 0:
            return
        level, build = divmod(bucket, self.build_count)
        if kind == "shadow":
            level = min(level + 1, MESH_LEVELS - 1)
        program = self._mesh_programs[kind]
        self._set_rows(program, first, reduced=False)
        if "picked" in program:
            program["picked"] = self.picked
        self._meshes[kind, level, build].render(instances=count)

    def _draw_capsules(self, kind: str, first: int, count: int, limb_count: int) -> None:
        if count == 0:
            return
        program, quads = self._capsules[kind]
        self._set_rows(program, first, reduced=True)
        if "picked" in program:
            program["picked"] = self.picked
        quads.render(self.context.TRIANGLES, vertices=6 * limb_count, instances=count)

    def _set_rows(self, program: Any, first: int, *, reduced: bool) -> None:
        """Say where the people of a draw are in the tables."""
        program["first"] = first
        program["palette_first"] = self.count_of_meshes() if reduced else 0
        table = self._reduced_palette if reduced else self._full_palette
        program["palette_width"] = table.width
        table.texture.use(PALETTE_UNIT)

    def _bind(self) -> None:
        self._roots.texture.use(ROOTS_UNIT)
        self._looks.texture.use(LOOKS_UNIT)
        self._limbs.use(LIMBS_UNIT)

    def release(self) -> None:
        """Give the memory back."""
        for table in (self._roots, self._full_palette, self._reduced_palette, self._looks):
            table.release()
        self._limbs.release()

    def _compile(self) -> None:
        context = self.context
        constants: dict[str, Any] = {"LOOK_COLUMNS": LOOK_COLUMNS} | landmarks(self.scene.skeleton)
        corners = np.array([-1, -1, 1, -1, -1, 1, 1, 1], np.float32)
        self._corners = context.buffer(corners.tobytes())
        self._compile_limbs(constants)
        self._mesh_programs = {}
        for kind in ("colour", "shadow", "identity"):
            program = compile_program(
                context,
                ("view.glsl", "people.glsl", "mesh.vert"),
                ("view.glsl", "people.glsl", "lighting.glsl", "clothes.glsl", "mesh.frag"),
                **constants,
                **({} if kind == "colour" else {kind.upper(): ""}),
            )
            set_units(program)
            rest = np.zeros((MOST_JOINTS, 3), np.float32)
            rest[: self.scene.skeleton.joint_count] = rest_positions(self.scene.skeleton)
            program["rest"].write(rest.tobytes())  # type: ignore[union-attr]
            self._mesh_programs[kind] = program
        self._blob_program = compile_program(
            context, ("view.glsl", "people.glsl", "blob.vert"), ("blob.frag",), **constants
        )
        set_units(self._blob_program)
        self._blobs = context.vertex_array(self._blob_program, [(self._corners, "2f4", "corner")])

    def _compile_limbs(self, constants: dict[str, Any]) -> None:
        """Compile the programs of capsules and strokes."""
        context = self.context
        # A person is one instance: drivers that draw on the processor pay for each, and fill their lanes so.
        self._limb_count = max(len(body.limbs.joint) for body in self.bodies)
        corners = context.buffer(self._corners.read() * self._limb_count)
        firsts = 4 * np.arange(self._limb_count, dtype=np.int32)[:, None]
        triangles = context.buffer((firsts + np.array([0, 1, 2, 2, 1, 3], np.int32)).tobytes())
        programs = {}
        for kind, is_deep in (("colour", True), ("far", False), ("shadow", False), ("identity", True)):
            kinds = {} if kind in ("colour", "far") else {kind.upper(): ""}
            towards = "sun.xyz" if kind == "shadow" else "towards_eye(middle)"
            deep = {"DEEP": ""} if is_deep else {}
            program = compile_program(
                context,
                ("view.glsl", "people.glsl", "capsule.vert"),
                ("view.glsl", "people.glsl", "lighting.glsl", "clothes.glsl", "capsule.frag"),
                TOWARDS=towards,
                SMALLEST_COVER="0.02" if self.quality.samples else "0.5",
                PLAIN="",
                **constants,
                **kinds,
                **deep,
            )
            programs[kind] = program
        programs["tiny"] = compile_program(
            context,
            ("view.glsl", "people.glsl", "lighting.glsl", "clothes.glsl", "stroke.vert"),
            ("stroke.frag",),
            STROKES=STROKES,
            PIXEL="0.1",
            PLAIN="",
            **constants,
        )
        self._capsules = {}
        for kind, program in programs.items():
            set_units(program)
            quads = context.vertex_array(program, [(corners, "2f4", "corner")], triangles)
            self._capsules[kind] = (program, quads)

    def _fill_limbs(self) -> None:
        """Write what is worn where, then the limbs of all builds to a texture; missing ones have no size."""
        skeleton = self.scene.skeleton
        rest, part = rest_positions(skeleton), joint_parts(skeleton)
        table = np.zeros((self.build_count, self._limb_count + 1, 3, 4), np.float32)
        table[:, :, 0, 3] = 1e-6
        for row, body in zip(table, self.bodies, strict=True):
            row[0, 0] = worn_where(body.recipe)
            limbs, filled = body.limbs, slice(1, len(body.limbs.joint) + 1)
            row[filled, 0, :3] = limbs.start - rest[limbs.joint]
            row[filled, 0, 3] = limbs.radius
            row[filled, 1, :3] = limbs.end - rest[limbs.joint]
            row[filled, 1, 3] = np.searchsorted(self._few_joints, limbs.joint)
            row[filled, 2, :3] = rest[limbs.joint]
            row[filled, 2, 3] = np.where(
                limbs.material == BY_PLACE, part[limbs.joint], FIXED_MATERIAL + limbs.material
            )
        size = (3 * self._limb_count + 3, self.build_count)
        self._limbs = self.context.texture(size, 4, table.tobytes(), dtype="f4")
        self._limbs.filter = (self.context.NEAREST, self.context.NEAREST)
        self._feet = [skeleton.joint(f"{side}_foot") for side in ("left", "right")]
        self._feet_reduced = [int(np.searchsorted(self._few_joints, foot)) for foot in self._feet]

    def _fill_meshes(self) -> None:
        """Upload the skins of all builds and levels."""
        self._meshes: dict[tuple[str, int, int], moderngl.VertexArray] = {}
        for build, body in enumerate(self.bodies):
            for level, skin in enumerate(body.skins):
                vertices = self.context.buffer(vertex_bytes(skin))
                triangles = self.context.buffer(np.ascontiguousarray(skin.triangle, np.uint32).tobytes())
                for kind, program in self._mesh_programs.items():
                    layout = [
                        (form if name in program else f"{size}x", name) for form, size, name in VERTEX_LAYOUT
                    ]
                    used = [name for form, name in layout if not form.endswith("x")]
                    forms = " ".join(form for form, _ in layout)
                    self._meshes[kind, level, build] = self.context.vertex_array(
                        program, [(vertices, forms, *used)], triangles
                    )


VERTEX_LAYOUT = (
    ("3f4", 12, "position"),
    ("3f4", 12, "normal"),
    ("4u1", 4, "joint"),
    ("4f4", 16, "weight"),
    ("1f4", 4, "material"),
    ("1f4", 4, "open_sky"),
)


def vertex_bytes(skin: Skin) -> bytes:
    """Vertices of a skin as `VERTEX_LAYOUT` says."""
    rows = np.zeros(
        len(skin.position),
        [
            ("position", "f4", 3),
            ("normal", "f4", 3),
            ("joint", "u1", 4),
            ("weight", "f4", 4),
            ("material", "f4"),
            ("open_sky", "f4"),
        ],
    )
    for _, _, name in VERTEX_LAYOUT:
        rows[name] = getattr(skin, name)
    return rows.tobytes()
