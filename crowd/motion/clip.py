"""A clip: uniform-rate frames of one motion with its root motion, foot events and parameters."""

from dataclasses import dataclass, field
from enum import IntEnum, StrEnum

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


TOE_ROLL = 0.05
"""Share of a cycle between the lift of the ball of the foot and toe off; then only the tip is down."""


class FootEvent(IntEnum):
    """The eight events of one gait cycle: right and left heel strike, toe strike, heel off, toe off."""

    RHS = 0
    RTS = 1
    RHO = 2
    RTO = 3
    LHS = 4
    LTS = 5
    LHO = 6
    LTO = 7


class ClipKind(StrEnum):
    """What a clip serves."""

    LOCOMOTION = "locomotion"
    IDLE = "idle"
    START = "start"
    STOP = "stop"
    STEP = "step"
    TURN = "turn"
    JUMP = "jump"
    REACH = "reach"
    SIT = "sit"
    POSTURE = "posture"
    GESTURE = "gesture"
    HAND_POSE = "hand_pose"
    OTHER = "other"


class JointMask(StrEnum):
    """Which joints a clip played over locomotion writes."""

    FULL_BODY = "full_body"
    UPPER_BODY = "upper_body"
    ARMS = "arms"
    RIGHT_ARM = "right_arm"
    LEFT_ARM = "left_arm"
    HEAD = "head"


@dataclass(frozen=True)
class JumpLabels:
    """What a jump clip does.

    Attributes
    ----------
    take_off, apex, landing : float
        Times, s: the last foot leaves, the pelvis is highest, the first foot lands.
    length : float
        Way of the pelvis over the ground in the whole clip, m.
    flight_length : float
        Way while both feet are off the ground, m.
    rise : float
        Highest pelvis over its height at the start, m.
    direction : float
        Of the jump against the facing at the start, rad, left positive; 0 on the spot.
    """

    take_off: float
    apex: float
    landing: float
    length: float
    flight_length: float
    rise: float
    direction: float


@dataclass(frozen=True)
class ReachLabels:
    """What a reach clip does.

    Attributes
    ----------
    side : str
        ``"left"`` or ``"right"`` hand.
    apex : float
        Time at which the hand is where it reaches to, s.
    hand_position : tuple of float
        Wrist at the apex in the root frame at the start (left, up, ahead), m.
    """

    side: str
    apex: float
    hand_position: tuple[float, float, float]


@dataclass(frozen=True)
class ClipQuality:
    """How good the motion of an imported clip is, before anything at run time mends it.

    Attributes
    ----------
    stance_drift : float
        Mean way that a planted foot drifts in a stance, m.
    seam : float
        Mean joint angle between the ends of a loop before it was closed, rad; 0 for others.
    flight_gravity : float
        Downward acceleration of the pelvis in flight, m/s^2; 0 where there is no flight.
    """

    stance_drift: float = 0.0
    seam: float = 0.0
    flight_gravity: float = 0.0


@dataclass(frozen=True)
class Clip:
    """Frames of one motion, sampled at a uniform rate.

    The *root* is a point on the ground with a heading. In cyclic clips it moves at constant velocity and turn
    rate, so that sway stays in the pose and speed is exact at every phase.

    Attributes
    ----------
    name : str
        Unique in its library.
    kind : ClipKind
    frame_rate : float
        Frames per second.
    rotation_local : (F, J, 4) float32
        Unit quaternions (w, x, y, z) against the rest pose, relative to the parent joint; the pelvis against
        the root frame. Signs are continuous over frames.
    pelvis_position_root : (F, 3) float32
        Pelvis in the root frame (x left, y up from the ground, z ahead), m.
    root_position : (F, 3) float64
        Root against the root of frame 0, m; y is 0.
    root_yaw : (F,) float64
        Heading against frame 0, rad, left positive, not wrapped.
    is_cyclic : bool
        The last frame is the first one again in pose; two gait cycles for locomotion.
    foot_events : tuple of (float, FootEvent)
        Times in s with their events, in ascending order. A cyclic clip starts with RHS at time 0; its events
        lie in [0, duration).
    parameters : tuple of float
        Net forward speed m/s, turn rate rad/s (left positive), side speed m/s (left positive) over whole
        cycles.
    cycles : int
        Gait cycles in the clip: 2 for locomotion, 0 elsewhere.
    mask : JointMask
        For gestures: joints that the clip writes.
    jump : JumpLabels or None
    reach : ReachLabels or None
    quality : ClipQuality or None
        Of imported clips.
    source : str
        File that it was imported from; empty for clips that the engine made.
    """

    name: str
    kind: ClipKind
    frame_rate: float
    rotation_local: npt.NDArray[np.float32]
    pelvis_position_root: npt.NDArray[np.float32]
    root_position: FloatArray
    root_yaw: FloatArray
    is_cyclic: bool
    foot_events: tuple[tuple[float, FootEvent], ...] = ()
    parameters: tuple[float, float, float] = (0.0, 0.0, 0.0)
    cycles: int = 0
    mask: JointMask = field(default=JointMask.FULL_BODY)
    jump: JumpLabels | None = None
    reach: ReachLabels | None = None
    quality: ClipQuality | None = None
    source: str = ""

    @property
    def frame_count(self) -> int:
        """Number of frames, the repeated last frame of a cyclic clip included."""
        return int(self.rotation_local.shape[0])

    @property
    def duration(self) -> float:
        """Time from the first to the last frame, s."""
        return (self.frame_count - 1) / self.frame_rate

    @property
    def cycle_duration(self) -> float:
        """Time of one gait cycle, s."""
        return self.duration / self.cycles
