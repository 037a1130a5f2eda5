"""Clocks of the layers around locomotion: idle variations and clips played over the pose."""

import math
from typing import Any

from crowd_kernels._jit import kernel, parallel_kernel, prange
from crowd_kernels.easing import minimum_jerk
from crowd_kernels.locomotion import ease
from crowd_kernels.random import uniform

CHUNKS = 32
PURPOSE_IDLE_CLIP = 171
PURPOSE_IDLE_DWELL = 172


@kernel
def key_at(
    time: float, first_key: int, key_count: int, key_rate: float, is_cyclic: bool
) -> tuple[int, int, float]:
    """Find the two key frames around a time and the fraction between them.

    Parameters
    ----------
    time : float
        Clip time, s; wrapped in cyclic clips, clamped in others.
    first_key, key_count : int
        Rows of the clip in the clip table.
    key_rate : float
        Key frames per second.
    is_cyclic : bool
        The key after the last one is the first one.

    Returns
    -------
    tuple of int, int, float
        Row of the key before, row of the key after, fraction in [0, 1].
    """
    position = time * key_rate
    if is_cyclic:
        position -= key_count * math.floor(position / key_count)
        index = min(int(position), key_count - 1)
        following = index + 1 if index + 1 < key_count else 0
        return first_key + index, first_key + following, position - index
    position = min(max(position, 0.0), key_count - 1.0)
    index = min(int(position), max(key_count - 2, 0))
    following = min(index + 1, key_count - 1)
    return first_key + index, first_key + following, position - index


@parallel_kernel
def idle_crowd(
    clips: Any,
    first_key: Any,
    key_count: Any,
    key_rate: Any,
    active: Any,
    seed: int,
    step: int,
    time: float,
    dt: float,
    crossfade: float,
    shortest_dwell: float,
    longest_dwell: float,
    idle_clip: Any,
    idle_time: Any,
    idle_mix: Any,
    idle_until: Any,
    out_frame: Any,
    out_next_frame: Any,
    out_fraction: Any,
    out_weight: Any,
) -> None:
    """Advance idle variations and write the key frames to blend.

    Each character stays with a variation for a random while, then passes to another one. The first
    variation is the neutral one and is drawn as often as all others together.

    Parameters
    ----------
    clips : (I,) int32
        Table indices of the idle clips, neutral first.
    first_key, key_count : (C,) int32
        Rows of every clip in the clip table.
    key_rate : (C,) float64
        Key frames per second.
    active : (A,) int32
        Characters to process.
    seed, step : int
        Keys of the random choice.
    time, dt : float
        Simulation time and step, s.
    crossfade : float
        Length of the passage between variations, s.
    shortest_dwell, longest_dwell : float
        Range of the uniform time with one variation, s.
    idle_clip : (N, 2) int32
        In and out: position in `clips` of the variation left and of the one entered.
    idle_time : (N, 2) float64
        In and out: clip time of both, s.
    idle_mix : (N,) float64
        In and out: progress of the passage, 0 to 1.
    idle_until : (N,) float64
        In and out: time of the next choice, s.
    out_frame, out_next_frame : (N, 2) int32
        Key frames before and after.
    out_fraction : (N, 2) float32
        Place between them, 0 to 1.
    out_weight : (N, 2) float32
        Weights of the two variations.

    Notes
    -----
    **Source:** layer 2 of the controller stack of Feng, Xu, Shapiro, table 1.
    **Differs from the source:** several variations with random dwell instead of one idle clip.
    """
    count = active.shape[0]
    for k in prange(CHUNKS):
        chunk = (k * 37) % CHUNKS
        for index in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            character = active[index]
            if idle_mix[character] < 1.0:
                idle_mix[character] = min(idle_mix[character] + dt / crossfade, 1.0)
            elif time >= idle_until[character]:
                idle_clip[character, 0] = idle_clip[character, 1]
                idle_time[character, 0] = idle_time[character, 1]
                draw = uniform(seed, character, step, PURPOSE_IDLE_CLIP)
                chosen = int((2.0 * draw - 1.0) * (clips.shape[0] - 1)) + 1 if draw >= 0.5 else 0
                idle_clip[character, 1] = min(chosen, clips.shape[0] - 1)
                if idle_clip[character, 1] != idle_clip[character, 0]:
                    idle_time[character, 1] = 0.0
                    idle_mix[character] = 0.0
                dwell = uniform(seed, character, step, PURPOSE_IDLE_DWELL)
                idle_until[character] = time + shortest_dwell + (longest_dwell - shortest_dwell) * dwell
            weight = minimum_jerk(idle_mix[character])
            for sample in range(2):
                idle_time[character, sample] += dt
                clip = clips[idle_clip[character, sample]]
                frame, following, fraction = key_at(
                    idle_time[character, sample], first_key[clip], key_count[clip], key_rate[clip], True
                )
                out_frame[character, sample] = frame
                out_next_frame[character, sample] = following
                out_fraction[character, sample] = fraction
                out_weight[character, sample] = weight if sample == 1 else 1.0 - weight


@parallel_kernel
def play_crowd(
    first_key: Any,
    key_count: Any,
    key_rate: Any,
    is_cyclic: Any,
    active: Any,
    dt: float,
    ease_rate: float,
    fade_time: float,
    play_clip: Any,
    play_time: Any,
    play_end: Any,
    play_weight: Any,
    play_weight_rate: Any,
    play_queued: Any,
    play_queued_length: Any,
    out_frame: Any,
    out_next_frame: Any,
    out_fraction: Any,
    out_weight: Any,
    out_layer_weight: Any,
) -> None:
    """Advance played clips, ease them in and out, and write the key frames to blend.

    Parameters
    ----------
    first_key, key_count : (C,) int32
        Rows of every clip in the clip table.
    key_rate : (C,) float64
        Key frames per second.
    is_cyclic : (C,) bool
        The clip repeats.
    active : (A,) int32
        Characters that play a clip.
    dt : float
        s.
    ease_rate : float
        Rate of the critically damped change of the weight, 1/s.
    fade_time : float
        Time before the end at which the clip starts to fade out, s.
    play_clip : (N,) int32
        In and out: table index of the clip; once it has faded out the queued one, or -1.
    play_time : (N,) float64
        In and out: time since the start, s.
    play_end : (N,) float64
        In and out: length of the play, s.
    play_weight, play_weight_rate : (N,) float64
        In and out: share of the clip in [0, 1] and its rate, 1/s.
    play_queued : (N,) int32
        In and out: clip that follows, -1 for none.
    play_queued_length : (N,) float64
        Length of the play that follows, s.
    out_frame, out_next_frame : (N, 1) int32
        Key frames before and after.
    out_fraction : (N, 1) float32
        Place between them, 0 to 1.
    out_weight : (N, 1) float32
        1.
    out_layer_weight : (N,) float32
        `play_weight`.

    Notes
    -----
    **Source:** layer 4 of the controller stack of Feng, Xu, Shapiro, table 1.
    """
    count = active.shape[0]
    for k in prange(CHUNKS):
        chunk = (k * 37) % CHUNKS
        for index in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            character = active[index]
            clip = play_clip[character]
            play_time[character] += dt
            frame, following, fraction = key_at(
                play_time[character], first_key[clip], key_count[clip], key_rate[clip], is_cyclic[clip]
            )
            goal = 1.0 if play_time[character] < play_end[character] - fade_time else 0.0
            weight, rate = ease(play_weight[character], play_weight_rate[character], goal, ease_rate, dt)
            if goal == 0.0 and weight < 1e-3:
                weight = 0.0
                rate = 0.0
                play_clip[character] = play_queued[character]
                play_time[character] = 0.0
                play_end[character] = play_queued_length[character]
                play_queued[character] = -1
            play_weight[character] = weight
            play_weight_rate[character] = rate
            out_frame[character, 0] = frame
            out_next_frame[character, 0] = following
            out_fraction[character, 0] = fraction
            out_weight[character, 0] = 1.0
            out_layer_weight[character] = weight
