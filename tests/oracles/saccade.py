"""Slow twin of `crowd_kernels.saccade`: one person at a time, in plain Python."""

import math

import numpy as np

from crowd_kernels import saccade as kernel
from crowd_kernels.random import normal, uniform

SHARES = np.array(
    [[15.54, 6.46, 17.69, 7.44, 16.80, 7.89, 20.38, 7.79]] * 2
    + [[5.46, 10.54, 24.69, 6.44, 6.89, 12.80, 26.38, 6.79]]
)
"""Percent of saccades to the right, up and right, up, ... as published."""


def magnitude_share(low, high, cap):
    """Share of magnitudes between two bounds, degrees: shifted exponential below a cap."""
    least = 6.9 * math.log(15.7 / 15.0)

    def below(magnitude):
        return np.clip(1.0 - (15.7 / 15.0) * math.exp(-min(max(magnitude, least), cap) / 6.9), 0, 1)

    return (below(high) - below(low)) / below(cap)


def offset(modes, mode, seed, character, step):
    """Where a saccade goes, degrees to the left and up."""
    draw = uniform(seed, character, step, kernel.PURPOSE_DIRECTION)
    direction = int(np.searchsorted(modes.direction[mode], draw, side="right"))
    angle = math.radians(45 * direction)
    share = {0: 1.0, 1: 0.75, 2: 0.5, 3: 0.75}[direction % 4]
    cap = math.degrees(modes.magnitude_cap[mode]) * share
    # The inverse of the distribution below the cap.
    u = uniform(seed, character, step, kernel.PURPOSE_MAGNITUDE)
    low = 15.7 * math.exp(-cap / 6.9)
    magnitude = -6.9 * math.log((15.0 - (15.0 - low) * u) / 15.7)
    return -magnitude * math.cos(angle), magnitude * math.sin(angle)


class Eyes:
    """One person's saccades."""

    def __init__(self):
        self.start, self.goal, self.now = np.zeros(2), np.zeros(2), np.zeros(2)
        self.clock = self.duration = self.until = 0.0

    def step(self, modes, mode, seed, character, step, time, dt):
        def interval(is_away):
            draw = normal(seed, character, step, kernel.PURPOSE_INTERVAL)
            k = int(is_away)
            return max(
                math.exp(modes.interval_log_mean[mode, k] + modes.interval_log_spread[mode, k] * draw), 1e-3
            )

        is_away = bool(self.goal.any())
        jumps = is_away if mode == 255 else self.duration > 0 and time >= self.until
        if mode != 255 and self.duration == 0:
            self.until = time + uniform(seed, character, step, kernel.PURPOSE_ENTRY) * interval(False)
            self.duration = self.clock = 0.025
        if jumps:
            back = mode == 255 or (
                is_away and uniform(seed, character, step, kernel.PURPOSE_KIND) < modes.return_share[mode]
            )
            left, up = (0.0, 0.0) if back else offset(modes, mode, seed, character, step)
            self.start, self.goal = self.now.copy(), np.radians([-up, left])
            self.duration = 0.025 + 0.0024 * np.degrees(np.linalg.norm(self.goal - self.start))
            self.clock = 0.0
            if mode != 255:
                self.until = time + self.duration + interval(not back)
        if self.clock < self.duration:
            self.clock += dt
            t = min(self.clock / self.duration, 1.0)
            self.now = self.start + (10 * t**3 - 15 * t**4 + 6 * t**5) * (self.goal - self.start)
        return self.now
