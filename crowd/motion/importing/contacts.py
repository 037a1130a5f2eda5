"""Which foot is down when: contacts of heel, ball and toe of a source motion, and its foot events."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from crowd.motion.clip import FootEvent
from crowd.motion.importing.axes import PosedSource
from crowd.motion.importing.joint_names import JointMap
from crowd.motion.importing.retarget import middle_of_stances, runs, sole_depth
from crowd.motion.rotation import rotate

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

HEEL, BALL, TOE = 0, 1, 2
LOW = 0.035
"""A point is down within this of its own lowest height, m."""
SLOW = 0.3
"""A point that is slower is down, m/s."""
SPEED_SHARES = (0.6, 0.3, 0.3)
"""Heel, ball and toe are also down below this share of the speed of travel: captured feet slide."""
CLIMB = 0.12
"""Where the pelvis ends so much higher or lower, the ground is not level and heights tell nothing, m."""
SHORTEST_GAP, SHORTEST_CONTACT = 0.07, 0.08
"""Shorter interruptions and touches are noise, s."""
HEEL_BEHIND, BALL_AHEAD, TOE_AHEAD = 0.06, 0.13, 0.19
"""Points of a foot whose joints are missing, m from the ankle at rest."""


@dataclass(frozen=True)
class Contacts:
    """Contacts of the feet of one motion.

    Attributes
    ----------
    is_down : (F, 2, 3) bool
        Right and left foot; heel, ball, toe.
    foot_is_down : (F, 2) bool
        Some point of the foot is down; short gaps and touches are left out.
    points : (F, 2, 3, 3) float64
        The points, m.
    ground : float
        Height of the ground, m.
    is_loop : bool
        The motion goes on with its first frame after the last.
    """

    is_down: BoolArray
    foot_is_down: BoolArray
    points: FloatArray
    ground: float
    is_loop: bool

    @property
    def foot_is_flat(self) -> BoolArray:
        """Heel and ball of the right and left foot are down, (F, 2)."""
        return np.asarray(self.is_down[:, :, HEEL] & self.is_down[:, :, BALL])


def find_contacts(source: PosedSource, joints: JointMap, is_loop: bool) -> Contacts:
    """Find when each point of each foot is down.

    Parameters
    ----------
    source : PosedSource
    joints : JointMap
    is_loop : bool
        The last frame repeats the first; contacts are joined over the seam.

    Notes
    -----
    A point is down when it is near its own lowest height and slow, in absolute terms or against the speed of
    travel. Its own lowest height, because soles of captured characters float and sink by centimetres.
    """
    points = foot_points_of(source, joints)
    rate = source.frame_rate
    frames = len(points)
    if frames < 3:
        always = np.ones((frames, 2, 3), bool)
        return Contacts(always, always[..., 0], points, float(points[..., 1].min()), is_loop)
    speed = np.linalg.norm(np.gradient(points, 1.0 / rate, axis=0), axis=-1)
    hips = source.position[:, joints.joint["pelvis"]]
    path_speed = np.hypot(np.diff(hips[:, 0]), np.diff(hips[:, 2])).sum() * rate / (frames - 1)
    limit = np.maximum(SLOW, np.array(SPEED_SHARES) * path_speed)
    is_down = speed < limit
    if abs(hips[-1, 1] - hips[0, 1]) < CLIMB:
        is_down &= points[..., 1] < points[..., 1].min(axis=0) + LOW
    feet = [cleaned(is_down[:, foot].any(axis=1), rate, is_loop) for foot in range(2)]
    return Contacts(is_down, np.stack(feet, axis=1), points, ground_height(points, is_down), is_loop)


def foot_points_of(source: PosedSource, joints: JointMap) -> FloatArray:
    """Heel, ball and toe of the right and left foot, (F, 2, 3, 3), m."""
    depth = sole_depth(source, joints)
    rest = source.rest_position
    result = np.zeros((len(source.position), 2, 3, 3))
    for foot, side in enumerate(("right", "left")):
        ankle = joints.joint[f"{side}_foot"]
        position, turned = source.position[:, ankle], source.turned[:, ankle]

        def carried(
            offset: FloatArray, position: FloatArray = position, turned: FloatArray = turned
        ) -> FloatArray:
            return np.asarray(position + rotate(turned, offset))

        toe = joints.joint.get(f"{side}_toe")
        end = joints.joint.get(f"{side}_toe_end")
        ahead = np.array([0.0, 0.0, 1.0])
        if toe is not None and np.linalg.norm(rest[toe] - rest[ankle]) > 0.02:
            way = (rest[toe] - rest[ankle]) * (1.0, 0.0, 1.0)
            ahead = way / max(float(np.linalg.norm(way)), 1e-9)
        down = np.array([0.0, -depth, 0.0])
        result[:, foot, HEEL] = carried(down - HEEL_BEHIND * ahead)
        ball = source.position[:, toe] if toe is not None else carried(down + BALL_AHEAD * ahead)
        result[:, foot, BALL] = ball
        if end is not None and toe is not None:
            result[:, foot, TOE] = source.position[:, end]
        elif toe is not None:
            low = np.array([0.0, rest[ankle, 1] - depth - rest[toe, 1], 0.0])
            beyond = rotate(source.turned[:, toe], low + (TOE_AHEAD - BALL_AHEAD) * ahead)
            result[:, foot, TOE] = source.position[:, toe] + beyond
        else:
            result[:, foot, TOE] = carried(down + TOE_AHEAD * ahead)
    return result


def cleaned(is_down: BoolArray, rate: float, is_loop: bool) -> BoolArray:
    """Close short gaps, then drop short contacts; around the seam too where the motion loops."""
    frames = len(is_down)
    body = np.tile(is_down[:-1], 3) if is_loop else is_down.copy()
    for begin, end in runs(~body):
        if begin > 0 and end < len(body) and end - begin < SHORTEST_GAP * rate:
            body[begin:end] = True
    for begin, end in runs(body):
        if begin > 0 and end < len(body) and end - begin < SHORTEST_CONTACT * rate:
            body[begin:end] = False
    if not is_loop:
        return np.asarray(body)
    middle = body[frames - 1 : 2 * (frames - 1)]
    return np.append(middle, middle[0])


def ground_height(points: FloatArray, is_down: BoolArray) -> float:
    """Median height of what is down, m; the lowest point if nothing is."""
    lowest = np.where(is_down, points[..., 1], np.nan)
    if not is_down.any():
        return float(points[..., 1].min())
    touching = [column[np.isfinite(column)] for column in lowest.reshape(-1, 6).T]
    return float(min(np.median(column) for column in touching if len(column)))


def intervals(is_down: BoolArray, rate: float, is_loop: bool) -> list[tuple[float, float]]:
    """First and last time of each run, s; in a loop each run is told once and may end after the duration."""
    if not is_loop:
        return [(begin / rate, (end - 1) / rate) for begin, end in runs(is_down)]
    period = len(is_down) - 1
    body = is_down[:-1]
    if body.all():
        return [(0.0, period / rate)]
    doubled = np.tile(body, 2)
    return [
        (begin / rate, (end - 1) / rate)
        for begin, end in runs(doubled)
        if begin < period and not (begin == 0 and body[-1])
    ]


def sole_heights(contacts: Contacts) -> FloatArray:
    """Height of the lowest point of the right and the left foot over the ground, (F, 2), m.

    By how much soles float or sink in the middle of their stances is taken off, also between them.
    """
    height = contacts.points[..., 1].min(axis=2) - contacts.ground
    frames = np.arange(len(height))
    for foot in range(2):
        middle = middle_of_stances(contacts.foot_is_down[:, foot])
        if middle.any():
            floating = np.interp(frames, frames[middle], height[middle, foot])
            height[:, foot] -= np.clip(floating, -LOW, LOW)
    return np.asarray(np.maximum(height, 0.0))


@dataclass(frozen=True)
class Stance:
    """One stance of a foot.

    Attributes
    ----------
    foot : int
        0 right, 1 left.
    strike, flat, rises, leaves : float
        Times, s: first contact, ball or toe down, heel up, last contact. Ends in a loop may lie beyond its
        duration.
    """

    foot: int
    strike: float
    flat: float
    rises: float
    leaves: float

    @property
    def events(self) -> tuple[tuple[float, FootEvent], ...]:
        """The four events of the stance."""
        kinds = list(FootEvent)[4 * self.foot : 4 * self.foot + 4]
        return tuple(zip((self.strike, self.flat, self.rises, self.leaves), kinds, strict=True))


def find_stances(contacts: Contacts, rate: float) -> list[Stance]:
    """Find all stances, by strike.

    A foot that lands on its toe is flat at once; one that never puts its heel down lifts it when flat.
    """
    found = []
    for foot in range(2):
        fore_foot = np.asarray(contacts.is_down[:, foot, BALL:].any(axis=1))
        for begin, end in intervals(contacts.foot_is_down[:, foot], rate, contacts.is_loop):
            if end <= begin:
                # What one frame at an end shows is no stance.
                continue
            front = within(fore_foot, begin, end, rate, contacts.is_loop)
            heel = within(contacts.is_down[:, foot, HEEL], begin, end, rate, contacts.is_loop)
            flat = front[0] if front else begin
            found.append(Stance(foot, begin, flat, max(heel[1], flat) if heel else flat, end))
    return sorted(found, key=lambda stance: (stance.strike, stance.foot))


def within(
    is_down: BoolArray, begin: float, end: float, rate: float, is_loop: bool
) -> tuple[float, float] | None:
    """First and last time, s, at which a point is down between two times."""
    frames = np.arange(round(begin * rate), round(end * rate) + 1)
    index = frames % (len(is_down) - 1) if is_loop else frames
    down = frames[is_down[index]]
    return (float(down[0] / rate), float(down[-1] / rate)) if len(down) else None
