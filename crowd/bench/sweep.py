"""Realised against commanded motion over the whole locomotion space, and jumps at changes of motion."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from crowd.blending.parameter_space import ParameterSpace
from crowd.metrics import FootMetrics, Observation
from crowd.motion.clip import ClipKind
from crowd.motion.library import MotionLibrary
from crowd.scenario.schema import Area, Character, Scenario, WorldTable
from crowd.simulation import Simulation

FloatArray = npt.NDArray[np.float64]

MOST_SPEED_RMS = 0.02
MOST_TURN_RMS_DEG_S = 1.0
MOST_DRIFT_MEAN = 0.01
MOST_DRIFT_P95 = 0.03
MOST_WEIGHT_JUMP = 1e-3
MOST_ACCELERATION_RATIO = 1.2
SPACING = 40.0
SETTLE_SECONDS = 4.0
MEASURE_CYCLES = 6
LOOK_STEPS = 50
SLOWEST = 0.3


@dataclass(frozen=True)
class SweepResult:
    """Figures of the sweep; `problems` names those outside their bounds."""

    points: int
    speed_rms_relative: float
    turn_rms_deg_s: float
    drift_mean_m: float
    drift_p95_m: float
    drift_max_m: float
    stances: int
    largest_weight_jump: float

    @property
    def problems(self) -> list[str]:
        """One line for each figure outside its bound."""
        bounds = (
            ("speed rms", self.speed_rms_relative, MOST_SPEED_RMS),
            ("turn rms deg/s", self.turn_rms_deg_s, MOST_TURN_RMS_DEG_S),
            ("mean drift m", self.drift_mean_m, MOST_DRIFT_MEAN),
            ("95 % drift m", self.drift_p95_m, MOST_DRIFT_P95),
            ("weight jump", self.largest_weight_jump, MOST_WEIGHT_JUMP),
        )
        return [f"{what}: {value:.4g}, allowed {bound:g}" for what, value, bound in bounds if value > bound]


def sweep_points(space: ParameterSpace, count: int, seed: int = 1) -> FloatArray:
    """Points all over the space, on its surface, and outside: (about count, 3)."""
    rng = np.random.default_rng(seed)
    low, high = space.parameters.min(axis=0), space.parameters.max(axis=0)
    spread = 0.5 * (low + high) + 0.6 * (high - low) * rng.uniform(-1, 1, (40 * count, 3))
    is_inside = space.locate(spread)[3]
    outside = spread[~is_inside][: count // 4]
    surface = space.locate(outside)[2]
    rest = count - len(space.parameters) - len(outside) - len(surface)
    return np.concatenate([space.parameters, spread[is_inside][:rest], outside, surface * 0.999])


def lone_people(count: int) -> Scenario:
    """People far from each other, on free ground."""
    side = int(np.ceil(np.sqrt(count)))
    half = 0.5 * side * SPACING
    places = [((i % side) * SPACING - half, (i // side) * SPACING - half) for i in range(count)]
    bounds = Area(x=(-half - 500.0, half + 500.0), z=(-half - 500.0, half + 500.0))
    return Scenario(
        name="sweep",
        world=WorldTable(bounds=bounds),
        characters=tuple(Character(position=place, facing=0.0) for place in places),
    )


def sweep(count: int = 300, motions: MotionLibrary | None = None) -> SweepResult:
    """Command constant parameters to many people and compare what their pelvis does over whole cycles.

    The pelvis is followed, so that the figure includes all that layers and foot locks do. Where it circles
    about the root, because somebody turns about a point beside it, the circling does not count as travel.
    """
    simulation = Simulation(lone_people(1), motions=motions)
    asked = sweep_points(simulation.model.space, count)
    simulation = Simulation(lone_people(len(asked)), motions=motions)
    # Everyone in the library's own proportions, so that a point means what the library says it means.
    people = simulation.model.people
    people.stride_scale[:], people.tempo[:], people.segment_scale[:] = 1.0, 1.0, 1.0
    realisable = simulation.model.space.locate(asked)[2]
    simulation.commands.set_locomotion(slice(None), asked)
    for _ in simulation.run(seconds=SETTLE_SECONDS):
        pass
    state = simulation.state
    feet = FootMetrics()
    cycles = MEASURE_CYCLES / state.cycle_rate
    begin, path, turn = simulation.time, np.zeros((len(asked), 2)), np.zeros(len(asked))
    is_measured = np.zeros(len(asked), bool)
    speed, rate = np.zeros(len(asked)), np.zeros(len(asked))
    root, yaw = state.position_world.copy(), state.yaw.copy()
    aside = ahead_and_left(simulation.joint_positions_world()[:, 0] - root, yaw)
    for frame in simulation.run(seconds=float(cycles.max()) + 0.1):
        turned = np.angle(np.exp(1j * (state.yaw - yaw)))
        now_aside = ahead_and_left(simulation.joint_positions_world()[:, 0] - state.position_world, state.yaw)
        path += ahead_and_left(state.position_world - root, yaw + 0.5 * turned) + now_aside - aside
        turn += turned
        root, yaw, aside = state.position_world.copy(), state.yaw.copy(), now_aside
        is_due = ~is_measured & (frame.time - begin >= cycles)
        elapsed = frame.time - begin
        speed[is_due] = np.hypot(*path[is_due].T) / elapsed
        rate[is_due] = turn[is_due] / elapsed
        is_measured |= is_due
        feet.add(observe(simulation, frame.time))
    wanted = np.hypot(realisable[:, 0], realisable[:, 2])
    walks = wanted > SLOWEST
    drift = feet.as_dict()
    return SweepResult(
        len(asked),
        float(np.sqrt(np.mean((speed[walks] / wanted[walks] - 1.0) ** 2))),
        float(np.degrees(np.sqrt(np.mean((rate - realisable[:, 1]) ** 2)))),
        drift["foot_slip.mean_m"],
        drift["foot_slip.p95_m"],
        drift["foot_slip.max_m"],
        int(drift["foot_slip.stances"]),
        largest_weight_jump(simulation.model.space),
    )


def ahead_and_left(way: FloatArray, yaw: FloatArray) -> FloatArray:
    """Components (N, 2) ahead and to the left of ways (N, 3) for people who face along `yaw` (N,)."""
    sine, cosine = np.sin(yaw), np.cos(yaw)
    return np.stack([way[:, 0] * sine + way[:, 2] * cosine, way[:, 0] * cosine - way[:, 2] * sine], axis=1)


def observe(simulation: Simulation, time: float) -> Observation:
    """The present state as metrics see it."""
    state, model = simulation.state, simulation.model
    return Observation(
        time,
        state.is_active,
        state.is_finished,
        state.spawn_count,
        state.position_world,
        state.yaw,
        model.radius,
        state.locomotion_parameter,
        state.locomotion_weight,
        state.foot_contact,
        state.foot_point_world,
        model.world.tree,
        0.0,
    )


def largest_weight_jump(space: ParameterSpace, lines: int = 200, seed: int = 3) -> float:
    """Largest jump of a weight along straight lines through and around the space.

    On each line the interval in which weights change most is halved until a continuous change would have
    vanished.
    """
    rng = np.random.default_rng(seed)
    low, high = space.parameters.min(axis=0), space.parameters.max(axis=0)
    middle, half = 0.5 * (low + high), 0.75 * (high - low)

    def weights(points: FloatArray) -> FloatArray:
        example, weight, _, _ = space.locate(points)
        dense = np.zeros((len(points), len(space.names)))
        np.add.at(dense, (np.arange(len(points))[:, None], example), weight)
        return dense

    largest = 0.0
    for _ in range(lines):
        start, end = middle + half * rng.uniform(-1, 1, (2, 3))
        shares = np.linspace(0.0, 1.0, 800)
        change = np.abs(np.diff(weights(start + shares[:, None] * (end - start)), axis=0)).max(axis=1)
        worst = int(change.argmax())
        a, b = shares[worst], shares[worst + 1]
        jump = float(change[worst])
        for _ in range(24):
            points = start + np.array([[a], [0.5 * (a + b)], [b]]) * (end - start)
            first, second = np.abs(np.diff(weights(points), axis=0)).max(axis=1)
            a, b = (a, 0.5 * (a + b)) if first >= second else (0.5 * (a + b), b)
            jump = float(max(first, second))
        largest = max(largest, jump)
    return largest


@dataclass(frozen=True)
class TransitionResult:
    """Largest angular acceleration of any joint, rad/s^2, in each manoeuvre and in the examples."""

    examples: float
    manoeuvres: dict[str, float]

    @property
    def problems(self) -> list[str]:
        """One line for each manoeuvre with a pop."""
        most = MOST_ACCELERATION_RATIO * self.examples
        return [
            f"{name}: {value:.0f} rad/s^2, allowed {most:.0f}"
            for name, value in self.manoeuvres.items()
            if value > most
        ]


MANOEUVRES: dict[str, tuple[tuple[float, tuple[float, float, float]], ...]] = {
    "start and stop": ((0.5, (1.35, 0, 0)), (4.0, (0, 0, 0))),
    "start to run and stop": ((0.5, (3.5, 0, 0)), (5.0, (0, 0, 0))),
    "turn on the spot": ((0.5, (0, 2.0, 0)), (2.0, (0, -2.0, 0)), (4.0, (0, 0, 0))),
    "change of speed": ((0.5, (0.7, 0, 0)), (2.5, (1.9, 0, 0)), (4.5, (3.0, 0, 0)), (6.5, (1.0, 0, 0))),
    "sidestep": ((0.5, (0, 0, 0.8)), (2.5, (0, 0, -0.8)), (4.5, (1.2, 0, 0))),
    "walk, turn, back up": ((0.5, (1.2, 1.2, 0)), (3.0, (-0.8, 0, 0)), (5.0, (1.2, -1.0, 0))),
}


def transitions(
    motions: MotionLibrary | None = None, seconds: float = 9.0, people: int = 16
) -> TransitionResult:
    """Run manoeuvres with people of all phases and compare their joints with the examples'."""
    results = {}
    library = None
    for name, commands in MANOEUVRES.items():
        simulation = Simulation(lone_people(people), motions=motions)
        library = simulation.model.library
        todo = list(commands)
        rotations = []
        for frame in simulation.run(seconds=seconds):
            # Everyone a little later than the one before, so that changes meet every phase of the gait.
            for at, parameters in todo:
                late = np.flatnonzero(
                    np.abs(frame.time - at - 0.07 * np.arange(people)) < 0.5 * simulation.dt
                )
                simulation.commands.set_locomotion(late, parameters)
            rotations.append(simulation.joint_rotations_local())
        results[name] = largest_acceleration(np.array(rotations)[20:], 1.0 / simulation.dt)
    results["look about while walking"] = look_about(motions, seconds, people)
    assert library is not None
    examples = max(
        largest_acceleration(clip.rotation_local[:, None], clip.frame_rate)
        for clip in library.clips
        if clip.kind in (ClipKind.LOCOMOTION, ClipKind.START, ClipKind.STOP)
    )
    return TransitionResult(examples, results)


def look_about(motions: MotionLibrary | None, seconds: float, people: int, seed: int = 1) -> float:
    """Largest angular acceleration of walkers who look at new points again and again, rad/s^2."""
    simulation = Simulation(lone_people(people), motions=motions)
    simulation.commands.set_locomotion(slice(None), (1.3, 0.2, 0.0))
    rng, rotations = np.random.default_rng(seed), []
    for frame in simulation.run(seconds=seconds):
        if frame.index % LOOK_STEPS == 0:
            looking = np.flatnonzero(rng.random(people) < 0.7)
            away = rng.normal(0.0, 3.0, (looking.size, 3)) + (0.0, 1.5, 0.0)
            simulation.commands.look_away(slice(None))
            simulation.commands.look_at(looking, simulation.state.position_world[looking] + away)
        rotations.append(simulation.joint_rotations_local())
    return largest_acceleration(np.array(rotations)[20:], 1.0 / simulation.dt)


def largest_acceleration(rotations: npt.NDArray[np.floating], rate: float) -> float:
    """Largest angular acceleration of (frame, person, joint, 4) unit quaternions, `rate` frames a second."""
    before, after = rotations[:-1].astype(np.float64), rotations[1:].astype(np.float64)
    w = (before * after).sum(axis=-1)
    vector = (
        before[..., :1] * after[..., 1:]
        - after[..., :1] * before[..., 1:]
        - np.cross(before[..., 1:], after[..., 1:])
    )
    vector *= np.where(w < 0, -1.0, 1.0)[..., None]
    sine = np.linalg.norm(vector, axis=-1, keepdims=True)
    velocity = vector * (2.0 * np.arctan2(sine, np.abs(w)[..., None]) / np.maximum(sine, 1e-12)) * rate
    acceleration = np.linalg.norm(np.diff(velocity, axis=0), axis=-1) * rate
    return float(acceleration.max())
