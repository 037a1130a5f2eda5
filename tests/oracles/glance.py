"""Slow twin of `crowd_kernels.glance`: everybody against everybody, in plain Python."""

import math

import numpy as np

from crowd_kernels import glance as kernel
from crowd_kernels.random import normal, uniform


def off_axis(way, yaw):
    """Angle between a way on the ground and straight ahead."""
    ahead = np.array([math.sin(yaw), math.cos(yaw)])
    return math.atan2(abs(ahead[1] * way[0] - ahead[0] * way[1]), float(ahead @ way))


def interest(limits, way, approach, yaw):
    distance, angle = math.hypot(*way), off_axis(way, yaw)
    if not 1e-6 <= distance <= limits.distance or angle > limits.field:
        return 0.0
    closing = min(max(-float(way @ approach) / distance, 0.0), 1.0)
    return (
        (limits.standing_interest + (1 - limits.standing_interest) * closing)
        * math.exp(-distance / limits.distance_scale)
        * math.cos(math.pi / 2 * angle / limits.field)
    )


def glance(limits, position, velocity, yaw, is_active, character, seed, step, time, count, until, whom):
    """New (until, whom) of one character; `count` nearest people are considered."""
    ground, speed = position[:, [0, 2]], velocity[:, [0, 2]]
    pause = math.exp(
        limits.pause_log_mean + limits.pause_log_spread * normal(seed, character, step, kernel.PURPOSE_PAUSE)
    )
    if whom >= 0:
        way = ground[whom] - ground[character]
        if not is_active[whom] or off_axis(way, yaw[character]) > limits.lost_field or time >= until:
            return time + pause, -1
        return until, whom
    if time < until:
        return until, whom
    if until == 0.0:
        return time + pause * uniform(seed, character, step, kernel.PURPOSE_GLANCE_ENTRY), -1
    distance = np.hypot(*(ground - ground[character]).T)
    near = [
        other
        for other in np.lexsort((np.arange(len(distance)), distance.astype(np.float32)))
        if other != character and is_active[other] and distance[other] < limits.distance
    ][:count]
    rates = [
        interest(limits, ground[other] - ground[character], speed[other] - speed[character], yaw[character])
        for other in near
    ]
    edges = np.cumsum([limits.no_interest, *rates])
    chosen = int(
        np.searchsorted(edges, edges[-1] * uniform(seed, character, step, kernel.PURPOSE_WHOM), "right")
    )
    if chosen == 0:
        return time + pause, -1
    length = math.exp(
        limits.length_log_mean
        + limits.length_log_spread * normal(seed, character, step, kernel.PURPOSE_LENGTH)
    )
    return time + length, int(near[chosen - 1])
