"""Everything that changes while a simulation runs: one array per quantity, leading axis = character.

Rows are slots; a slot without a person has ``is_active`` False and its other values mean nothing.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from enum import IntEnum
from typing import Any

import numpy as np
import numpy.typing as npt

from crowd_kernels.aligned import aligned_full
from crowd_kernels.clip import PADDED_JOINTS
from crowd_kernels.reach_correction import LANES as CORRECTED_JOINTS
from crowd_kernels.reach_examples import SLOTS

FloatArray = npt.NDArray[np.float64]
Float32Array = npt.NDArray[np.float32]
IntArray = npt.NDArray[np.int32]
LongArray = npt.NDArray[np.int64]
ByteArray = npt.NDArray[np.uint8]
BoolArray = npt.NDArray[np.bool_]


class CarryStage(IntEnum):
    """What both hands do with what they hold between them."""

    FREE = 0
    """There is nothing."""
    PLACING = 1
    """It goes to or stays at a place in the world."""
    CARRYING = 2
    """It is kept before the body."""
    STOPPED = 3
    """The place was refused, and it stays where it was against the body."""
    WAITING = 4
    """It is kept before the body until the person stands, and then goes to its place."""


COUNTS = ("spawn_count", "visit_count", "reach_count", "_refusals")
"""Ends of names of what goes on counting when another person enters through a slot."""


def _array(*shape: int, dtype: Any = np.float64, fill: float = 0) -> Any:
    return field(metadata={"shape": shape, "dtype": dtype, "fill": fill})


@dataclass
class State:
    """Structure of arrays. Ground vectors are (character, 3) with y = 0; feet are ordered right, left."""

    is_active: BoolArray = _array(dtype=np.bool_)
    """The slot holds a person who is in the scene. (character,)"""
    is_finished: BoolArray = _array(dtype=np.bool_)
    """The person has reached the last goal, or never had one. (character,)"""
    spawn_count: LongArray = _array(dtype=np.int64)
    """How often a person has entered through this slot; keys random choices. (character,)"""

    position_world: FloatArray = _array(3)
    """Root on the ground, m. (character, 3)"""
    previous_position_world: FloatArray = _array(3)
    """Root one step ago, m. (character, 3)"""
    yaw: FloatArray = _array()
    """Heading about +y, 0 faces +z, left positive, rad in (-pi, pi]. (character,)"""
    velocity_world: FloatArray = _array(3)
    """Realised velocity of the root in the last step, m/s. (character, 3)"""

    goal_index: IntArray = _array(dtype=np.int32)
    """Which goal of the character's list it walks to. (character,)"""
    goal_world: FloatArray = _array(3)
    """Point of the present goal, m. (character, 3)"""
    goal_radius: FloatArray = _array()
    """Distance at which the goal counts as reached, m. (character,)"""
    visit_count: LongArray = _array(dtype=np.int64)
    """Goals the character has been sent to; keys the points drawn in goal areas. (character,)"""
    wait_until: FloatArray = _array()
    """The character stands until this time, s. (character,)"""
    wants_to_walk: BoolArray = _array(dtype=np.bool_)
    """The character has a goal and is not waiting. (character,)"""
    wanted_speed: FloatArray = _array()
    """Speed at which the character would like to walk now, m/s. (character,)"""
    way_point_world: FloatArray = _array(3)
    """Point that the character walks to next, m. (character, 3)"""
    remaining_distance: FloatArray = _array()
    """Length of the way to the goal, m. (character,)"""
    preferred_velocity_world: FloatArray = _array(3)
    """Velocity that the character would have if it were alone, m/s. (character, 3)"""
    desired_velocity_world: FloatArray = _array(3)
    """Velocity after avoidance, m/s. (character, 3)"""
    heading_velocity_world: FloatArray = _array(3)
    """Smoothed desired velocity; the character turns towards it, m/s. (character, 3)"""
    turning_side: ByteArray = _array(dtype=np.int8)
    """Side of the present turn: 1 left, -1 right, so that nobody wavers who must turn round. (character,)"""

    is_directed: BoolArray = _array(dtype=np.bool_)
    """Locomotion parameters come from a command instead of steering. (character,)"""
    directed_parameter: FloatArray = _array(3)
    """Commanded forward speed, turn rate, side speed, where `is_directed`; m/s, rad/s, m/s. (character, 3)"""
    locomotion_parameter: FloatArray = _array(3)
    """Forward speed, turn rate, side speed that locomotion realises now; m/s, rad/s, m/s. (character, 3)"""
    library_parameter: FloatArray = _array(3)
    """The same as the motion library knows it, for its own skeleton and tempo. (character, 3)"""
    is_moving: BoolArray = _array(dtype=np.bool_)
    """The locomotion layer is wanted: the character walks, turns, or is about to. (character,)"""
    locomotion_weight: FloatArray = _array()
    """Share of the locomotion layer in the pose: 0 idle, 1 moving. (character,)"""
    locomotion_weight_rate: FloatArray = _array()
    """Rate of change of `locomotion_weight`, 1/s. (character,)"""
    phase: FloatArray = _array()
    """Gait phase in cycles in [0, 2); right heel strikes at 0 and 1, left at 0.5 and 1.5. (character,)"""
    cycle_rate: FloatArray = _array()
    """Gait cycles per second of the present blend. (character,)"""
    example: IntArray = _array(4, dtype=np.int32)
    """Locomotion examples that are blended. (character, 4)"""
    example_weight: FloatArray = _array(4)
    """Weights of the examples: all >= 0, sum 1. (character, 4)"""

    idle_clip: IntArray = _array(2, dtype=np.int32)
    """Idle variation that is left and the one that is entered, among the idle clips. (character, 2)"""
    idle_time: FloatArray = _array(2)
    """Clip time of both, s. (character, 2)"""
    idle_mix: FloatArray = _array(fill=1)
    """Progress from the first idle variation to the second, 0 to 1. (character,)"""
    idle_until: FloatArray = _array()
    """Simulation time at which the next idle variation is chosen, s. (character,)"""

    is_seated: BoolArray = _array(dtype=np.bool_)
    """The person sits on a seat, or is sitting down. (character,)"""
    sitting_time: FloatArray = _array()
    """Progress of sitting down, as time of its clip, s; 0 while standing. (character,)"""

    play_clip: IntArray = _array(dtype=np.int32, fill=-1)
    """Clip that the animation layer plays, -1 for none. (character,)"""
    play_time: FloatArray = _array()
    """Time since the play began, s. (character,)"""
    play_end: FloatArray = _array()
    """Length of the play with its repetitions, s; infinite for one without end. (character,)"""
    play_weight: FloatArray = _array()
    """Share of the played clip on the joints of its mask, 0 to 1. (character,)"""
    play_weight_rate: FloatArray = _array()
    """Rate of change of `play_weight`, 1/s. (character,)"""
    play_queued: IntArray = _array(dtype=np.int32, fill=-1)
    """Clip that follows the present one, -1 for none. (character,)"""
    play_queued_length: FloatArray = _array()
    """Length of the play that follows, s. (character,)"""

    gaze_kind: ByteArray = _array(dtype=np.uint8)
    """What the character looks at: 0 nothing, 1 a point, 2 a character, 3 an object. (character,)"""
    gaze_index: IntArray = _array(dtype=np.int32, fill=-1)
    """Character or object that is looked at. (character,)"""
    gaze_target_world: FloatArray = _array(3)
    """Point that is looked at now, m. (character, 3)"""
    gaze_trunk: Float32Array = _array(dtype=np.float32, fill=1)
    """How far waist and chest take part in the turn, 0 to 1. (character,)"""
    gaze_weight: Float32Array = _array(dtype=np.float32)
    """Share of the gaze in the pose, 0 to 1; above 0 until a turn has faded. (character,)"""
    gaze_weight_rate: Float32Array = _array(dtype=np.float32)
    """Rate of change of `gaze_weight`, 1/s. (character,)"""
    gaze_turn: Float32Array = _array(7, 3, dtype=np.float32)
    """Rotation vectors that gaze adds to the joints from waist to head, rad. (character, 7, 3)"""
    gaze_turn_rate: Float32Array = _array(7, 3, dtype=np.float32)
    """Their rates, rad/s. (character, 7, 3)"""
    gaze_eye_turn: Float32Array = _array(2, 2, dtype=np.float32)
    """Turn of left and right eye about x (down) and y (left), saccades apart, rad. (character, 2, 2)"""
    gaze_error: Float32Array = _array(dtype=np.float32)
    """Angle by which the eyes miss the target, saccades apart, rad. (character,)"""
    gaze_status: ByteArray = _array(dtype=np.uint8)
    """0 no target, 1 turning, 2 on target, 3 out of reach of the limits, 4 refused. (character,)"""
    gaze_refusals: IntArray = _array(dtype=np.int32)
    """How often a target of the gaze was refused. (character,)"""
    is_glancing: BoolArray = _array(dtype=np.bool_)
    """The gaze is an idle glance, which any wanted gaze replaces. (character,)"""
    glance_until: FloatArray = _array()
    """Time of the next choice of a glance, s. (character,)"""
    saccade_mode: ByteArray = _array(dtype=np.uint8)
    """Attention: 0 listening, 1 talking, 2 thinking, 255 no saccades. (character,)"""
    saccade_start: Float32Array = _array(2, dtype=np.float32)
    """Offset from which the eyes jump, about x (down) and y (left), rad. (character, 2)"""
    saccade_goal: Float32Array = _array(2, dtype=np.float32)
    """Offset to which they jump; 0 is the target. (character, 2)"""
    saccade_offset: Float32Array = _array(2, dtype=np.float32)
    """Where the eyes are beside the target, rad. (character, 2)"""
    saccade_clock: Float32Array = _array(dtype=np.float32)
    """Time since the last jump began, s. (character,)"""
    saccade_duration: Float32Array = _array(dtype=np.float32)
    """Length of the last jump, s. (character,)"""
    saccade_until: FloatArray = _array()
    """Time of the next jump, s. (character,)"""

    pose_rotation: Float32Array = _array(4 * PADDED_JOINTS, dtype=np.float32)
    """Local joint rotations, components outermost: w of all joints, then x, y, z. (character, 256)"""
    pose_pelvis: Float32Array = _array(3, dtype=np.float32)
    """Pelvis in the root frame at leg scale 1, m. (character, 3)"""

    reach_stage: ByteArray = _array(2, dtype=np.uint8)
    """Stage of each hand's reach, right and left: 0 none, 1 move, 2 hold, 3 return. (character, 2)"""
    reach_status: ByteArray = _array(2, dtype=np.uint8)
    """0 none, 1 moving, 2 reached, 3 out of reach (as near as can be), 4 refused target. (character, 2)"""
    reach_count: IntArray = _array(2, dtype=np.int32)
    """How often each hand has been sent to a target. (character, 2)"""
    reach_refusals: IntArray = _array(2, dtype=np.int32)
    """How often a target of the hand was refused: when it was asked for, or when it moved. (character, 2)"""
    reach_is_own: BoolArray = _array(2, dtype=np.bool_)
    """The target moves with the body, so that no wall comes between. (character, 2)"""
    reach_is_blocked: BoolArray = _array(2, dtype=np.bool_)
    """A wall lies between the shoulder and the target. (character, 2)"""
    reach_checked_world: FloatArray = _array(2, 3)
    """Target for which walls were looked for last, m. (character, 2, 3)"""
    reach_target_world: FloatArray = _array(2, 3)
    """Where a point of the hand shall come, m; may change in every step. (character, 2, 3)"""
    reach_target_rotation_world: FloatArray = _array(2, 4)
    """Rotation that the hand joint shall have where `reach_has_rotation`. (character, 2, 4)"""
    reach_has_rotation: BoolArray = _array(2, dtype=np.bool_)
    """A rotation is asked for. (character, 2)"""
    reach_point_hand: FloatArray = _array(2, 3)
    """Point in the hand joint's frame that comes to the target, 0 for the wrist, m. (character, 2, 3)"""
    reach_seconds: FloatArray = _array(2)
    """Time to the target that is asked for, 0 for a natural one, s. (character, 2)"""
    reach_hold_left: FloatArray = _array(2)
    """Time for which the hand still stays at the target, s; infinite until told. (character, 2)"""
    reach_course: FloatArray = _array(2)
    """Course of the reach: 0 at rest, 1 at the target, 2 at rest again. (character, 2)"""
    reach_course_rate: FloatArray = _array(2)
    """Rate of change of `reach_course`, 1/s. (character, 2)"""
    reach_waited: FloatArray = _array()
    """For how long both hands have waited of a person who stands, one of them far from its goal, s.
    (character,)"""
    reach_weight: FloatArray = _array(2)
    """Share of the reach in the pose, 0 to 1. (character, 2)"""
    reach_lead_time: FloatArray = _array(2)
    """Least time from rest to the goal as found when the hand set out, s. (character, 2)"""
    reach_seen: FloatArray = _array(2, 3)
    """Target in the root frame as last seen, m. (character, 2, 3)"""
    reach_seen_velocity: FloatArray = _array(2, 3)
    """Its velocity, m/s. (character, 2, 3)"""
    reach_offset: FloatArray = _array(2, 3)
    """Goal of the hand against where the blended examples have it at their apex, m. (character, 2, 3)"""
    reach_offset_velocity: FloatArray = _array(2, 3)
    """m/s. (character, 2, 3)"""
    reach_away: FloatArray = _array(2, 3)
    """How the other hand's examples take the hand away from where its own have it, m. (character, 2, 3)"""
    reach_lag: FloatArray = _array(2, 3)
    """What is left of the glide of `reach_offset` to a new target, m. (character, 2, 3)"""
    reach_lag_velocity: FloatArray = _array(2, 3)
    """m/s. (character, 2, 3)"""
    reach_lag_acceleration: FloatArray = _array(2, 3)
    """m/s^2. (character, 2, 3)"""
    reach_time_left: FloatArray = _array(2)
    """Time until the hand has glided to a target that has jumped, s. (character, 2)"""
    reach_plan_time: FloatArray = _array(2, fill=1)
    """Length of that glide, s. (character, 2)"""
    reach_bulge: FloatArray = _array(2, 3)
    """How far the middle of its way is moved from the body, m. (character, 2, 3)"""
    reach_glide_turn: FloatArray = _array(2, 4)
    """How the blend turns the hand now against where the glide ends, in the frame of the latter.
    (character, 2, 4)"""
    reach_rotation: FloatArray = _array(2, 4)
    """Rotation of the goal in the root frame. (character, 2, 4)"""
    reach_turn_velocity: FloatArray = _array(2, 3)
    """Its angular velocity against that of the target, rad/s. (character, 2, 3)"""
    reach_turn_acceleration: FloatArray = _array(2, 3)
    """rad/s^2. (character, 2, 3)"""
    reach_turn: FloatArray = _array(2)
    """How far the hand must turn at its target against the examples, rad. (character, 2)"""
    reach_turn_before: FloatArray = _array(2, 3)
    """How the hand was turned against the examples when a rotation came to be asked for on the way, rad.
    (character, 2, 3)"""
    reach_rotation_share: FloatArray = _array(2)
    """How far the rotation of the goal counts, 0 to 1. (character, 2)"""
    reach_rotation_rate: FloatArray = _array(2)
    """Rate of change of `reach_rotation_share`, 1/s. (character, 2)"""
    reach_missing_place: FloatArray = _array(2, 3)
    """Way from the point of the hand to where it was wanted in the last step, root frame, m.
    (character, 2, 3)"""
    reach_missing_turn: FloatArray = _array(2, 3)
    """Rotation vector from the hand to the rotation wanted in the last step, root frame, rad.
    (character, 2, 3)"""
    reach_example: IntArray = _array(2, SLOTS, dtype=np.int32)
    """Examples that are blended; those of weight 0 mean nothing. (character, 2, 72)"""
    reach_example_weight: FloatArray = _array(2, SLOTS)
    """Their weights, which follow those of the goal. (character, 2, 72)"""
    reach_example_weight_rate: FloatArray = _array(2, SLOTS)
    """1/s. (character, 2, 72)"""
    reach_example_weight_acceleration: FloatArray = _array(2, SLOTS)
    """1/s^2. (character, 2, 72)"""
    reach_example_wanted: FloatArray = _array(2, SLOTS)
    """Weights that they come to. (character, 2, 72)"""
    reach_example_count: IntArray = _array(2, dtype=np.int32)
    """Place after the last example that is blended. (character, 2)"""
    reach_looked_up: FloatArray = _array(2, 3)
    """Where the wrist was when examples were last looked up, root frame, m. (character, 2, 3)"""
    reach_looked_up_pelvis: FloatArray = _array(2, 3)
    """Where the pelvis was then, m. (character, 2, 3)"""
    reach_looked_up_share: FloatArray = _array(2)
    """Share of the upper body's examples then, 0 to 1. (character, 2)"""
    reach_correction: Float32Array = _array(3 * CORRECTED_JOINTS, dtype=np.float32)
    """What inverse kinematics turned joints against the blended motion in the last step: vector parts, x of
    all joints of the tree, then y, z; 0 for none. (character, 96)"""
    reach_correction_change: Float32Array = _array(3 * CORRECTED_JOINTS, dtype=np.float32)
    """How that has changed in the last step. (character, 96)"""
    reach_last_rotation: Float32Array = _array(4 * PADDED_JOINTS, dtype=np.float32)
    """Joints as inverse kinematics left them in the last step; 0 for none. (character, 256)"""

    grab_stage: ByteArray = _array(2, dtype=np.uint8)
    """Stage of each hand, right and left: 0 open, 1 closing, 2 holding, 3 opening. (character, 2)"""
    grab_status: ByteArray = _array(2, dtype=np.uint8)
    """How the grasp stands, see `crowd.controllers.grab.GrabStatus`. (character, 2)"""
    grab_refusals: IntArray = _array(2, dtype=np.int32)
    """How often a grasp or touch of the hand was refused or came to nothing. (character, 2)"""
    grab_refusal: ByteArray = _array(2, dtype=np.uint8)
    """`GrabStatus` that says why it was so last. (character, 2)"""
    grab_purpose: ByteArray = _array(2, dtype=np.uint8)
    """What the hand is for: 0 nothing, 1 grasp, 2 touch, 3 grasp with both, 4 wait for it. (character, 2)"""
    grab_object: IntArray = _array(2, dtype=np.int32, fill=-1)
    """Object that the hand goes to or holds, -1 for none. (character, 2)"""
    grab_giver: IntArray = _array(2, dtype=np.int32, fill=-1)
    """Character from whom the hand takes the object, -1 for none. (character, 2)"""
    grab_style: IntArray = _array(2, dtype=np.int32)
    """Style of the grip: 0 palm and fingers, 1 finger tips. (character, 2)"""
    grab_position: FloatArray = _array(2, 3)
    """Where the hand joint goes, in the object's frame, m. (character, 2, 3)"""
    grab_rotation: FloatArray = _array(2, 4)
    """Rotation that it gets, in the object's frame. (character, 2, 4)"""
    grab_time: FloatArray = _array(2)
    """Time since the fingers began to close or to open, s. (character, 2)"""
    grab_weight: FloatArray = _array(2)
    """Progress from the fingers of the layers below to those of the grip, 0 to 1. (character, 2)"""
    finger_closure: Float32Array = _array(2, 15, dtype=np.float32)
    """Closure of each finger joint, thumb to little finger: 0 open, 1 closed. (character, 2, 15)"""
    finger_limit: Float32Array = _array(2, 15, dtype=np.float32)
    """Closure at which each joint stops on the object. (character, 2, 15)"""
    finger_contact: ByteArray = _array(2, 15, dtype=np.uint8)
    """1 where the segment touches the object. (character, 2, 15)"""

    carry_stage: ByteArray = _array(dtype=np.uint8)
    """What both hands do with what they hold between them, a `CarryStage`. (character,)"""
    carry_progress: FloatArray = _array()
    """Progress from where the object set out to where it goes, 0 to 1. (character,)"""
    carry_seconds: FloatArray = _array()
    """Length of this way, s; 0 until the hands move it first. (character,)"""
    carry_position: FloatArray = _array(3)
    """Where the hands have the object, in the root frame, m. (character, 3)"""
    carry_rotation: FloatArray = _array(4)
    """Its rotation in the root frame. (character, 4)"""
    carry_velocity: FloatArray = _array(3)
    """m/s. (character, 3)"""
    carry_turn_velocity: FloatArray = _array(3)
    """rad/s. (character, 3)"""
    carry_start_position: FloatArray = _array(3)
    """Where the object set out, in the root frame, m. (character, 3)"""
    carry_start_rotation: FloatArray = _array(4)
    """Its rotation there. (character, 4)"""
    carry_start_velocity: FloatArray = _array(3)
    """Its velocity there, m/s. (character, 3)"""
    carry_start_turn_velocity: FloatArray = _array(3)
    """rad/s. (character, 3)"""
    carry_grip_rotation: FloatArray = _array(4)
    """Its rotation in the root frame when both hands took it, which is how it is carried. (character, 4)"""
    carry_place_world: FloatArray = _array(3)
    """Where its centre shall come when it has a place, m. (character, 3)"""
    carry_place_rotation_world: FloatArray = _array(4)
    """Rotation that it gets there. (character, 4)"""
    constraint_task: ByteArray = _array(3, dtype=np.uint8)
    """What is held of right hand, left hand and head: 0 nothing, 1 position, 2 rotation, 3 both.
    (character, effector)"""
    constraint_last_task: ByteArray = _array(3, dtype=np.uint8)
    """The same while a hold fades: what was held last. (character, effector)"""
    constraint_weight: Float32Array = _array(3, dtype=np.float32)
    """Share of each hold in the pose, 0 to 1. (character, effector)"""
    constraint_weight_rate: Float32Array = _array(3, dtype=np.float32)
    """Rate of change of `constraint_weight`, 1/s. (character, effector)"""
    constraint_target_world: FloatArray = _array(3, 3)
    """Where effectors are held, m. (character, effector, 3)"""
    constraint_target_rotation_world: Float32Array = _array(3, 4, dtype=np.float32)
    """Rotations with which their joints are held. (character, effector, 4)"""
    constraint_point: Float32Array = _array(3, 3, dtype=np.float32)
    """What is held, in the frame of the joint, m. (character, effector, 3)"""
    constraint_rotation: Float32Array = _array(4 * PADDED_JOINTS, dtype=np.float32)
    """Pose that the constraint layer left in the last step, laid out as `pose_rotation`. (character, 256)"""
    constraint_status: ByteArray = _array(3, dtype=np.uint8)
    """0 nothing held, 1 on the way, 2 held within 1 mm and 1 degree, 3 out of reach, 4 refused.
    (character, effector)"""
    constraint_distance: Float32Array = _array(3, dtype=np.float32)
    """Distance to where effectors are held, m. (character, effector)"""

    foot_contact: ByteArray = _array(2, dtype=np.uint8)
    """Contact of each foot: 0 swing, 1 heel, 2 ball. (character, 2)"""
    foot_point_world: FloatArray = _array(2, 2, 3)
    """Heel and ball of each foot in the final pose, m. (character, foot, point, 3)"""

    @classmethod
    def create(cls, capacity: int) -> "State":
        """Make the arrays for `capacity` slots, all empty."""
        arrays = {}
        for declared in fields(cls):
            shape = (capacity, *declared.metadata["shape"])
            arrays[declared.name] = aligned_full(shape, declared.metadata["fill"], declared.metadata["dtype"])
        return cls(**arrays)

    @property
    def capacity(self) -> int:
        """Number of slots."""
        return int(self.is_active.shape[0])

    @property
    def is_off_feet(self) -> BoolArray:
        """Who sits, sits down or stands up. (character,)"""
        return self.is_seated | (self.sitting_time > 0.0)

    def arrays(self) -> Iterator[tuple[str, npt.NDArray[Any]]]:
        """Names and arrays of all fields, in declared order."""
        for declared in fields(self):
            yield declared.name, getattr(self, declared.name)

    def clear(self, characters: IntArray) -> None:
        """Set the values of these slots back to those of an empty slot; counts are kept."""
        for declared in fields(self):
            if not declared.name.endswith(COUNTS):
                getattr(self, declared.name)[characters] = declared.metadata["fill"]
