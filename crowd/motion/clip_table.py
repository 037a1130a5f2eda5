"""Clips packed for the kernels: one table of key frames, and what it takes to find the right row."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.interpolate import PchipInterpolator

from crowd.errors import MotionError, describe
from crowd.motion.clip import TOE_ROLL, Clip, ClipKind, FootEvent, JointMask
from crowd.motion.library import MotionLibrary
from crowd.motion.skeleton import Skeleton
from crowd_kernels.aligned import aligned_zeros
from crowd_kernels.clip import PADDED_JOINTS

FloatArray = npt.NDArray[np.float64]
Float32Array = npt.NDArray[np.float32]
IntArray = npt.NDArray[np.int32]

KEYS_PER_CYCLE = 64
KEY_RATE = 45.0
"""Keys per second of clips that are not locomotion."""
SAME_TIME = 1e-6
"""Events closer than this coincide, s."""
SPINE_SHARES = {"spine_1": 0.25, "spine_2": 0.5, "spine_3": 0.8, "spine_4": 1.0}
ARM_PARTS = ("clavicle", "upper_arm", "forearm", "hand", "thumb", "index", "middle", "ring", "little")
HEAD_PARTS = ("neck_1", "neck_2", "head", "left_eye", "right_eye")


@dataclass(frozen=True)
class ClipTable:
    """Key frames of all clips of a library, single poses left out.

    Attributes
    ----------
    names : tuple of str
        Clip names; the order of all arrays over clips.
    key_rotation : (K, 256) float32
        Quaternion components outermost, joints padded to 64, signs aligned over all keys.
    key_pelvis : (K, 3) float32
        Pelvis in the root frame, m.
    first_key, key_count : (C,) int32
        Rows of each clip. The repeated last frame of a cyclic clip is left out.
    key_rate : (C,) float64
        Keys per second; for locomotion keys are uniform in phase and this is their mean rate.
    is_cyclic : (C,) bool
    mask_index : (C,) int32
        Row of `joint_mask` for a clip that is played.
    example_clip : (E,) int32
        Clips of kind locomotion; the order of all arrays over examples.
    parameters : (E, 3) float64
        Forward speed m/s, turn rate rad/s, side speed m/s.
    cycle_duration : (E,) float64
        s.
    contact_phase : (E, 2, 2) float64
        For each foot (right, left), share of a cycle from its strike to foot flat, and to the lift of the
        ball.
    joint_mask : (M, 64) float32
        Share of a masked clip on each joint; row 0 is the full body.
    pelvis_mask : (M,) float32
    """

    names: tuple[str, ...]
    key_rotation: Float32Array
    key_pelvis: Float32Array
    first_key: IntArray
    key_count: IntArray
    key_rate: FloatArray
    is_cyclic: npt.NDArray[np.bool_]
    mask_index: IntArray
    example_clip: IntArray
    parameters: FloatArray
    cycle_duration: FloatArray
    contact_phase: FloatArray
    joint_mask: Float32Array
    pelvis_mask: Float32Array

    @classmethod
    def build(cls, library: MotionLibrary) -> "ClipTable":
        """Pack a library.

        Raises
        ------
        MotionError
            A locomotion clip is not cyclic over two cycles, or lacks foot strikes.
        """
        clips = [clip for clip in library.clips if clip.frame_count > 1]
        sampled = [sample_keys(clip) for clip in clips]
        count = np.array([len(rotation) for rotation, _ in sampled], np.int32)
        examples = [number for number, clip in enumerate(clips) if clip.kind is ClipKind.LOCOMOTION]
        joint_mask, pelvis_mask = masks(library.skeleton)
        return cls(
            tuple(clip.name for clip in clips),
            rows(np.concatenate([rotation for rotation, _ in sampled])),
            np.ascontiguousarray(np.concatenate([pelvis for _, pelvis in sampled]), np.float32),
            np.concatenate([[0], np.cumsum(count)[:-1]]).astype(np.int32),
            count,
            np.array([key_rate(clip) for clip in clips]),
            np.array([clip.is_cyclic for clip in clips]),
            np.array([list(JointMask).index(clip.mask) for clip in clips], np.int32),
            np.array(examples, np.int32),
            np.array([clips[number].parameters for number in examples]),
            np.array([clips[number].cycle_duration for number in examples]),
            np.array([contact_phases(clips[number]) for number in examples]),
            joint_mask,
            pelvis_mask,
        )

    def index(self, name: str) -> int:
        """Place of a clip in the arrays over clips."""
        return self.names.index(name)


def key_rate(clip: Clip) -> float:
    """Keys per second of a clip in the table."""
    if clip.kind is ClipKind.LOCOMOTION:
        return KEYS_PER_CYCLE / clip.cycle_duration
    return key_intervals(clip) / clip.duration


def key_intervals(clip: Clip, rate: float = KEY_RATE) -> int:
    """Number of equal intervals into which a clip that is not locomotion is cut, about `rate` per second."""
    return max(round(clip.duration * rate), 1)


def sample_keys(clip: Clip) -> tuple[Float32Array, Float32Array]:
    """Resample a clip to its keys: rotations (k, J, 4) and pelvis positions (k, 3)."""
    if clip.kind is ClipKind.LOCOMOTION:
        times = phase_times(clip, np.arange(2 * KEYS_PER_CYCLE) / KEYS_PER_CYCLE)
    else:
        intervals = key_intervals(clip)
        times = np.arange(intervals if clip.is_cyclic else intervals + 1) * clip.duration / intervals
    position = np.clip(times * clip.frame_rate, 0, clip.frame_count - 1)
    before = np.minimum(position.astype(int), max(clip.frame_count - 2, 0))
    after = np.minimum(before + 1, clip.frame_count - 1)
    share = (position - before)[:, None]
    first, second = clip.rotation_local[before], clip.rotation_local[after]
    sign = np.where((first * second).sum(axis=2, keepdims=True) < 0, -1, 1)
    rotation = (1 - share[..., None]) * first + share[..., None] * sign * second
    rotation /= np.linalg.norm(rotation, axis=2, keepdims=True)
    pelvis = (1 - share) * clip.pelvis_position_root[before] + share * clip.pelvis_position_root[after]
    return rotation.astype(np.float32), pelvis.astype(np.float32)


def strike_times(clip: Clip) -> FloatArray:
    """Times of right, left, right, left heel strike and of the right one after the last cycle, s.

    Raises
    ------
    MotionError
        The clip does not hold two cycles with alternating strikes.
    """
    strikes = [(time, event) for time, event in clip.foot_events if event in (FootEvent.RHS, FootEvent.LHS)]
    order = [event for _, event in strikes]
    if not clip.is_cyclic or clip.cycles != 2 or order != [FootEvent.RHS, FootEvent.LHS] * 2:
        raise MotionError(
            describe(
                f'clip "{clip.name}"',
                "locomotion needs two cycles that start with a right heel strike",
                ", ".join(event.name for event in order) or "no strikes",
                "RHS, LHS, RHS, LHS",
            )
        )
    return np.array([time for time, _ in strikes] + [strikes[0][0] + clip.duration])


def phase_times(clip: Clip, phase: FloatArray) -> FloatArray:
    """Clip times at gait phases in [0, 2): a smooth rising curve through the strikes."""
    times = strike_times(clip)
    period = clip.duration
    knots = np.concatenate([times[2:4] - period, times, times[1:3] + period])
    curve = PchipInterpolator(np.arange(-2, 7) * 0.5, knots)
    return np.asarray(np.mod(curve(phase), period))


def contact_phases(clip: Clip) -> FloatArray:
    """Shares of a cycle from strike to foot flat and to the lift of the ball, right and left foot; (2, 2).

    A foot that lands flat, or on its toe, is flat from the strike on.
    """
    times = strike_times(clip)
    knots, phases = np.append(times, times[1:] + clip.duration), np.arange(9) * 0.5
    result = np.zeros((2, 2))
    triples = ((FootEvent.RHS, FootEvent.RTS, FootEvent.RTO), (FootEvent.LHS, FootEvent.LTS, FootEvent.LTO))
    for foot, (strike, flat, toe_off) in enumerate(triples):
        begins = np.array([time for time, event in clip.foot_events if event is strike])
        for column, wanted in enumerate((flat, toe_off)):
            found = np.array([time for time, event in clip.foot_events if event is wanted])
            delays = np.mod(found - begins[:, None] + SAME_TIME, clip.duration).min(axis=1) - SAME_TIME
            shares = np.interp(begins + delays, knots, phases) - np.interp(begins, knots, phases)
            result[foot, column] = shares.mean() - (TOE_ROLL if wanted is toe_off else 0.0)
    is_flat_at_once = (result[:, 0] < 0) | (result[:, 0] > result[:, 1])
    result[is_flat_at_once, 0] = 0.0
    return result


def rows(rotation: Float32Array) -> Float32Array:
    """Lay out (K, J, 4) quaternions as key rows (K, 256), with signs aligned joint by joint.

    The sign of every key is chosen to agree with the mean rotation of the joint, so that weighted sums of any
    keys are blends the short way round.
    """
    keys, joints = rotation.shape[:2]
    reference = np.zeros((joints, 4))
    for joint in range(joints):
        # The main axis of the quaternions is their mean rotation (Markley et al., 2007).
        values = rotation[:, joint].astype(np.float64)
        reference[joint] = np.linalg.eigh(values.T @ values)[1][:, -1]
    sign = np.where(np.einsum("kjc,jc->kj", rotation, reference) < 0, -1, 1)[..., None]
    table = aligned_zeros((keys, 4, PADDED_JOINTS), np.float32)
    table[:, 0, joints:] = 1
    table[:, :, :joints] = np.transpose(rotation * sign, (0, 2, 1))
    return table.reshape(keys, 4 * PADDED_JOINTS)


def masks(skeleton: Skeleton) -> tuple[Float32Array, Float32Array]:
    """Joint and pelvis shares of each `JointMask`, in its order."""

    def share(mask: JointMask, joint: str) -> float:
        is_arm = any(part in joint for part in ARM_PARTS)
        match mask:
            case JointMask.FULL_BODY:
                return 1.0
            case JointMask.UPPER_BODY:
                return 1.0 if is_arm or joint in HEAD_PARTS else SPINE_SHARES.get(joint, 0.0)
            case JointMask.ARMS:
                return float(is_arm)
            case JointMask.RIGHT_ARM:
                return float(is_arm and joint.startswith("right"))
            case JointMask.LEFT_ARM:
                return float(is_arm and joint.startswith("left"))
            case JointMask.HEAD:
                return float(joint in HEAD_PARTS)

    joint_mask = aligned_zeros((len(JointMask), PADDED_JOINTS), np.float32)
    joint_mask[0] = 1
    for row, mask in enumerate(JointMask):
        joint_mask[row, : skeleton.joint_count] = [share(mask, joint) for joint in skeleton.joint_names]
    pelvis_mask = np.array([mask is JointMask.FULL_BODY for mask in JointMask], np.float32)
    return joint_mask, pelvis_mask
