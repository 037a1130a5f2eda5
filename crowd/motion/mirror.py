"""Mirror images of clips, left for right."""

from dataclasses import replace

import numpy as np

from crowd.motion.clip import Clip, FootEvent, JointMask
from crowd.motion.importing.cycles import sample, sample_linear
from crowd.motion.rotation import continuous
from crowd.motion.skeleton import Skeleton


def mirrored(clip: Clip, skeleton: Skeleton, name: str) -> Clip:
    """Make the mirror image of a clip, left for right.

    A cyclic clip is shifted so that it starts with a right heel strike again.
    """
    other = [skeleton.joint(opposite(joint)) for joint in skeleton.joint_names]
    rotation = clip.rotation_local[:, other] * np.array([1.0, 1.0, -1.0, -1.0], np.float32)
    flip = np.array([-1.0, 1.0, 1.0])
    pelvis = (clip.pelvis_position_root * flip).astype(np.float32)
    swap = {event: FootEvent((event + 4) % 8) for event in FootEvent}
    events = [(time, swap[event]) for time, event in clip.foot_events]
    forward, turn, side = clip.parameters
    masks = {JointMask.LEFT_ARM: JointMask.RIGHT_ARM, JointMask.RIGHT_ARM: JointMask.LEFT_ARM}
    reach = clip.reach
    if reach is not None:
        left, up, ahead = reach.hand_position
        reach = replace(
            reach, side="left" if reach.side == "right" else "right", hand_position=(-left, up, ahead)
        )
    image = replace(
        clip,
        name=name,
        rotation_local=rotation,
        pelvis_position_root=pelvis,
        root_position=clip.root_position * flip,
        root_yaw=-clip.root_yaw,
        foot_events=tuple(events),
        parameters=(forward, -turn, -side),
        mask=masks.get(clip.mask, clip.mask),
        jump=None if clip.jump is None else replace(clip.jump, direction=-clip.jump.direction),
        reach=reach,
    )
    return started_at_right_strike(image) if clip.cycles else image


def opposite(joint: str) -> str:
    """Name of the joint on the other side."""
    if joint.startswith("left_"):
        return "right_" + joint.removeprefix("left_")
    return "left_" + joint.removeprefix("right_") if joint.startswith("right_") else joint


def started_at_right_strike(clip: Clip) -> Clip:
    """Shift a cyclic clip in time so that its first right heel strike comes at 0."""
    shift = min(time for time, event in clip.foot_events if event is FootEvent.RHS)
    intervals = clip.frame_count - 1
    place = np.mod(np.arange(intervals + 1) + shift * clip.frame_rate, intervals)
    events = [((time - shift) % clip.duration, event) for time, event in clip.foot_events]
    events = [(0.0 if clip.duration - time < 1e-9 else time, event) for time, event in events]
    return replace(
        clip,
        rotation_local=continuous(sample(clip.rotation_local.astype(np.float64), place)).astype(np.float32),
        pelvis_position_root=sample_linear(clip.pelvis_position_root.astype(np.float64), place).astype(
            np.float32
        ),
        foot_events=tuple(sorted(events, key=lambda entry: (round(entry[0], 9), int(entry[1])))),
    )
