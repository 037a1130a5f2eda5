"""From gait phase and blended examples to key frames and foot contacts."""

import math
from typing import Any

from crowd_kernels._jit import parallel_kernel, prange

CHUNKS = 32
SWING = 0
HEEL = 1
BALL = 2


@parallel_kernel
def sample_crowd(
    example_clip: Any,
    first_key: Any,
    key_count: Any,
    example: Any,
    example_weight: Any,
    phase: Any,
    active: Any,
    out_frame: Any,
    out_next_frame: Any,
    out_fraction: Any,
    out_weight: Any,
) -> None:
    """Find the key frames of the blended examples at the gait phase.

    Keys are uniform in phase over two cycles, so examples of any duration are in step.

    Parameters
    ----------
    example_clip : (E,) int32
        Clip of each example.
    first_key, key_count : (C,) int32
        Rows of each clip in the clip table.
    example : (N, 4) int32
        Blended examples.
    example_weight : (N, 4) float64
        Their weights.
    phase : (N,) float64
        Cycles in [0, 2).
    active : (A,) int32
        Characters to process.
    out_frame, out_next_frame : (N, 4) int32
        Key rows before and after.
    out_fraction : (N, 4) float32
        Place between them.
    out_weight : (N, 4) float32
        Weights for the pose kernel.

    Notes
    -----
    **Source:** Feng, Xu, Shapiro, section 4.1, sub-motions between foot placements.
    """
    count = active.shape[0]
    for k in prange(CHUNKS):
        chunk = (k * 37) % CHUNKS
        for index in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            character = active[index]
            for corner in range(4):
                clip = example_clip[example[character, corner]]
                keys = key_count[clip]
                position = 0.5 * phase[character] * keys
                key = min(int(position), keys - 1)
                out_frame[character, corner] = first_key[clip] + key
                out_next_frame[character, corner] = first_key[clip] + (key + 1 if key + 1 < keys else 0)
                out_fraction[character, corner] = position - key
                out_weight[character, corner] = example_weight[character, corner]


@parallel_kernel
def contact_crowd(
    contact_phase: Any, example: Any, example_weight: Any, phase: Any, active: Any, out_contact_wanted: Any
) -> None:
    """Find which part of each foot is planted in the blend.

    Parameters
    ----------
    contact_phase : (E, 2, 2) float64
        For each example and foot (right, left): share of a cycle from that foot's strike to foot flat, and to
        toe off.
    example : (N, 4) int32
        Blended examples.
    example_weight : (N, 4) float64
        Their weights.
    phase : (N,) float64
        Cycles in [0, 2); the right heel strikes at 0 and 1, the left one at 0.5 and 1.5.
    active : (A,) int32
        Characters to process.
    out_contact_wanted : (N, 2) uint8
        0 swing, 1 heel, 2 ball.

    Notes
    -----
    **Source:** correspondence of foot events in time-warped blends (Park, Shin, Shin, 2002): events of a
    blend are the weighted means of the examples' events.
    """
    count = active.shape[0]
    for k in prange(CHUNKS):
        chunk = (k * 37) % CHUNKS
        for index in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            character = active[index]
            for foot in range(2):
                since_strike = phase[character] - 0.5 * foot
                since_strike -= math.floor(since_strike)
                flat = 0.0
                toe_off = 0.0
                for corner in range(4):
                    share = example_weight[character, corner]
                    flat += share * contact_phase[example[character, corner], foot, 0]
                    toe_off += share * contact_phase[example[character, corner], foot, 1]
                contact = SWING
                if since_strike < flat:
                    contact = HEEL
                elif since_strike < toe_off:
                    contact = BALL
                out_contact_wanted[character, foot] = contact
