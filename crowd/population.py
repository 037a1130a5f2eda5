"""Who is in the scene: people enter, walk through their goal lists, wait, leave, come back through flows."""

from typing import Protocol

import numpy as np
import numpy.typing as npt

from crowd.commands import Commands
from crowd.controllers.controller import Step
from crowd.model import Model
from crowd.scenario import PlacedFlow
from crowd.state import BoolArray, FloatArray, IntArray, State
from crowd_kernels.random import uniform

PURPOSE_FLOW_X = 301
PURPOSE_FLOW_Z = 302
PURPOSE_GOAL_X = 303
PURPOSE_GOAL_Z = 304
ENTRY_ATTEMPTS = 8
ENTRY_GAP = 0.05
"""Least gap between a person who enters and all others, m."""
STALLED_SPEED = 0.2
"""A person slower than this, m/s, close to an occupied goal for long enough counts as arrived."""
STALLED_DISTANCE_RADII = 8.0
STALLED_TIME = 3.0


class GoalReceiver(Protocol):
    """Whoever routes people to their goals."""

    def set_goals(
        self, characters: IntArray, goal_world: FloatArray, radius: FloatArray, position_world: FloatArray
    ) -> None:
        """Route characters to new goals."""


class Population:
    """Lets people in and out and hands them from goal to goal."""

    def __init__(self, model: Model, seed: int, routing: GoalReceiver) -> None:
        self.model = model
        self.placed = model.placed
        self.seed = seed
        self.stays_at_goal = ~model.placed.leaves_at_goal
        """The character stops at its last goal. (character,)"""
        self.routing = routing
        self.has_tasks: BoolArray = np.zeros(model.capacity, np.bool_)
        """The character does a list of tasks, which say when it is finished. (character,)"""
        self.stalled_time: FloatArray = np.zeros(model.capacity)
        """How long a person has stood close to its goal without getting on, s. (character,)"""
        self.flow_entered: npt.NDArray[np.int64] = np.zeros(len(model.placed.flows), np.int64)
        """People that each flow has let in. (flow,)"""

    def state_fields(self) -> dict[str, npt.NDArray[np.generic]]:
        """Arrays that change in a run."""
        return {
            "stalled_time": self.stalled_time,
            "flow_entered": self.flow_entered,
            "has_tasks": self.has_tasks,
        }

    def active(self, state: State) -> IntArray:
        """Rows of people in the scene, ascending."""
        return np.flatnonzero(state.is_active).astype(np.int32)

    def first_people(self) -> IntArray:
        """Rows of people who are there from the start."""
        return np.flatnonzero(~self.placed.is_from_flow).astype(np.int32)

    def expects_more(self) -> bool:
        """A flow may still let people in."""
        return any(
            flow.limit is None or entered < flow.limit
            for flow, entered in zip(self.placed.flows, self.flow_entered, strict=True)
        )

    def enter(self, state: State, rows: IntArray, position_world: FloatArray, yaw: FloatArray) -> None:
        """Put people into the scene, standing."""
        state.clear(rows)
        state.spawn_count[rows] += 1
        state.is_active[rows] = True
        state.position_world[rows] = position_world
        state.previous_position_world[rows] = position_world
        state.yaw[rows] = yaw
        state.wanted_speed[rows] = self.model.people.preferred_speed[rows]
        state.way_point_world[rows] = position_world
        self.stalled_time[rows] = 0.0
        has_goal = self.placed.goal_count[rows] > 0
        state.is_finished[rows[~has_goal]] = True
        self._send(state, rows[has_goal])

    def newcomers(self, step: Step) -> IntArray:
        """Let people in through the flows whose time has come; returns their rows."""
        entered: list[int] = []
        for index, flow in enumerate(self.placed.flows):
            due = int(max(step.time - flow.start_at, 0.0) * flow.rate + 1e-9)
            if flow.limit is not None:
                due = min(due, flow.limit)
            while self.flow_entered[index] < due:
                row = self._enter_through(flow, step)
                if row is None:
                    break
                self.flow_entered[index] += 1
                entered.append(row)
        return np.array(entered, np.int32)

    def _enter_through(self, flow: PlacedFlow, step: Step) -> int | None:
        """Let one person in where the source has room; None when all places or slots are taken."""
        state, radius = step.state, self.model.people.radius
        free = flow.slots[~state.is_active[flow.slots]]
        if free.size == 0:
            return None
        row = int(free[0])
        present = np.flatnonzero(state.is_active)
        low_x, high_x = flow.source.x
        low_z, high_z = flow.source.z
        for attempt in range(ENTRY_ATTEMPTS):
            key = step.index * ENTRY_ATTEMPTS + attempt
            x = low_x + (high_x - low_x) * uniform(self.seed, row, key, PURPOSE_FLOW_X)
            z = low_z + (high_z - low_z) * uniform(self.seed, row, key, PURPOSE_FLOW_Z)
            place = np.array([[x, 0.0, z]])
            if not self.model.world.is_walkable(place, radius[row])[0]:
                continue
            away = state.position_world[present] - place
            if (np.hypot(away[:, 0], away[:, 2]) > radius[present] + radius[row] + ENTRY_GAP).all():
                rows = np.array([row], np.int32)
                self.enter(state, rows, place, self.placed.yaw[rows])
                return row
        return None

    def decide(self, step: Step, commands: Commands) -> None:
        """Hand people who have arrived to their next goal, let them wait, finish or leave; start plays."""
        for clip, characters in self.placed.plays.between(step.time - step.dt, step.time):
            commands.play(characters[step.state.is_active[characters]], clip)
        state, placed = step.state, self.placed
        walking = step.active[state.wants_to_walk[step.active]]
        arrived = walking[self._has_arrived(state, walking, step.dt)]
        if arrived.size:
            in_list = arrived[state.goal_index[arrived] < placed.goal_count[arrived]]
            goal = placed.first_goal[in_list] + state.goal_index[in_list]
            state.wait_until[in_list] = step.time + placed.goal_wait[goal]
            state.goal_index[in_list] += 1
            state.wants_to_walk[arrived] = False
            is_done = state.goal_index[arrived] >= placed.goal_count[arrived]
            begins_again = placed.repeats_goals[arrived] & (placed.goal_count[arrived] > 0)
            state.goal_index[arrived[is_done & begins_again]] = 0
            finished = arrived[is_done & ~begins_again & ~self.has_tasks[arrived]]
            state.is_finished[finished] = True
            state.is_active[finished[placed.leaves_at_goal[finished]]] = False
        waiting = step.active[state.is_active[step.active] & ~state.wants_to_walk[step.active]]
        has_more = ~state.is_finished[waiting] & (placed.goal_count[waiting] > 0)
        self._send(state, waiting[has_more & (state.wait_until[waiting] <= step.time)])

    def send(self, state: State, rows: IntArray, goal_world: FloatArray, radius: FloatArray) -> None:
        """Route people to points outside their goal lists; arriving there finishes them."""
        state.goal_world[rows] = goal_world
        state.goal_radius[rows] = radius
        state.goal_index[rows] = self.placed.goal_count[rows]
        state.wanted_speed[rows] = self.model.people.preferred_speed[rows]
        state.is_finished[rows] = False
        state.wants_to_walk[rows] = True
        self.stalled_time[rows] = 0.0
        self.routing.set_goals(rows, goal_world, self.model.people.radius[rows], state.position_world)

    def _send(self, state: State, rows: IntArray) -> None:
        """Route people to the present goal of their lists."""
        if rows.size == 0:
            return
        placed, people = self.placed, self.model.people
        goal = placed.first_goal[rows] + state.goal_index[rows]
        state.goal_world[rows] = self._goal_points(state, rows, goal)
        state.goal_radius[rows] = placed.goal_radius[goal]
        speed = placed.goal_speed[goal]
        state.wanted_speed[rows] = np.where(np.isnan(speed), people.preferred_speed[rows], speed)
        state.wants_to_walk[rows] = True
        self.stalled_time[rows] = 0.0
        self.routing.set_goals(rows, state.goal_world[rows], people.radius[rows], state.position_world)

    def _goal_points(self, state: State, rows: IntArray, goal: npt.NDArray[np.int64]) -> FloatArray:
        """Points of goals; in a goal area each visit draws its own free point."""
        placed, world = self.placed, self.model.world
        points = placed.goal_world[goal].copy()
        for index in np.flatnonzero(placed.goal_is_area[goal]):
            row, area = int(rows[index]), placed.goal_area[goal[index]]
            visit = int(state.visit_count[row])
            points[index, 0] = area[0] + (area[1] - area[0]) * uniform(self.seed, row, visit, PURPOSE_GOAL_X)
            points[index, 2] = area[2] + (area[3] - area[2]) * uniform(self.seed, row, visit, PURPOSE_GOAL_Z)
            points[index] = world.nearest_walkable(points[index][None], self.model.people.radius[row])[0]
        state.visit_count[rows] += 1
        return points

    def _has_arrived(self, state: State, walking: IntArray, dt: float) -> BoolArray:
        """Who is at the goal, or has stood long before a goal that others occupy."""
        away_x, _, away_z = (state.goal_world - state.position_world).take(walking, axis=0).T
        square = away_x * away_x + away_z * away_z
        goal_radius = state.goal_radius[walking]
        near = STALLED_DISTANCE_RADII * self.model.people.radius[walking] + goal_radius
        speed_x, _, speed_z = state.velocity_world.take(walking, axis=0).T
        is_stalled = speed_x * speed_x + speed_z * speed_z < STALLED_SPEED**2
        is_stalled &= (square < near * near) & self.stays_at_goal[walking]
        self.stalled_time[walking] = np.where(is_stalled, self.stalled_time[walking] + dt, 0.0)
        is_there = square < goal_radius * goal_radius
        return np.asarray(is_there | (self.stalled_time[walking] > STALLED_TIME))
