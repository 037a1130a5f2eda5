"""What lines in the scene show of people: velocities, ways, discs, footprints, skeletons."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from crowd.simulation import Simulation
from crowd_viewer.frame import CrowdFrame, Scene
from crowd_viewer.lines import Lines

FloatArray = npt.NDArray[np.float64]
ABOVE_GROUND = np.array([0.0, 0.03, 0.0])
NEAREST_COUNT = 400
"""People nearest to the target of the camera who get lines."""
NEIGHBOUR_REACH = 4.0
CONTACT_COLOURS = ((0.5, 0.5, 0.5, 0.5), (1.0, 0.6, 0.1, 0.9), (0.2, 0.9, 0.4, 0.9))


class Overlays:
    """Layers of lines that can be switched one by one; those of plans need a running simulation."""

    NAMES = ("velocity", "way", "disc", "neighbours", "feet", "skeleton")

    def __init__(self, simulation: Simulation | None) -> None:
        self.simulation = simulation
        self.shown: set[str] = set()

    def toggle(self, name: str) -> None:
        """Switch a layer."""
        self.shown ^= {name}

    def draw(self, lines: Lines, frame: CrowdFrame, scene: Scene, target: FloatArray, picked: int) -> None:
        """Add the lines of all layers that are shown."""
        rows = np.flatnonzero(frame.is_active)
        away = ((frame.position_world[rows] - target) ** 2).sum(axis=1)
        rows = rows[np.argsort(away, kind="stable")[:NEAREST_COUNT]]
        if "skeleton" in self.shown:
            _skeletons(lines, frame, scene, rows[:60])
        if 0 <= picked < len(frame.is_active) and frame.is_active[picked]:
            place = frame.position_world[[picked]] + ABOVE_GROUND
            lines.circles(place, np.array([0.45]), (1.0, 0.8, 0.1, 1.0), 32)
        if self.simulation is None:
            return
        state, people = self.simulation.state, self.simulation.model.people
        place = state.position_world[rows] + ABOVE_GROUND
        if "disc" in self.shown:
            lines.circles(place, people.radius[rows], (0.2, 0.9, 1.0, 0.8))
        if "velocity" in self.shown:
            lines.arrows(place, state.velocity_world[rows], (1.0, 0.75, 0.1, 1.0))
            lines.arrows(place, state.desired_velocity_world[rows], (0.3, 1.0, 0.4, 0.8))
        if "way" in self.shown:
            walks = state.wants_to_walk[rows]
            way_point = state.way_point_world[rows][walks] + ABOVE_GROUND
            lines.add(place[walks], way_point, (0.4, 1.0, 0.5, 0.7))
            lines.add(way_point, state.goal_world[rows][walks] + ABOVE_GROUND, (1.0, 0.3, 0.35, 0.35))
        if "feet" in self.shown:
            _footprints(lines, self.simulation, rows)
        if "neighbours" in self.shown and picked >= 0:
            here = state.position_world[picked]
            near = rows[np.linalg.norm(state.position_world[rows] - here, axis=1) < NEIGHBOUR_REACH]
            start = np.broadcast_to(here + ABOVE_GROUND, (len(near), 3))
            lines.add(start, state.position_world[near] + ABOVE_GROUND, (0.9, 0.5, 1.0, 0.8))


def joint_positions(frame: CrowdFrame, rows: npt.NDArray[np.intp]) -> FloatArray:
    """Joints of some people in world space, m. (R, J, 3)."""
    sine, cosine = np.sin(frame.yaw[rows])[:, None], np.cos(frame.yaw[rows])[:, None]
    x, y, z = np.moveaxis(frame.joint_position_model[rows].astype(np.float64), 2, 0)
    turned = np.stack([cosine * x + sine * z, y, cosine * z - sine * x], axis=2)
    return np.asarray(turned + frame.position_world[rows][:, None])


def _skeletons(lines: Lines, frame: CrowdFrame, scene: Scene, rows: npt.NDArray[np.intp]) -> None:
    joints = joint_positions(frame, rows)
    child = np.arange(1, scene.skeleton.joint_count)
    start, end = joints[:, scene.skeleton.parent[child]], joints[:, child]
    lines.add(start.reshape(-1, 3), end.reshape(-1, 3), (1.0, 1.0, 1.0, 0.9))


def _footprints(lines: Lines, simulation: Simulation, rows: npt.NDArray[np.intp]) -> None:
    points, contact = simulation.state.foot_point_world[rows], simulation.state.foot_contact[rows]
    for kind, colour in enumerate(CONTACT_COLOURS):
        chosen = points[contact == kind]
        lines.add(chosen[:, 0] + 0.01, chosen[:, 1] + 0.01, colour)
