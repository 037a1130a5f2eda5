"""Where to and how fast: way points, preferred velocity, avoidance, and bodies kept apart."""

import math
from typing import Any

import numpy as np

from crowd.controllers.controller import Step
from crowd.model import Model
from crowd.navigation.avoidance import Avoidance, AvoidanceSettings
from crowd.navigation.half_planes import half_planes
from crowd.navigation.patience import Patience
from crowd.navigation.routing import Routing, RoutingSettings
from crowd.scenario import PlacedCharacters, Scenario
from crowd.state import FloatArray, State
from crowd_kernels.locomotion import prefer_crowd

BRAKING_TIME = 0.8
"""Remaining distance over speed from which on people slow down before a goal at which they stay, s."""
FULL_SPEED_ANGLE = 0.7
"""A way this far to the side is walked at full speed, rad."""
NO_SPEED_ANGLE = 1.9
"""With the way farther behind than this, people turn before they walk, rad."""
HASTE = 1.2
"""Largest speed over the wanted one, so that people can hurry out of somebody's way."""
STANDING_RESPONSIBILITY = 0.1
"""Share of an avoidance that people who stand take on; those who walk take the rest."""
SHORTEST_MAXIMUM_SPEED = 0.6
"""Speed with which even people who stand can step aside, m/s."""


class Navigator:
    """The navigate and steer stages of a frame, and the projection of overlaps."""

    def __init__(self, model: Model, settings: AvoidanceSettings, *, turns_first: bool = True) -> None:
        capacity = model.capacity
        self.model = model
        # Plain discs have no facing that could hold them back.
        self._angles = (FULL_SPEED_ANGLE, NO_SPEED_ANGLE) if turns_first else (math.pi, 2.0 * math.pi)
        self.routing = Routing(model.world, capacity, shared_goals(model.placed))
        self.avoidance = Avoidance(settings, capacity)
        self.patience = Patience(capacity)
        self._responsibility = np.full(capacity, 0.5)
        self._stays_at_goal = ~model.placed.leaves_at_goal
        self._mobility = np.ones(capacity)
        self.deepest_overlap = 0.0
        """Deepest overlap that the last projection left, m."""
        self._maximum_speed = np.zeros(capacity)
        self._wanted_speed = np.zeros(capacity)

    def parts(self) -> tuple[tuple[str, Any], ...]:
        """Parts that keep state between steps, with names."""
        return (("routing", self.routing), ("patience", self.patience))

    def navigate(self, step: Step) -> None:
        """Find the next way point of everyone who walks."""
        state = step.state
        walking = step.active[state.wants_to_walk[step.active]]
        self.routing.way_points(
            state.position_world,
            walking,
            step.index,
            state.way_point_world,
            state.remaining_distance,
        )

    def steer(self, step: Step) -> None:
        """Choose the velocity nearest to the preferred one that avoids others and walls."""
        state = step.state
        np.multiply(state.wanted_speed, state.wants_to_walk, out=self._wanted_speed)
        prefer_crowd(
            state.position_world,
            state.yaw,
            state.way_point_world,
            state.remaining_distance,
            self._wanted_speed,
            self._stays_at_goal,
            step.active,
            BRAKING_TIME,
            *self._angles,
            state.preferred_velocity_world,
        )
        self._responsibility[:] = np.where(state.wants_to_walk, 0.5, STANDING_RESPONSIBILITY)
        self._mobility[:] = 1.0
        self.patience.update(
            state.position_world,
            state.preferred_velocity_world,
            step.active,
            step.dt,
            step.seed,
            step.index,
            self._responsibility,
            self._mobility,
        )
        # Nobody is pushed off a seat, or steps aside from there.
        sits = state.is_off_feet
        self._mobility[sits] = 0.0
        np.maximum(HASTE * self._wanted_speed, SHORTEST_MAXIMUM_SPEED, out=self._maximum_speed)
        self.avoidance.steer(
            state.position_world,
            state.velocity_world,
            state.preferred_velocity_world,
            self.model.people.radius,
            self._maximum_speed,
            self._responsibility,
            step.active,
            self.model.world.walls,
            step.dt,
            state.desired_velocity_world,
            seed=step.seed,
            step=step.index,
        )
        state.desired_velocity_world[sits] = 0.0

    def half_planes(self, state: State, character: int, dt: float, seed: int) -> tuple[FloatArray, int]:
        """What restricts one character's next velocity, see `crowd.navigation.half_planes`."""
        return half_planes(
            self.avoidance.settings,
            character,
            state.position_world,
            state.velocity_world,
            state.preferred_velocity_world,
            self.model.people.radius,
            self._maximum_speed,
            self._responsibility,
            np.flatnonzero(state.is_active).astype(np.int32),
            self.model.world.walls,
            dt,
            seed=seed,
        )

    def move_discs(self, step: Step) -> None:
        """Move plain discs by their desired velocity, instead of whole people by their animation."""
        state, rows = step.state, step.active
        state.previous_position_world[rows] = state.position_world[rows]
        state.position_world[rows] += step.dt * state.desired_velocity_world[rows]
        velocity = state.desired_velocity_world[rows]
        is_going = np.hypot(velocity[:, 0], velocity[:, 2]) > 1e-3
        heading = np.arctan2(velocity[:, 0], velocity[:, 2])
        state.yaw[rows] = np.where(is_going, heading, state.yaw[rows])

    def project(self, step: Step) -> None:
        """Push overlapping bodies apart and out of walls; the realised velocity includes the push."""
        state = step.state
        report = self.avoidance.project(
            state.position_world,
            state.previous_position_world,
            self.model.people.radius,
            self._mobility,
            step.active,
            self.model.world.walls,
            step.dt,
            seed=step.seed,
        )
        self.deepest_overlap = report.deepest_overlap
        moved = (state.position_world - state.previous_position_world) / step.dt
        np.copyto(state.velocity_world, moved, where=state.is_active[:, None])


def avoidance_settings(scenario: Scenario) -> AvoidanceSettings:
    """The engine's avoidance settings with what the scenario changes."""
    changed = {name: value for name, value in scenario.avoidance.model_dump().items() if value is not None}
    return AvoidanceSettings(**changed)


def shared_goals(placed: PlacedCharacters) -> FloatArray:
    """Goal points that enough characters have for a distance field to pay."""
    points = placed.goal_world[~placed.goal_is_area]
    unique, count = np.unique(points, axis=0, return_counts=True)
    return unique[count >= RoutingSettings().sharing]
