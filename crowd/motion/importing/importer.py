"""Import one motion: from what a file holds to a labelled clip on the project's skeleton."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from crowd.errors import MotionError, describe
from crowd.motion.clip import Clip, ClipKind, ClipQuality, FootEvent, JointMask
from crowd.motion.importing.axes import PosedSource, convert, find_convention, rest_positions
from crowd.motion.importing.classify import jump_labels, kind_of, look_at, reach_labels
from crowd.motion.importing.clips import IN_PLACE, facing_of_feet, plain_clip, stance_drift
from crowd.motion.importing.contacts import Contacts, Stance, find_contacts, find_stances, sole_heights
from crowd.motion.importing.cycles import (
    Window,
    captured_parameters,
    cyclic_clip,
    find_window,
    heading_of,
    is_loop,
    sample,
    sample_linear,
)
from crowd.motion.importing.in_place import carried_along, ground_velocity
from crowd.motion.importing.joint_names import JointMap, read_mapping
from crowd.motion.importing.joint_shape import recognise
from crowd.motion.importing.labels import Correction, JumpCorrection, ReachCorrection
from crowd.motion.importing.retarget import Retargeted, retarget
from crowd.motion.procedural.gait import steady_path
from crowd.motion.rotation import conjugate, continuous, multiply, slerp, to_vector
from crowd.motion.skeleton import Skeleton
from crowd.motion.source import SourceMotion

FloatArray = npt.NDArray[np.float64]

HIGHEST_RATE = 60.0
"""Faster captures are sampled down to this, Hz."""
POP_ANGLE = math.radians(35.0)
POP_RATIO = 4.0
"""A frame pops when a joint goes this far there and back, and its neighbours agree that much better."""
FOOT_TAGS = {
    "heelstrikert": (0, "strike"),
    "heelstrikelf": (1, "strike"),
    "toeliftrt": (0, "leaves"),
    "toeliftlf": (1, "leaves"),
}
FLAT_SHARE, RISES_SHARE = 0.15, 0.6
"""Where only strike and lift are tagged, a foot is flat and its heel rises at these shares of the stance."""


@dataclass(frozen=True)
class ImportSettings:
    """How files are read.

    Attributes
    ----------
    units, up : str or None
        Instead of what is found, see `find_convention`.
    mapping : Path or None
        File that says which joint is which.
    """

    units: str | None = None
    up: str | None = None
    mapping: Path | None = None


@dataclass(frozen=True)
class Imported:
    """A clip with what was found out about its source.

    Attributes
    ----------
    clip : Clip
        On the project's skeleton and in its scale.
    family, convention : str
        Naming family; units and axes in words.
    scale : float
        Our leg length over the source's.
    unused_joints : tuple of str
        Source joints that have no counterpart.
    popped : int
        Frames that were mended.
    captured : (float, float, float) or None
        Forward m/s, turn rad/s and side m/s in the size of the source; of gaits.
    in_place : float
        Speed at which the ground glides under somebody who was captured in place, m/s; 0 for others.
    stances : tuple of Stance
        In times of the source, after what was cut off at its start, s.
    """

    clip: Clip
    family: str
    convention: str
    scale: float
    unused_joints: tuple[str, ...]
    popped: int
    captured: tuple[float, float, float] | None
    in_place: float = 0.0
    stances: tuple[Stance, ...] = ()


def import_clip(
    motion: SourceMotion,
    skeleton: Skeleton,
    settings: ImportSettings | None = None,
    correction: Correction | None = None,
) -> Imported:
    """Retarget a motion, find its labels and make a clip.

    Parameters
    ----------
    motion : SourceMotion
    skeleton : Skeleton
        The project's.
    settings : ImportSettings, optional
    correction : Correction, optional
        What the user says instead of what would be found.

    Raises
    ------
    MotionError
        Joints cannot be mapped, units cannot be told, or a correction does not fit.
    """
    settings, told = settings or ImportSettings(), correction or Correction()
    names = motion.skeleton.joint_names
    joints = (
        recognise(names, motion.skeleton.parent, rest_positions(motion), str(motion.path))
        if settings.mapping is None
        else read_mapping(settings.mapping, names)
    )
    convention = find_convention(motion, joints, settings.units, settings.up)
    source = cut(resampled(convert(motion, convention)), told, motion)
    ground = ground_velocity(source, joints)
    if ground is not None:
        source = carried_along(source, ground)
    contacts = find_contacts(source, joints, is_loop=False)
    moved, popped = without_pops(
        retarget(source, joints, skeleton, contacts.foot_is_flat, sole_heights(contacts), contacts.ground)
    )
    loops = is_loop(moved, skeleton) if told.cyclic is None else told.cyclic
    if loops:
        contacts = find_contacts(source, joints, is_loop=True)
    told_ones = told_stances(motion, told, source)
    stances = told_ones or find_stances(contacts, source.frame_rate)
    offset = told.begin or 0.0
    tags = {name: time - offset for name, time in motion.tags}
    clip, window = make_clip(motion.name, moved, contacts, stances, skeleton, told, tags, loops)
    if loops and window is None:
        # A loop that is no gait is played once: its stances end with it.
        stances = told_ones or find_stances(replace(contacts, is_loop=False), source.frame_rate)
    if window is None:
        stances = within_clip(stances, clip.duration)
        events = tuple(sorted(event for stance in stances for event in stance.events))
        clip = replace(clip, foot_events=() if clip.kind in IN_PLACE else events)
    captured = None if window is None else captured_parameters(moved, window)
    clip = corrected(clip, told, moved.scale, motion)
    drift = stance_drift(clip, skeleton) if clip.foot_events else 0.0
    quality = replace(clip.quality or ClipQuality(), stance_drift=drift)
    clip = replace(clip, quality=quality, source=motion.path.name)
    return Imported(
        clip,
        joints.family,
        convention.text,
        moved.scale,
        joints.unused,
        popped,
        captured,
        0.0 if ground is None else float(np.linalg.norm(ground)),
        tuple(stances) if clip.foot_events else (),
    )


def make_clip(
    name: str,
    motion: Retargeted,
    contacts: Contacts,
    stances: list[Stance],
    skeleton: Skeleton,
    told: Correction,
    tags: Mapping[str, float],
    loops: bool,
) -> tuple[Clip, Window | None]:
    """Decide what a motion serves, and make that clip with its labels; also gives the cycles of a gait."""
    motions = look_at(motion, contacts, skeleton)
    is_gait = not (motions.stands_first or motions.stands_last)
    wants_gait = told.kind is ClipKind.LOCOMOTION
    window = find_window(motion, skeleton, stances, loops) if is_gait or wants_gait else None
    kind = told.kind or kind_of(name, motions, window)
    if kind is ClipKind.LOCOMOTION:
        if window is None:
            raise MotionError(
                describe(
                    f'clip "{name}"',
                    "holds no gait cycle that closes",
                    f"{len(stances)} stances",
                    "alternating strikes; correct begin, end or events in the file of labels",
                )
            )
        clip = cyclic_clip(name, motion, skeleton, window)
        return replace(clip, quality=ClipQuality(seam=window.seam)), window
    clip = plain_clip(name, kind, motion, skeleton, motions.stands_first)
    headings = heading_of(motion.rotation_local[:1, 0])
    yaw = float((facing_of_feet(motion, skeleton) if motions.stands_first else headings)[0])
    if kind is ClipKind.GESTURE:
        clip = replace(clip, mask=JointMask.UPPER_BODY)
    if kind is ClipKind.JUMP:
        jump = jump_labels(motion, motions, tags, yaw, told.jump or JumpCorrection())
        if jump is None:
            allowed = "jump = { take_off = ..., landing = ... } in the file of labels"
            raise MotionError(
                describe(f'clip "{name}"', "no time is found with both feet in the air", None, allowed)
            )
        clip = replace(clip, jump=jump, quality=ClipQuality(flight_gravity=motions.flight_gravity))
    if kind is ClipKind.REACH:
        reach = reach_labels(motion, motions, skeleton, tags, yaw, told.reach or ReachCorrection())
        clip = replace(clip, reach=reach)
    return clip, None


def resampled(source: PosedSource) -> PosedSource:
    """Sample a fast capture down to `HIGHEST_RATE`."""
    if source.frame_rate <= HIGHEST_RATE:
        return source
    frames = len(source.position)
    place = np.arange(0.0, frames - 1 + 1e-9, source.frame_rate / HIGHEST_RATE)
    flat = source.position.reshape(frames, -1)
    position = sample_linear(flat, place).reshape(len(place), -1, 3)
    return replace(source, position=position, turned=sample(source.turned, place), frame_rate=HIGHEST_RATE)


def cut(source: PosedSource, told: Correction, motion: SourceMotion) -> PosedSource:
    """Keep what lies between the told times.

    Raises
    ------
    MotionError
        Nothing is left.
    """
    if told.begin is None and told.end is None:
        return source
    first = round((told.begin or 0.0) * source.frame_rate)
    last = len(source.position) if told.end is None else round(told.end * source.frame_rate) + 1
    if last - first < 2 or first >= len(source.position):
        raise MotionError(
            describe(
                f'labels of "{motion.name}"',
                "begin and end leave nothing",
                f"{told.begin} to {told.end} s",
                f"within 0 to {motion.duration:.3f} s",
            )
        )
    return replace(source, position=source.position[first:last], turned=source.turned[first:last])


def without_pops(motion: Retargeted) -> tuple[Retargeted, int]:
    """Mend single frames in which a joint jumps there and back.

    Returns
    -------
    Retargeted, int
        The motion and the number of frames mended.
    """
    local = motion.rotation_local
    if len(local) < 3:
        return motion, 0

    def angle(first: FloatArray, second: FloatArray) -> FloatArray:
        return np.asarray(np.linalg.norm(to_vector(multiply(conjugate(first), second)), axis=-1))

    there, back = angle(local[:-2], local[1:-1]), angle(local[1:-1], local[2:])
    across = angle(local[:-2], local[2:])
    pops = (np.minimum(there, back) > POP_ANGLE) & (np.minimum(there, back) > POP_RATIO * across)
    if not pops.any():
        return motion, 0
    mended = local.copy()
    frame, joint = np.nonzero(pops)
    mended[frame + 1, joint] = slerp(local[frame, joint], local[frame + 2, joint], 0.5)
    return replace(motion, rotation_local=continuous(mended)), len(np.unique(frame))


def told_stances(motion: SourceMotion, told: Correction, source: PosedSource) -> list[Stance]:
    """Stances by the file of labels, or by the tags of the source; none if neither tells any."""
    duration = (len(source.position) - 1) / source.frame_rate
    times: dict[tuple[int, str], list[float]] = {}
    if told.events is not None:
        parts = {"HS": "strike", "TS": "flat", "HO": "rises", "TO": "leaves"}
        for time, name in told.events:
            times.setdefault(("RL".index(name[0]), parts[name[1:]]), []).append(time)
    else:
        offset = told.begin or 0.0
        for tag, time in motion.tags:
            key = FOOT_TAGS.get(tag.lower().rstrip("0123456789"))
            if key is not None and 0.0 <= time - offset <= duration:
                times.setdefault(key, []).append(time - offset)
    found = []
    for foot in range(2):
        strikes = sorted(times.get((foot, "strike"), []))
        leaves = sorted(times.get((foot, "leaves"), []))
        if leaves and (not strikes or leaves[0] < strikes[0]):
            strikes.insert(0, 0.0)
        for number, strike in enumerate(strikes):
            following = strikes[number + 1] if number + 1 < len(strikes) else math.inf
            off = next((time for time in leaves if strike < time < following), duration)
            length = off - strike
            flat = _between(times.get((foot, "flat"), []), strike, off, strike + FLAT_SHARE * length)
            rises = _between(times.get((foot, "rises"), []), flat, off, strike + RISES_SHARE * length)
            if length > 0.0:
                found.append(Stance(foot, strike, flat, max(rises, flat), off))
    return sorted(found, key=lambda stance: (stance.strike, stance.foot))


def within_clip(stances: list[Stance], duration: float) -> list[Stance]:
    """Stances that begin in a clip, ending with it at the latest."""
    return [
        replace(
            stance,
            flat=min(stance.flat, duration),
            rises=min(stance.rises, duration),
            leaves=min(stance.leaves, duration),
        )
        for stance in stances
        if stance.strike < duration
    ]


def _between(times: list[float], low: float, high: float, otherwise: float) -> float:
    return next((time for time in sorted(times) if low <= time <= high), otherwise)


def corrected(clip: Clip, told: Correction, scale: float, motion: SourceMotion) -> Clip:
    """Put what the user tells into a clip.

    Raises
    ------
    MotionError
        A correction is for another kind of clip.
    """
    where = f'labels of "{motion.name}"'
    if any(value is not None for value in (told.forward, told.turn, told.side)):
        if clip.kind is not ClipKind.LOCOMOTION:
            raise MotionError(describe(where, "speeds are for locomotion", clip.kind.value))
        forward, turn, side = clip.parameters
        parameters = (
            forward if told.forward is None else told.forward * scale,
            turn if told.turn is None else math.radians(told.turn),
            side if told.side is None else told.side * scale,
        )
        position, yaw = steady_path(*parameters)(np.linspace(0.0, clip.duration, clip.frame_count))
        clip = replace(clip, parameters=parameters, root_position=position, root_yaw=yaw)
    for kind, label in (("jump", clip.jump), ("reach", clip.reach)):
        if getattr(told, kind) is not None and label is None:
            raise MotionError(describe(where, f"there is no {kind} in it", clip.kind.value))
    return clip


def strikes_of(clip: Clip) -> tuple[float, ...]:
    """Times of the heel strikes of a clip, s."""
    return tuple(time for time, event in clip.foot_events if event in (FootEvent.RHS, FootEvent.LHS))


__all__ = ["ImportSettings", "Imported", "JointMap", "import_clip", "strikes_of"]
