"""A picture of a crowd as stick figures, with matplotlib: what can be looked at without a viewer."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from crowd.errors import SettingsError, describe
from crowd.simulation import Simulation
from crowd.world.obstacles import Wall

FloatArray = npt.NDArray[np.float64]

# Widths of limbs over 1 m, by joint at the lower end of a segment.
WIDTHS = {"spine": 0.24, "neck": 0.09, "head": 0.17, "clavicle": 0.13, "thigh": 0.15, "shank": 0.13}
LIMB_WIDTH = 0.085
FINGER_PARTS = ("thumb", "index", "middle", "ring", "little", "eye")
SKIN = (0.87, 0.69, 0.56)
SHADOW = (0.72, 0.72, 0.70)


class Camera:
    """A pinhole camera that looks at a point; gives picture coordinates and depth."""

    def __init__(self, eye: npt.ArrayLike, target: npt.ArrayLike, zoom: float = 1.6) -> None:
        self.eye = np.asarray(eye, float)
        ahead = np.asarray(target, float) - self.eye
        self.ahead = ahead / np.linalg.norm(ahead)
        right = np.cross(self.ahead, (0.0, 1.0, 0.0))
        self.right = right / np.linalg.norm(right)
        self.up = np.cross(self.right, self.ahead)
        self.zoom = zoom

    def project(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Picture coordinates (..., 2) and depths (...) of points (..., 3)."""
        way = points - self.eye
        depth = np.maximum(way @ self.ahead, 0.1)
        flat = np.stack([way @ self.right, way @ self.up], axis=-1)
        return self.zoom * flat / depth[..., None], depth


def draw(simulation: Simulation, path: Path, eye: npt.ArrayLike, target: npt.ArrayLike) -> None:
    """Draw everyone in the scene, obstacles and shadows.

    Raises
    ------
    SettingsError
        matplotlib is not installed, or the file cannot be written.
    """
    try:
        import matplotlib

        matplotlib.use("Agg")
        import matplotlib.pyplot as plt
        from matplotlib.collections import LineCollection, PolyCollection
    except ImportError as error:
        raise SettingsError(
            describe("picture", "needs matplotlib", allowed='pip install "crowd-engine[bench]"')
        ) from error
    camera = Camera(eye, target)
    figure, axes = plt.subplots(figsize=(12.8, 7.2))
    figure.subplots_adjust(0, 0, 1, 1)
    axes.set(xlim=(-0.8, 0.8), ylim=(-0.45, 0.45), aspect="equal")
    axes.set_axis_off()
    horizon = camera.project(camera.eye + 1000.0 * np.array([camera.ahead[0], 0.0, camera.ahead[2]]))[0][1]
    axes.axhspan(-1, horizon, color=(0.86, 0.85, 0.82), zorder=0)
    axes.axhspan(horizon, 1, color=(0.80, 0.88, 0.95), zorder=0)
    points_per_unit = 72.0 * 12.8 / 1.6
    drawn = sorted((*people(simulation, camera), *obstacles(simulation, camera)), key=lambda item: -item[0])
    for order, (_, kind, shapes, colors, widths) in enumerate(drawn):
        if kind == "lines":
            lines = LineCollection(
                shapes, colors=colors, linewidths=widths * points_per_unit, capstyle="round", zorder=1 + order
            )
            axes.add_collection(lines)
        else:
            faces = PolyCollection(shapes, facecolors=colors, edgecolors="none", zorder=1 + order)
            axes.add_collection(faces)
    try:
        figure.savefig(path, dpi=100)
    except (OSError, ValueError) as error:
        raise SettingsError(describe(str(path), "cannot be drawn", str(error))) from error
    finally:
        plt.close(figure)


def people(simulation: Simulation, camera: Camera) -> Iterator[tuple[float, str, Any, Any, Any]]:
    """Segments of each person with a shadow, as (depth, "lines", lines, colours, widths)."""
    skeleton = simulation.model.skeleton
    chosen = [
        joint
        for joint, name in enumerate(skeleton.joint_names)
        if joint and not any(part in name for part in FINGER_PARTS)
    ]
    width = np.array([width_of(skeleton.joint_names[joint]) for joint in chosen])
    joints = simulation.joint_positions_world()
    palette = np.random.default_rng(5)
    tops, trousers = palette.uniform(0.15, 0.85, (2, len(joints), 3))
    for row in np.flatnonzero(simulation.state.is_active):
        segments = np.stack([joints[row, skeleton.parent[chosen]], joints[row, chosen]], axis=1)
        head = joints[row, skeleton.joint("head")]
        segments = np.concatenate([segments, [[head, head + (0.0, 0.13, 0.0)]]])
        lines, depth = camera.project(segments)
        if camera.eye[1] < 0 or (depth < 0.5).any():
            continue
        on_ground = segments * (1.0, 0.0, 1.0) + (0.12, 0.01, 0.08) * segments[..., 1:2]
        shadows, _ = camera.project(on_ground)
        size = np.append(width, 0.19) / depth.mean() * camera.zoom
        names = [skeleton.joint_names[joint] for joint in chosen]
        colors = [color_of(name, tops[row], 0.6 * trousers[row]) for name in names] + [SKIN]
        yield float(depth.mean()) + 0.5, "lines", shadows, [SHADOW] * len(shadows), 0.8 * size
        yield float(depth.mean()), "lines", lines, colors, size


def width_of(joint_name: str) -> float:
    """Width of the segment above a joint, m."""
    return next((width for part, width in WIDTHS.items() if part in joint_name), LIMB_WIDTH)


def color_of(joint_name: str, top: FloatArray, trousers: FloatArray) -> Any:
    """Colour of the segment above a joint: skin, top, trousers or shoes."""
    if "toe" in joint_name:
        return (0.15, 0.13, 0.12)
    if any(part in joint_name for part in ("foot", "shank", "thigh")):
        return trousers
    if any(part in joint_name for part in ("head", "neck", "hand")):
        return SKIN
    return top


def obstacles(simulation: Simulation, camera: Camera) -> Iterator[tuple[float, str, Any, Any, Any]]:
    """Sides and top of each obstacle, as (depth, "faces", polygons, colours, None)."""
    for shape in simulation.model.world.obstacles:
        outline = shape.outline()
        height = min(shape.height, 2.5)
        low = np.insert(outline, 1, 0.0, axis=1)
        high = np.insert(outline, 1, height, axis=1)
        count = len(outline) if not isinstance(shape, Wall) else 1
        faces = []
        for edge in range(count):
            other = (edge + 1) % len(outline)
            face = np.array([low[edge], low[other], high[other], high[edge]])
            shade = 0.55 + 0.15 * abs(np.cos(np.arctan2(*(outline[other] - outline[edge]))))
            faces.append((face, (shade, shade, 0.95 * shade)))
        if not isinstance(shape, Wall):
            faces.append((high, (0.78, 0.78, 0.75)))
        faces.sort(key=lambda entry: -float(camera.project(entry[0])[1].mean()))
        polygons = [camera.project(face)[0] for face, _ in faces]
        yield float(camera.project(low)[1].mean()), "faces", polygons, [color for _, color in faces], None
