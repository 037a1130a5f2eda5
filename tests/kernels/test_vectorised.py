"""Row leaves of the pose kernels are compiled to packed instructions, and merged into their callers.

Nothing but speed tells when this is lost: a constant of the wrong type or one array more is enough.
"""

import platform
import re

import numba
import pytest
from llvmlite import binding

from crowd_kernels import (
    _jit,
    clip,
    gaze_rows,
    hand_pose,
    ik_accumulate,
    ik_effector,
    ik_joint,
    ik_limit,
    ik_system,
    lanes,
    pose,
    reach_blend,
)

FEATURES = binding.get_host_cpu_features()
ROW = numba.float32[::1]
ROWS = numba.float32[:, ::1]
NUMBER = numba.float32
INTEGER = numba.int64
INDICES = numba.int32[::1]

pytestmark = [
    pytest.mark.skipif(
        platform.machine().lower() not in ("x86_64", "amd64"), reason="reads x86 instructions"
    ),
    pytest.mark.skipif(not FEATURES.get("avx2", False), reason="needs a CPU with AVX2"),
    pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="nothing is compiled with NUMBA_DISABLE_JIT"),
    pytest.mark.skipif(_jit.CHECKS_BOUNDS, reason="bounds checks prevent packed instructions"),
]

ARITHMETIC_LEAVES = {
    clip.start_row: (ROW, ROW, NUMBER, NUMBER, ROW),
    clip.add_row: (ROW, ROW, NUMBER, NUMBER, ROW),
    clip.normalize_row: (ROW, ROW),
    clip.mix_row: (ROW, NUMBER, ROW, ROW),
    pose.child_row: (ROW, ROW, ROW, ROW, NUMBER, NUMBER, NUMBER, ROW, ROW),
    gaze_rows.look_back_row: (ROW, ROW, *[NUMBER] * 4, numba.boolean, ROW),
    gaze_rows.begin_row: (ROW, ROW, *[NUMBER] * 3),
    gaze_rows.aim_joint_row: (ROW, ROW, *[NUMBER] * 9),
    gaze_rows.excess_row: (*[NUMBER] * 3, ROW, NUMBER, NUMBER, ROW),
    gaze_rows.swing_row: (ROW, ROW, *[NUMBER] * 3),
    gaze_rows.settle_row: (ROW, ROW, *[NUMBER] * 4),
    gaze_rows.aim_eye_row: (ROW, ROW, *[NUMBER] * 6),
    gaze_rows.turn_eye_row: (ROW, NUMBER, NUMBER),
}
QUATERNION = numba.types.UniTuple(NUMBER, 4)
ARITHMETIC_LEAVES |= {
    ik_joint.forward_row: (ROW, ROW, NUMBER, NUMBER, NUMBER, ROW),
    ik_joint.pull_row: (ROW, NUMBER, NUMBER, ROW),
    ik_accumulate.add_own_moments_row: (ROW, NUMBER, ROW, ROW, ROW),
    ik_accumulate.add_moments_row: (ROW, NUMBER, ROW, ROW, ROW),
    ik_accumulate.add_lever_row: (ROW, NUMBER, ROW, ROW),
    ik_accumulate.finish_push_row: (ROW, ROW),
    ik_accumulate.finish_place_row: (ROW, ROW, ROW),
    ik_accumulate.finish_frame_row: (ROW, ROW, NUMBER, ROW),
    ik_accumulate.finish_cross_row: (ROW, ROW, ROW),
    ik_accumulate.take_place_row: (ROW, NUMBER, ROW, ROW, ROW),
    ik_accumulate.take_frame_row: (ROW, NUMBER, ROW, ROW, ROW),
    ik_accumulate.take_cross_row: (ROW, NUMBER, ROW, ROW, ROW),
    ik_effector.add_torque_row: (ROW, ROW, numba.boolean, ROW),
    ik_joint.step_row: (ROW, ROW, ROW),
    ik_joint.free_step_row: (ROW, NUMBER, ROW, ROW),
    ik_limit.find_room_row: (NUMBER, *[NUMBER] * 2, ROW),
    ik_limit.find_limit_row: (NUMBER, QUATERNION, QUATERNION, *[NUMBER] * 2, ROW),
    ik_limit.excess_row: (*[NUMBER] * 3, ROW, ROW),
    ik_limit.limit_row: (ROW, NUMBER, QUATERNION, QUATERNION, *[NUMBER] * 5, ROW, ROW, ROW, ROW),
    ik_system.subtract_block: (ROW, ROW, ROW),
}
ARITHMETIC_LEAVES |= {
    hand_pose.turn_fingers_row: (ROW, ROW, ROW),
    reach_blend.blend_row: (ROW, ROW, ROW, *[NUMBER] * 3, ROW),
    reach_blend.unit_row: (ROW,),
    reach_blend.share_row: (ROW, *[NUMBER] * 4, ROW),
    reach_blend.add_group_row: (ROW, ROW, ROW, ROW),
    reach_blend.complete_row: (ROW, ROW, ROW),
}
SHUFFLE_LEAVES = {
    lanes.interleave: (ROW, ROW, ROW, ROW, INTEGER, ROW),
    lanes.deinterleave: (ROW, INTEGER, ROW, ROW, ROW, ROW),
}
CALLERS = {
    clip.blend_chunk: (
        *(ROWS, ROWS, INDICES, INTEGER, INTEGER, numba.int32[:, ::1], numba.int32[:, ::1], ROWS, ROWS, ROW),
        *(INDICES, ROWS, ROW, ROWS, ROWS, ROW),
    ),
    lanes.gather_block: (ROWS, INDICES, INTEGER, ROW, ROW),
    lanes.scatter_block: (ROW, INTEGER, INDICES, INTEGER, ROW, ROWS),
}


def assembly(kernel, signature):
    """Machine code of a kernel compiled afresh: a cached one has none to show."""
    options = {"error_model": "numpy", "forceinline": kernel.targetoptions.get("forceinline", False)}
    compiled = numba.njit(signature, **options)(kernel.py_func)
    (text,) = compiled.inspect_asm().values()
    # What follows the kernel itself converts arguments from Python.
    return text.partition("cpython")[0]


def packed(text, operations):
    """Number of instructions on 8 or 16 floats at once."""
    return len(re.findall(rf"^\s+v(?:{operations})\s.*%[yz]mm", text, re.MULTILINE))


def name_of(value):
    return getattr(value, "__name__", "")


@pytest.mark.parametrize(("leaf", "signature"), ARITHMETIC_LEAVES.items(), ids=name_of)
def test_arithmetic_is_packed_and_in_single_precision(leaf, signature):
    text = assembly(leaf, signature)
    assert packed(text, "mulps|fmadd[0-9]+ps") >= 2
    assert packed(text, "addps|subps|fmadd[0-9]+ps") >= 1
    assert not re.search(r"v(mul|add|sub|div|sqrt)[sp]d", text)


@pytest.mark.parametrize(("leaf", "signature"), SHUFFLE_LEAVES.items(), ids=name_of)
def test_streams_are_merged_and_split_by_shuffles(leaf, signature):
    text = assembly(leaf, signature)
    # One shuffle of two whole registers of 16 floats does the work of two and more.
    is_double = re.search(r"^\s+vperm[ti]2ps\s.*%zmm", text, re.MULTILINE)
    assert packed(text, r"perm\w+|unpck\w+|shuf\w+|insert\w+") >= (4 if is_double else 8)


@pytest.mark.parametrize(("caller", "signature"), CALLERS.items(), ids=name_of)
def test_callers_hold_their_leaves_and_count_no_references(caller, signature):
    text = assembly(caller, signature)
    assert packed(text, r"mov[au]ps|mov[au]pd") >= 8
    assert "NRT_incref" not in text


def test_kinematics_holds_the_arithmetic_of_a_joint():
    cube = numba.float32[:, :, ::1]
    text = assembly(
        pose.kinematics_chunk,
        (INDICES, ROWS, INDICES, INTEGER, ROWS, ROWS, ROWS, INDICES, INTEGER, INTEGER, ROW, cube, cube),
    )
    assert packed(text, "mulps|fmadd[0-9]+ps") >= 30
