"""Idle glances: now and then people look at somebody who comes near in front of them."""

import math
from typing import Any, NamedTuple

import numpy as np

from crowd_kernels._jit import kernel, parallel_kernel, prange
from crowd_kernels.gaze import CHARACTER, NOTHING
from crowd_kernels.neighbors import CHUNKS, NUMBER_MASK, find_nearest
from crowd_kernels.random import normal, uniform

PURPOSE_WHOM = 0x61A0
PURPOSE_LENGTH = 0x61A1
PURPOSE_PAUSE = 0x61A2
PURPOSE_GLANCE_ENTRY = 0x61A3
NO_LENGTH = 1e-6


class GlanceLimits(NamedTuple):
    """Whom people glance at, and for how long."""

    distance: float
    """Farthest person looked at, m."""
    field: float
    """Farthest to the side at which somebody is noticed, rad from straight ahead."""
    lost_field: float
    """Farther round than this a glance ends, rad."""
    distance_scale: float
    """Distance over which the interest in somebody falls to 1/e, m."""
    standing_interest: float
    """Interest in people who do not come nearer over that in those who do."""
    no_interest: float
    """Interest in nobody at all, against 1 for somebody who comes straight on and is near."""
    length_log_mean: float
    """Mean of the logarithm of a glance's length in s."""
    length_log_spread: float
    """Standard deviation of the same."""
    pause_log_mean: float
    """Mean of the logarithm of the time between two choices in s."""
    pause_log_spread: float
    """Standard deviation of the same."""


@kernel
def bearing(x: float, z: float, yaw: float) -> float:
    """Find how far a ground direction is from straight ahead: 0 to pi, rad."""
    ahead = x * math.sin(yaw) + z * math.cos(yaw)
    left = x * math.cos(yaw) - z * math.sin(yaw)
    return math.atan2(abs(left), ahead)


@kernel
def interest(
    limits: GlanceLimits, x: float, z: float, approach_x: float, approach_z: float, yaw: float
) -> float:
    """Rate how much somebody draws the eye.

    Parameters
    ----------
    limits : GlanceLimits
    x, z : float
        Way to the other, m.
    approach_x, approach_z : float
        Velocity of the other against oneself, m/s.
    yaw : float
        Own heading, rad.

    Returns
    -------
    float
        0 to 1; 0 for who is too far away or not in front.
    """
    distance = math.hypot(x, z)
    angle = bearing(x, z, yaw)
    if distance < NO_LENGTH or distance > limits.distance or angle > limits.field:
        return 0.0
    closing = -(x * approach_x + z * approach_z) / distance
    share = min(max(closing, 0.0), 1.0)
    share = limits.standing_interest + (1.0 - limits.standing_interest) * share
    return (
        share * math.exp(-distance / limits.distance_scale) * math.cos(0.5 * math.pi * angle / limits.field)
    )


@parallel_kernel
def glance_crowd(
    cell_start: Any,
    point: Any,
    sorted_character: Any,
    columns: int,
    rows: int,
    cell_size: float,
    limits: GlanceLimits,
    position_world: Any,
    velocity_world: Any,
    yaw: Any,
    is_active: Any,
    may_glance: Any,
    share: float,
    active: Any,
    seed: int,
    step: int,
    time: float,
    keys: Any,
    until: Any,
    is_glancing: Any,
    kind: Any,
    whom: Any,
    trunk: Any,
) -> None:
    """Choose whom people glance at, and end glances that have lasted or are lost.

    Parameters
    ----------
    cell_start, point, sorted_character
        From `crowd_kernels.cells.sort_into_cells`, made for at least the distance of the limits.
    columns, rows : int
        Of the cell table.
    cell_size : float
        m.
    limits : GlanceLimits
    position_world, velocity_world : (N, 3) float64
        m, m/s.
    yaw : (N,) float64
        Heading, rad.
    is_active : (N,) bool
        The row holds somebody.
    may_glance : (N,) bool
        Who glances at all.
    share : float
        Share of the trunk in a glance, 0 to 1.
    active : (A,) int32
        Characters to process, each once; 0 to N - 1. Those with a gaze that is no glance are passed over.
    seed, step : int
        Keys of the draws.
    time : float
        Simulation time, s.
    keys : (32, C) int64
        Scratch; C nearest people are considered.
    until : (N,) float64
        In and out: time of the next choice, s; 0 for somebody new.
    is_glancing : (N,) bool
        In and out: the gaze is a glance.
    kind : (N,) uint8
        In and out: 0 nothing, 2 a character; others are no glances.
    whom : (N,) int32
        In and out: who is looked at.
    trunk : (N,) float32
        In and out: share of the trunk.

    Notes
    -----
    **Source:** people look at others while they come nearer and away again when they are close (Foulsham,
    Walker, Kingstone, "The where, what and when of gaze allocation in the lab and the natural environment",
    2011).
    **Differs from the source:** the choice by closeness, approach and bearing, and its numbers, are the
    project's own.
    """
    count = active.shape[0]
    wanted = keys.shape[1]
    for k in prange(CHUNKS):
        chunk = (k * 37) % CHUNKS
        found_keys = keys[chunk]
        for index in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            character = active[index]
            if not may_glance[character] or (kind[character] != NOTHING and not is_glancing[character]):
                continue
            x, z = position_world[character, 0], position_world[character, 2]
            if is_glancing[character]:
                other = whom[character]
                dx, dz = position_world[other, 0] - x, position_world[other, 2] - z
                is_lost = not is_active[other] or bearing(dx, dz, yaw[character]) > limits.lost_field
                if is_lost or time >= until[character]:
                    is_glancing[character] = False
                    kind[character] = NOTHING
                    draw = normal(seed, character, step, PURPOSE_PAUSE)
                    until[character] = time + math.exp(limits.pause_log_mean + limits.pause_log_spread * draw)
                continue
            if time < until[character]:
                continue
            draw = normal(seed, character, step, PURPOSE_PAUSE)
            pause = math.exp(limits.pause_log_mean + limits.pause_log_spread * draw)
            if until[character] == 0.0:
                until[character] = time + pause * uniform(seed, character, step, PURPOSE_GLANCE_ENTRY)
                continue
            until[character] = time + pause
            if not (math.isfinite(x) and math.isfinite(z)):
                continue
            found = find_nearest(
                cell_start, point, sorted_character, columns, rows, cell_size,
                x, z, character, -1, limits.distance, wanted, found_keys,
            )  # fmt: skip
            total = limits.no_interest
            for place in range(found):
                other = np.int32(found_keys[place] & NUMBER_MASK)
                total += interest(
                    limits,
                    position_world[other, 0] - x,
                    position_world[other, 2] - z,
                    velocity_world[other, 0] - velocity_world[character, 0],
                    velocity_world[other, 2] - velocity_world[character, 2],
                    yaw[character],
                )
            rest = total * uniform(seed, character, step, PURPOSE_WHOM) - limits.no_interest
            for place in range(found):
                if rest < 0.0:
                    break
                other = np.int32(found_keys[place] & NUMBER_MASK)
                rest -= interest(
                    limits,
                    position_world[other, 0] - x,
                    position_world[other, 2] - z,
                    velocity_world[other, 0] - velocity_world[character, 0],
                    velocity_world[other, 2] - velocity_world[character, 2],
                    yaw[character],
                )
                if rest < 0.0:
                    is_glancing[character] = True
                    kind[character] = CHARACTER
                    whom[character] = other
                    trunk[character] = share
                    draw = normal(seed, character, step, PURPOSE_LENGTH)
                    until[character] = time + math.exp(
                        limits.length_log_mean + limits.length_log_spread * draw
                    )
