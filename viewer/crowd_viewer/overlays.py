"""What lines in the scene show of people: where they want to go, what holds them back, how they stand."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from crowd.motion.rotation import about, multiply, rotate
from crowd.simulation import Simulation
from crowd_viewer.frame import CrowdFrame, Quantity, Scene
from crowd_viewer.joint_limits import limit_arcs
from crowd_viewer.lines import Colour, Lines

FloatArray = npt.NDArray[np.float64]
RowArray = npt.NDArray[np.intp]

ABOVE_GROUND = np.array([0.0, 0.03, 0.0])
NEAREST_COUNT = 400
"""People nearest to the target of the camera who get lines."""
SKELETON_COUNT, WAY_COUNT = 60, 40
LARGEST_SPEED = 2.5
"""Half-planes are drawn up to this speed around the picked person; 1 m/s is 1 m on the ground."""
HATCHES = 14
MOST_PRINTS = 3000
PRINT_SECONDS = 6.0
NEIGHBOUR_REACH = 5.0
CONTACT_COLOURS: tuple[Colour, ...] = ((0.5, 0.5, 0.5, 0.5), (1.0, 0.6, 0.1, 0.9), (0.2, 0.9, 0.4, 0.9))
WALKED, WANTED, WAY, GOAL = (
    (1.0, 0.75, 0.1, 1.0),
    (0.3, 1.0, 0.4, 0.8),
    (0.4, 1.0, 0.5, 0.9),
    (1.0, 0.3, 0.35, 0.6),
)
OTHERS, WALLS = (0.85, 0.5, 1.0, 0.9), (1.0, 0.45, 0.3, 0.9)
DISC, PICKED = (0.2, 0.9, 1.0, 0.8), (1.0, 0.8, 0.1, 1.0)
GAZE, REACH = (0.3, 0.95, 1.0, 0.9), (1.0, 0.35, 0.9, 1.0)


@dataclass(frozen=True)
class Seen:
    """What a layer may draw from.

    Attributes
    ----------
    frame : CrowdFrame
    scene : Scene
    rows : (R,) intp
        People near the target of the camera, the nearest first.
    picked : int
        Slot of the picked person, -1 for nobody.
    quantity : callable
        A quantity of `State` at this moment, by name; None where it is not known.
    simulation : Simulation or None
        None for a recording.
    """

    frame: CrowdFrame
    scene: Scene
    rows: RowArray
    picked: int
    quantity: Quantity
    simulation: Simulation | None

    @property
    def place(self) -> FloatArray:
        """Where `rows` are, a little above the ground, m. (R, 3)."""
        return np.asarray(self.frame.position_world[self.rows] + ABOVE_GROUND)

    def of_rows(self, name: str) -> npt.NDArray[Any] | None:
        """A quantity of `rows`."""
        values = self.quantity(name)
        return None if values is None else values[self.rows]


class Overlays:
    """Layers of lines that can be switched one by one; what a recording does not hold is left out."""

    def __init__(self) -> None:
        self.shown: set[str] = set()
        self.prints = Footprints()

    def toggle(self, name: str) -> None:
        """Switch a layer."""
        self.shown ^= {name}

    def draw(self, lines: Lines, seen: Seen) -> None:
        """Add the lines of all layers that are shown."""
        for name, draw in LAYERS.items():
            if name in self.shown:
                draw(lines, seen)
        if "feet" in self.shown:
            self.prints.draw(lines, seen)
        if seen.picked >= 0:
            place = seen.frame.position_world[[seen.picked]] + ABOVE_GROUND
            lines.circles(place, np.array([0.45]), PICKED, 32)


def nearest_people(frame: CrowdFrame, target: FloatArray) -> RowArray:
    """Slots of the people nearest to a point, the nearest first."""
    rows = np.flatnonzero(frame.is_active)
    away = ((frame.position_world[rows] - target) ** 2).sum(axis=1)
    return rows[np.argsort(away, kind="stable")[:NEAREST_COUNT]]


def joint_positions(frame: CrowdFrame, rows: npt.NDArray[np.integer[Any]]) -> FloatArray:
    """Joints of some people in world space, m. (R, J, 3)."""
    turned = rotate(about(1, frame.yaw[rows])[:, None], frame.joint_position_model[rows].astype(np.float64))
    return np.asarray(turned + frame.position_world[rows][:, None])


def joint_rotations(frame: CrowdFrame, rows: npt.NDArray[np.integer[Any]]) -> FloatArray:
    """Rotations of the joints of some people in world space. (R, J, 4)."""
    return np.asarray(
        multiply(about(1, frame.yaw[rows])[:, None], frame.joint_rotation_model[rows].astype(np.float64))
    )


# ---- layers


def _velocities(lines: Lines, seen: Seen) -> None:
    """Realised velocities, and those that avoidance asks for."""
    for name, colour in (("velocity_world", WALKED), ("desired_velocity_world", WANTED)):
        velocity = seen.of_rows(name)
        if velocity is not None:
            lines.arrows(seen.place, velocity.astype(np.float64), colour)


def _ways(lines: Lines, seen: Seen) -> None:
    """The way over its corners, the way point, and the goal: of the picked person, or of those nearby."""
    goals, walk = seen.quantity("goal_world"), seen.quantity("wants_to_walk")
    if goals is None or walk is None:
        return
    rows = np.array([seen.picked]) if seen.picked >= 0 else seen.rows[:WAY_COUNT]
    rows = rows[walk[rows]]
    place, goal = seen.frame.position_world[rows] + ABOVE_GROUND, goals[rows] + ABOVE_GROUND
    lines.circles(goal, np.full(len(goal), 0.15), GOAL, 8)
    if seen.simulation is None:
        lines.add(place, goal, (*GOAL[:3], 0.35))
        return
    routing = seen.simulation.navigator.routing
    way_point = seen.simulation.state.way_point_world[rows] + ABOVE_GROUND
    lines.add(place, way_point, WAY)
    lines.circles(way_point, np.full(len(goal), 0.1), WAY, 8)
    for row, begin in zip(rows.tolist(), way_point, strict=True):
        corners = routing.corner[row, routing.corner_index[row] : routing.corner_count[row]]
        path = np.zeros((len(corners) + 1, 3))
        path[0], path[1:, [0, 2]] = begin, corners
        lines.path(path * (1.0, 0.0, 1.0) + ABOVE_GROUND, (*WAY[:3], 0.45))


def _discs(lines: Lines, seen: Seen) -> None:
    """The bodies that avoidance knows."""
    lines.circles(seen.place, seen.scene.radius[seen.rows], DISC)


def _neighbours(lines: Lines, seen: Seen) -> None:
    """Links from the picked person to whom it avoids."""
    if seen.picked < 0:
        return
    count, reach = 10, NEIGHBOUR_REACH
    if seen.simulation is not None:
        settings = seen.simulation.navigator.avoidance.settings
        count, reach = settings.neighbor_count, settings.neighbor_distance
    everyone = np.flatnonzero(seen.frame.is_active)
    others = everyone[everyone != seen.picked]
    away = np.linalg.norm(seen.frame.position_world[others] - seen.frame.position_world[seen.picked], axis=1)
    near = others[np.argsort(away, kind="stable")[:count]]
    near = near[np.sort(away, kind="stable")[:count] < reach]
    start = np.broadcast_to(seen.frame.position_world[seen.picked] + ABOVE_GROUND, (len(near), 3))
    lines.add(start, seen.frame.position_world[near] + ABOVE_GROUND, OTHERS)


def _half_planes(lines: Lines, seen: Seen) -> None:
    """Velocities that are left to the picked person: the side without hatches."""
    simulation, row = seen.simulation, seen.picked
    if simulation is None or row < 0:
        return
    planes, wall_count = simulation.navigator.half_planes(
        simulation.state, row, simulation.dt, simulation.seed
    )
    middle = seen.frame.position_world[row] + ABOVE_GROUND
    lines.circles(middle[None], np.array([LARGEST_SPEED]), (1.0, 1.0, 1.0, 0.5), 48)
    for number, (x, z, dx, dz) in enumerate(planes):
        colour = WALLS if number < wall_count else OTHERS
        # The chord of the circle of speeds.
        along = -(x * dx + z * dz)
        nearest = np.array([x + along * dx, 0.0, z + along * dz])
        left = LARGEST_SPEED**2 - float(nearest @ nearest)
        if left <= 0.0:
            continue
        chord = np.linspace(-1.0, 1.0, HATCHES)[:, None] * np.sqrt(left) * np.array([dx, 0.0, dz]) + nearest
        lines.add(middle + chord[:1], middle + chord[-1:], colour)
        lines.add(
            middle + chord, middle + chord + 0.12 * np.array([dz + dx, 0.0, dz - dx]), (*colour[:3], 0.5)
        )
    for name, colour in (("velocity_world", WALKED), ("desired_velocity_world", WANTED)):
        lines.arrows(middle[None], getattr(simulation.state, name)[[row]], colour)


def _feet(lines: Lines, seen: Seen) -> None:
    """Soles by their contact, and the points at which feet are locked."""
    points, contact = seen.of_rows("foot_point_world"), seen.of_rows("foot_contact")
    if points is None or contact is None:
        return
    for kind, colour in enumerate(CONTACT_COLOURS):
        chosen = points[contact == kind].astype(np.float64)
        lines.add(chosen[:, 0] + 0.01, chosen[:, 1] + 0.01, colour)
    if seen.simulation is not None and hasattr(seen.simulation, "foot_lock"):
        lock = seen.simulation.foot_lock
        held = (lock.contact[seen.rows] > 0) & ~lock.is_released[seen.rows]
        anchor = np.zeros((int(held.sum()), 3))
        anchor[:, [0, 2]] = lock.anchor[seen.rows][held]
        lines.circles(anchor + ABOVE_GROUND, np.full(len(anchor), 0.05), CONTACT_COLOURS[2], 10)


def _skeletons(lines: Lines, seen: Seen) -> None:
    rows = seen.rows[:SKELETON_COUNT]
    joints = joint_positions(seen.frame, rows)
    child = np.arange(1, seen.scene.skeleton.joint_count)
    start, end = joints[:, seen.scene.skeleton.parent[child]], joints[:, child]
    lines.add(start.reshape(-1, 3), end.reshape(-1, 3), (1.0, 1.0, 1.0, 0.9))


def _joint_limits(lines: Lines, seen: Seen) -> None:
    """How far the joints of the picked person may turn, and how far they have turned."""
    if seen.picked >= 0:
        row = np.array([seen.picked])
        position, rotation = joint_positions(seen.frame, row)[0], joint_rotations(seen.frame, row)[0]
        for start, end, colour in limit_arcs(seen.scene.skeleton, position, rotation):
            lines.add(start, end, colour)


def _targets(lines: Lines, seen: Seen) -> None:
    """What people look at, and what they reach for, where layers for it say so."""
    skeleton = seen.scene.skeleton
    joints = joint_positions(seen.frame, seen.rows)
    gaze, share = seen.of_rows("gaze_target_world"), seen.of_rows("gaze_weight")
    if gaze is not None and share is not None:
        looks = share > 0.0
        eyes = joints[:, [skeleton.joint("left_eye"), skeleton.joint("right_eye")]].mean(axis=1)
        lines.add(eyes[looks], gaze[looks].astype(np.float64), GAZE)
    target, stage = seen.of_rows("reach_target_world"), seen.of_rows("reach_stage")
    if target is not None and stage is not None:
        for side, name in enumerate(("right_hand", "left_hand")):
            reaches = stage[:, side] > 0
            points = target[reaches, side].astype(np.float64)
            lines.add(joints[reaches, skeleton.joint(name)], points, (*REACH[:3], 0.5))
            for axis in 0.06 * np.eye(3):
                lines.add(points - axis, points + axis, REACH)


LAYERS: Mapping[str, Callable[[Lines, Seen], None]] = {
    "velocity": _velocities,
    "way": _ways,
    "disc": _discs,
    "neighbours": _neighbours,
    "half-planes": _half_planes,
    "feet": _feet,
    "skeleton": _skeletons,
    "limits": _joint_limits,
    "targets": _targets,
}


class Footprints:
    """Where feet were put down lately: heel to ball, fading."""

    def __init__(self) -> None:
        self._contact: npt.NDArray[np.uint8] | None = None
        self._ends: FloatArray = np.zeros((0, 2, 3))
        self._time: FloatArray = np.zeros(0)
        self._now = 0.0

    def draw(self, lines: Lines, seen: Seen) -> None:
        """Note the feet that have been put down since the last picture, and draw all prints."""
        contact, points = seen.quantity("foot_contact"), seen.quantity("foot_point_world")
        if contact is None or points is None:
            return
        time = seen.frame.time
        if time < self._now or self._contact is None:
            self._ends, self._time = self._ends[:0], self._time[:0]
            self._contact = contact.copy()
        is_new = (contact == 2) & (self._contact != 2)
        is_new[~seen.frame.is_active] = False
        self._contact, self._now = contact.copy(), time
        self._ends = np.concatenate([self._ends, points[is_new].astype(np.float64)])[-MOST_PRINTS:]
        self._time = np.concatenate([self._time, np.full(int(is_new.sum()), time)])[-MOST_PRINTS:]
        age = (time - self._time) / PRINT_SECONDS
        self._ends, self._time, age = self._ends[age < 1.0], self._time[age < 1.0], age[age < 1.0]
        for low in (0.0, 0.25, 0.5, 0.75):
            chosen = self._ends[(age >= low) & (age < low + 0.25)]
            lines.add(chosen[:, 0] + 0.01, chosen[:, 1] + 0.01, (0.95, 0.95, 1.0, 0.6 - 0.55 * low))
