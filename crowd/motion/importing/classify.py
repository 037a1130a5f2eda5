"""What a clip serves, and the labels of its kind: when a jump leaves the ground, where a hand reaches to."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from crowd.motion.clip import ClipKind, JumpLabels, ReachLabels
from crowd.motion.importing.contacts import BALL, Contacts
from crowd.motion.importing.cycles import Window, heading_of, posed
from crowd.motion.importing.labels import JumpCorrection, ReachCorrection
from crowd.motion.importing.retarget import Retargeted, runs
from crowd.motion.rotation import about, rotate
from crowd.motion.skeleton import Skeleton

FloatArray = npt.NDArray[np.float64]

GRAVITY = 9.81
POSE_SECONDS, IDLE_SECONDS = 0.35, 1.5
"""A shorter clip is a pose; a shorter one is no idle, s."""
STILL_PELVIS, STILL_FOOT, STILL_TURN = 0.15, 0.6, 0.8
"""Somebody stands at an end of a clip when pelvis and both feet are slower, m/s, and turning is, rad/s."""
OFF_GROUND = 0.03
"""A foot is in the air when all its points are higher than at the start by this, m."""
SHORTEST_FLIGHT, SHORTEST_LEAP = 0.15, 0.06
"""Time in the air of a jump from standing, and of a leap that rises as no run does, s."""
JUMP_RISE = 0.12
"""Runs rise less, m."""
LEVEL = 0.12
"""A clip that ends so much higher or lower climbs, m."""
HAND_EXCURSION = 0.22
"""A hand that goes farther from where it starts reaches or gestures, m against the chest."""
ON_THE_SPOT, TURNED, STEPPED, ONE_STEP = 0.35, math.radians(30.0), 0.06, 0.6
EARLIEST_APEX = 0.2
"""Tags before this are placeholders, s."""
NEAR_APEX = 0.8
"""The apex of a reach without tags is where the hand is slowest beyond this share of its farthest way."""
REACH_WORDS = ("reach", "grab", "deposit", "grasp", "pick", "touch")


@dataclass(frozen=True)
class Motions:
    """What classification looks at.

    Attributes
    ----------
    stands_first, stands_last : bool
        Somebody stands still at the start, at the end.
    moved, turned : float
        Net way of the pelvis over the ground, m, and net turn, rad.
    flight : (float, float) or None
        Begin and end of the longest time with both feet in the air, s.
    rise, climb : float
        Highest and last height of the pelvis over the first, m.
    flight_gravity : float
        Downward acceleration of the pelvis in the flight, m/s^2.
    hand_excursion : (float, float)
        Farthest way of the right and left hand from where they start, against the chest, m.
    duration : float
        s.
    steps : bool
        Some foot leaves the ground.
    """

    stands_first: bool
    stands_last: bool
    moved: float
    turned: float
    flight: tuple[float, float] | None
    rise: float
    climb: float
    flight_gravity: float
    hand_excursion: tuple[float, float]
    duration: float
    steps: bool


def look_at(motion: Retargeted, contacts: Contacts, skeleton: Skeleton) -> Motions:
    """Measure what tells kinds of clips apart."""
    rate, frames = motion.frame_rate, len(motion.pelvis)
    travel = motion.travel
    way = travel[-1] - travel[0]
    heading = np.unwrap(heading_of(motion.rotation_local[:, 0]))
    flight = longest_flight(contacts, rate)
    return Motions(
        stands(motion, contacts, 0),
        stands(motion, contacts, -1),
        float(np.hypot(way[0], way[2])),
        float(heading[-1] - heading[0]),
        flight,
        float(travel[:, 1].max() - travel[0, 1]),
        float(way[1]),
        gravity_in(travel, flight, rate) if flight else 0.0,
        hand_excursions(motion, skeleton),
        (frames - 1) / rate,
        not bool(contacts.foot_is_down.all()),
    )


def stands(motion: Retargeted, contacts: Contacts, end: int) -> bool:
    """Whether somebody stands still at the start (0) or the end (-1)."""
    count = max(round(motion.frame_rate / 30.0), 1) + 1
    if len(motion.pelvis) <= count:
        return True
    part = slice(None, count) if end == 0 else slice(-count, None)
    tracks = [motion.travel[part], *(contacts.points[part, foot, BALL] for foot in range(2))]
    speed = [np.linalg.norm(np.diff(track, axis=0), axis=1).mean() * motion.frame_rate for track in tracks]
    heading = np.unwrap(heading_of(motion.rotation_local[part, 0]))
    turn = abs(heading[-1] - heading[0]) * motion.frame_rate / (count - 1)
    return bool(speed[0] < STILL_PELVIS and max(speed[1:]) < STILL_FOOT and turn < STILL_TURN)


def longest_flight(contacts: Contacts, rate: float) -> tuple[float, float] | None:
    """Longest time in which every point of both feet is above its height at the start."""
    height = contacts.points[..., 1]
    floor = np.minimum(height[0], height.min(axis=0) + OFF_GROUND)
    is_off = (height > floor + OFF_GROUND).all(axis=(1, 2))
    found = max(runs(is_off), key=lambda run: run[1] - run[0], default=None)
    return None if found is None else (found[0] / rate, found[1] / rate)


def gravity_in(travel: FloatArray, flight: tuple[float, float], rate: float) -> float:
    """Downward acceleration, m/s^2, of the parabola through the pelvis's heights in a flight."""
    first, last = round(flight[0] * rate), min(round(flight[1] * rate), len(travel) - 1)
    time = np.arange(last - first + 1) / rate
    return float(-2.0 * np.polyfit(time, travel[first : last + 1, 1], 2)[0]) if len(time) >= 4 else GRAVITY


def hand_excursions(motion: Retargeted, skeleton: Skeleton) -> tuple[float, float]:
    """Farthest way of right and left hand from their first place, against the chest's heading, m."""
    rotation, position = posed(motion.rotation_local, motion.pelvis, skeleton)
    chest = skeleton.joint("spine_4")
    back = about(1, -heading_of(rotation[:, chest]))
    result = []
    for side in ("right", "left"):
        hand = rotate(back, position[:, skeleton.joint(f"{side}_hand")] - position[:, chest])
        result.append(float(np.linalg.norm(hand - hand[0], axis=1).max()))
    return result[0], result[1]


def kind_of(name: str, motions: Motions, window: Window | None) -> ClipKind:
    """Decide what a clip serves.

    Parameters
    ----------
    name : str
        Tells a reach from a gesture, nothing else.
    motions : Motions
    window : Window or None
        Its gait cycles.
    """
    if motions.duration < POSE_SECONDS:
        return ClipKind.HAND_POSE
    stands_twice = motions.stands_first and motions.stands_last
    air = 0.0 if motions.flight is None else motions.flight[1] - motions.flight[0]
    falls = motions.flight_gravity > 0.5 * GRAVITY
    leaps = motions.rise > JUMP_RISE and air >= SHORTEST_LEAP
    reaches = any(word in name.lower() for word in REACH_WORDS)
    if falls and not reaches and (leaps or (stands_twice and air >= SHORTEST_FLIGHT)):
        return ClipKind.JUMP
    if not motions.steps or (
        stands_twice and motions.moved < ON_THE_SPOT and abs(motions.turned) < TURNED and reaches
    ):
        is_calm = max(motions.hand_excursion) < HAND_EXCURSION and motions.duration >= IDLE_SECONDS
        if is_calm and not reaches:
            return ClipKind.IDLE
        return ClipKind.REACH if reaches else ClipKind.GESTURE
    if reaches:
        return ClipKind.REACH
    if abs(motions.climb) > LEVEL:
        return ClipKind.OTHER
    if (motions.stands_first or motions.stands_last) and motions.moved < ONE_STEP:
        if abs(motions.turned) > TURNED:
            return ClipKind.TURN
        return ClipKind.STEP if motions.moved > STEPPED else ClipKind.GESTURE
    if stands_twice:
        return ClipKind.OTHER
    if motions.stands_first:
        return ClipKind.START
    if motions.stands_last:
        return ClipKind.STOP
    return ClipKind.OTHER if window is None else ClipKind.LOCOMOTION


def jump_labels(
    motion: Retargeted, motions: Motions, tags: Mapping[str, float], yaw: float, told: JumpCorrection
) -> JumpLabels | None:
    """Labels of a jump; None without flight.

    Parameters
    ----------
    motion : Retargeted
    motions : Motions
    tags : mapping
        Named times of the source, s.
    yaw : float
        Facing at the start, rad.
    told : JumpCorrection
        What the user says instead.
    """
    if motions.flight is None and (told.take_off is None or told.landing is None):
        return None
    found = motions.flight or (0.0, motions.duration)
    take_off = found[0] if told.take_off is None else min(told.take_off, motions.duration)
    landing = found[1] if told.landing is None else min(told.landing, motions.duration)
    rate, travel = motion.frame_rate, motion.travel
    first, last = round(take_off * rate), min(round(landing * rate), len(travel) - 1)
    apex = (first + int(travel[first : max(last, first) + 1, 1].argmax())) / rate
    tagged = tags.get("emphasis", 0.0)
    if take_off < tagged < landing:
        apex = tagged
    apex = apex if told.apex is None else told.apex
    way, flight = travel[-1] - travel[0], travel[last] - travel[first]
    length = math.hypot(way[0], way[2])
    direction = math.remainder(math.atan2(way[0], way[2]) - yaw, 2.0 * math.pi) if length > 0.1 else 0.0
    return JumpLabels(
        take_off, apex, landing, length, math.hypot(flight[0], flight[2]), motions.rise, direction
    )


def reach_labels(
    motion: Retargeted,
    motions: Motions,
    skeleton: Skeleton,
    tags: Mapping[str, float],
    yaw: float,
    told: ReachCorrection,
) -> ReachLabels:
    """Labels of a reach: the hand that goes farther, and where it is at the told, tagged or found moment.

    Parameters
    ----------
    motion : Retargeted
    motions : Motions
    skeleton : Skeleton
    tags : mapping
        Named times of the source, s.
    yaw : float
        Facing at the start, rad.
    told : ReachCorrection
        What the user says instead.
    """
    _, position = posed(motion.rotation_local, motion.pelvis, skeleton)
    hands = {side: position[:, skeleton.joint(f"{side}_hand")] for side in ("right", "left")}
    ways = {name: float(np.linalg.norm(hand - hand[0], axis=1).max()) for name, hand in hands.items()}
    side = max(ways, key=lambda name: ways[name]) if told.side is None else str(told.side)
    hand = hands[side]
    apex = tags.get("emphasis", 0.0) if told.apex is None else told.apex
    if told.apex is None and not EARLIEST_APEX < apex <= motions.duration:
        is_in_air = motions.flight is not None and motions.flight_gravity > 0.5 * GRAVITY
        apex = (int(hand[:, 1].argmax()) if is_in_air else apex_of(hand)) / motion.frame_rate
    frame = min(round(apex * motion.frame_rate), len(hand) - 1)
    start = motion.pelvis[0] * (1.0, 0.0, 1.0)
    place = rotate(about(1, -yaw), hand[frame] - start)
    return ReachLabels(side, apex, (float(place[0]), float(place[1]), float(place[2])))


def apex_of(hand: FloatArray) -> int:
    """Frame in which a hand (F, 3) is slowest while it is far from its way from the start to the end."""
    share = np.linspace(0.0, 1.0, len(hand))[:, None]
    away = np.linalg.norm(hand - hand[0] - share * (hand[-1] - hand[0]), axis=1)
    speed = np.linalg.norm(np.gradient(hand, axis=0), axis=1)
    return int(np.where(away >= NEAR_APEX * away.max(), speed, np.inf).argmin())
