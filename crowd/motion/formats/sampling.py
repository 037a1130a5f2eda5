"""Motion at uneven key times, sampled at a uniform rate."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from crowd.motion.rotation import slerp
from crowd.motion.source import FloatArray


def frame_times(first: float, last: float, rate: float) -> FloatArray:
    """Times of all frames from the first key to the last, s."""
    return first + np.arange(int((last - first) * rate + 1e-4) + 1) / rate


def common_rate(times: FloatArray, slack: float = 0.02) -> float | None:
    """Rate of which all times (K,), s, ascending, are whole frames; None when they have none in common.

    `slack` is the share of a frame by which a printed time may be off.
    """
    steps = np.diff(times)
    steps = steps[steps > 1e-4]
    if not steps.size:
        return None
    # The shortest step gives the number of frames, and the whole time the rate to more digits.
    frames = round(float((times[-1] - times[0]) / steps.min()))
    rate = frames / float(times[-1] - times[0])
    rate = float(round(rate)) if abs(rate - round(rate)) < 1e-3 * rate else rate
    offsets = (times - times[0]) * rate
    return rate if float(np.abs(offsets - np.round(offsets)).max()) <= slack else None


def locate(times: FloatArray, at: FloatArray) -> tuple[npt.NDArray[np.intp], FloatArray]:
    """Key before each sampled time, and the share of the way to the next; clamped to the ends."""
    key = np.clip(np.searchsorted(times, at, side="right") - 1, 0, max(len(times) - 2, 0))
    if len(times) == 1:
        return key, np.zeros(len(at))
    width = times[key + 1] - times[key]
    return key, np.clip((at - times[key]) / np.where(width > 0.0, width, 1.0), 0.0, 1.0)


def lines(times: FloatArray, values: FloatArray, at: FloatArray) -> FloatArray:
    """Values (K, ...) at the sampled times, on straight lines between keys."""
    key, share = locate(times, at)
    after = np.minimum(key + 1, len(times) - 1)
    share = share.reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray(values[key] + share * (values[after] - values[key]))


def turns(times: FloatArray, rotation: FloatArray, at: FloatArray) -> FloatArray:
    """Rotations (K, ..., 4) at the sampled times, turning evenly between keys, the short way round."""
    key, share = locate(times, at)
    after = np.minimum(key + 1, len(times) - 1)
    share = share.reshape(-1, *[1] * (rotation.ndim - 2))
    return slerp(rotation[key], rotation[after], share)
