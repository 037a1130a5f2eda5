"""The last steps to a standing place: small moves ahead, aside and round."""

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

CLOSE = 0.035
"""Distance at which a person is at the place, m."""
FACING = 0.035
"""Error of the heading at which a person faces the right way, rad."""
NEARNESS_RATE, TURN_RATE = 2.2, 2.6
"""Speed over distance, and turn rate over angle, 1/s."""
FASTEST_STEP, FASTEST_TURN = 0.45, 1.8
"""m/s, rad/s."""


def errors(
    position_world: FloatArray, yaw: FloatArray, place_world: FloatArray, place_yaw: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Ways to the places in each person's frame (M, 2) left and ahead, m, and turns to make (M,), rad."""
    way = place_world - position_world
    sine, cosine = np.sin(yaw), np.cos(yaw)
    left = cosine * way[:, 0] - sine * way[:, 2]
    ahead = sine * way[:, 0] + cosine * way[:, 2]
    turn = (place_yaw - yaw + np.pi) % (2.0 * np.pi) - np.pi
    return np.stack([left, ahead], axis=1), turn


def is_settled(
    position_world: FloatArray, yaw: FloatArray, place_world: FloatArray, place_yaw: FloatArray
) -> BoolArray:
    """Who stands at the place and faces the right way. (M,)"""
    way, turn = errors(position_world, yaw, place_world, place_yaw)
    return np.asarray((np.hypot(way[:, 0], way[:, 1]) < CLOSE) & (np.abs(turn) < FACING))


def settle_parameters(
    position_world: FloatArray, yaw: FloatArray, place_world: FloatArray, place_yaw: FloatArray
) -> FloatArray:
    """Forward speed, turn rate and side speed that bring people to their places. (M, 3)"""
    way, turn = errors(position_world, yaw, place_world, place_yaw)
    velocity = NEARNESS_RATE * way
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    velocity *= np.minimum(1.0, FASTEST_STEP / np.maximum(speed, 1e-9))[:, None]
    velocity[np.hypot(way[:, 0], way[:, 1]) < 0.5 * CLOSE] = 0.0
    rate = np.clip(TURN_RATE * turn, -FASTEST_TURN, FASTEST_TURN)
    rate[np.abs(turn) < 0.5 * FACING] = 0.0
    return np.stack([velocity[:, 1], rate, velocity[:, 0]], axis=1)
