"""Slow twins of `crowd_kernels.locomotion`: one character at a time, complex numbers for the ground plane.

A ground vector (x, z) is written z + i x, so that facing at yaw a is exp(i a) and left is i times facing.
"""

import cmath
import math

import numpy as np


def ground(vector):
    return complex(vector[2], vector[0])


def prefer(position, yaw, way_point, remaining, wanted_speed, slows, braking_time, full_angle, zero_angle):
    way = ground(way_point) - ground(position)
    speed = min(wanted_speed, remaining / braking_time) if slows else wanted_speed
    if abs(way) <= 1e-9 or speed <= 0:
        return np.zeros(3)
    error = abs(cmath.phase(way / cmath.exp(1j * yaw)))
    share = np.clip((zero_angle - error) / (zero_angle - full_angle), 0, 1)
    velocity = speed * (3 * share**2 - 2 * share**3) * way / abs(way)
    return np.array([velocity.imag, 0, velocity.real])


def limited(value, goal, change):
    return float(np.clip(goal, value - change, value + change))


def command(yaw, position, way_point, desired, walks, heading, turning_side, parameter, limits, dt):
    """One character; returns heading velocity, turning side, limited parameter and wanted parameter."""
    facing = cmath.exp(1j * yaw)
    velocity = ground(desired)
    heading = ground(heading)
    heading += min(dt / limits.heading_time, 1) * (velocity - heading)
    body = velocity / facing
    turn = 0.0
    way = ground(way_point) - ground(position)
    if walks and abs(way) > 1e-6:
        trust = min((abs(heading) / limits.heading_speed) ** 2, 1)
        ahead = trust * heading + (1 - trust) * limits.heading_speed * way / abs(way)
        error = cmath.phase(ahead / facing)
        if abs(error) > math.radians(165) and turning_side:
            error = abs(error) * turning_side
        turning_side = 1 if error >= 0 else -1
        turn = float(np.clip(limits.turn_gain * error, -limits.largest_turn_rate, limits.largest_turn_rate))
    wanted = np.array([body.real, turn, body.imag])
    slows = abs(wanted[0]) < abs(parameter[0]) or wanted[0] * parameter[0] < 0
    changes = (
        limits.braking if slows else limits.forward_acceleration,
        limits.turn_acceleration,
        limits.side_acceleration,
    )
    new = np.array([limited(p, w, c * dt) for p, w, c in zip(parameter, wanted, changes, strict=True)])
    return np.array([heading.imag, 0, heading.real]), turning_side, new, wanted


def spring(value, rate, goal, stiffness, dt, parts=4000):
    """Integrate the critically damped spring by many small midpoint steps."""
    h = dt / parts
    for _ in range(parts):
        acceleration = -2 * stiffness * rate - stiffness**2 * (value - goal)
        middle_value, middle_rate = value + 0.5 * h * rate, rate + 0.5 * h * acceleration
        acceleration = -2 * stiffness * middle_rate - stiffness**2 * (middle_value - goal)
        value, rate = value + h * middle_rate, rate + h * acceleration
    return value, rate


def integrate_root(position, yaw, parameter, dt, parts=2000):
    """Follow the arc in many small steps."""
    here, h = ground(position), dt / parts
    for part in range(parts):
        facing = cmath.exp(1j * (yaw + (part + 0.5) * h * parameter[1]))
        here += h * facing * complex(parameter[0], parameter[2])
    return np.array([here.imag, position[1], here.real]), cmath.phase(
        cmath.exp(1j * (yaw + parameter[1] * dt))
    )
