"""Slow twin of `crowd_kernels.gaze`: one character at a time, with rotation matrices in double precision."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from tests.oracles.pose import matrix, row_to_quaternions


@dataclass
class Person:
    """What gaze keeps of one character."""

    turn: np.ndarray
    rate: np.ndarray
    eye_turn: np.ndarray
    weight: float = 0.0
    weight_rate: float = 0.0

    @classmethod
    def at_rest(cls, joints=7):
        return cls(np.zeros((joints, 3)), np.zeros((joints, 3)), np.zeros((2, 2)))


def spring(value, rate, goal, frequency, dt):
    """Critically damped spring by its closed form."""
    a, b = value - goal, rate + frequency * (value - goal)
    decay = np.exp(-frequency * dt)
    return goal + (a + b * dt) * decay, (rate - frequency * b * dt) * decay


def turned(vector):
    """Matrix of a rotation vector."""
    return Rotation.from_rotvec(vector).as_matrix()


def heading_and_rise(direction):
    """Angles of a direction about the vertical and above the horizontal."""
    return np.arctan2(direction[0], direction[2]), np.arctan2(
        direction[1], np.hypot(direction[0], direction[2])
    )


def into_ellipse(x, y, pitch, heading):
    return np.array([x, y]) / max(np.hypot(x / pitch, y / heading), 1.0)


class Chain:
    """Frames of one character's joints from waist to head."""

    def __init__(self, arrays, scale, pose_row, pelvis):
        quaternions = row_to_quaternions(pose_row)
        self.local = [matrix(quaternions[joint]) for joint in arrays.joint]
        self.offset = [arrays.offset[k] * float(scale[arrays.segment[k]]) for k in range(len(self.local))]
        self.eye_local = [matrix(quaternions[joint]) for joint in arrays.eye]
        self.eye_offset = [arrays.eye_offset[k] * float(scale[arrays.eye_segment[k]]) for k in range(2)]
        self.between = (self.eye_offset[0] + self.eye_offset[1]) / 2
        self.root = matrix(quaternions[0])
        self.pelvis = np.asarray(pelvis, float) * float(scale[arrays.leg_segment])

    def head(self, turns):
        """Frame of the head when the joints turn by `turns`."""
        rotation, position = self.root, self.pelvis
        for k in range(len(self.local)):
            position = position + rotation @ self.offset[k]
            rotation = rotation @ self.local[k] @ turned(turns[k])
        return rotation, position


def wanted_turns(arrays, limits, chain, target, trunk, side):
    """Turn of each joint for a target in the root frame: shares of what is missing, within limits."""
    count = len(chain.local)
    share = [
        float(s) * (trunk if is_trunk else 1.0)
        for s, is_trunk in zip(arrays.share, arrays.is_trunk, strict=True)
    ]
    turns = np.zeros((count, 3))
    for k in range(count):
        part = share[k] / (sum(share[k:]) + float(limits.eye_share))
        head_rotation, head_position = chain.head(turns)
        eyes = head_position + head_rotation @ chain.between
        way = target - eyes
        to_heading, to_rise = heading_and_rise(way)
        own_heading, own_rise = heading_and_rise(head_rotation[:, 2])
        heading = (to_heading - own_heading + np.pi) % (2 * np.pi) - np.pi
        if abs(heading) > np.radians(150) and heading * side < 0:
            heading += 2 * np.pi * side
        heading *= min(2 * np.hypot(way[0], way[2]) / np.linalg.norm(way), 1.0)
        heading, rise = heading * part, (to_rise - own_rise) * part
        middle = own_heading + heading / 2
        vector = heading * np.array([0, 1, 0]) - rise * np.array([np.cos(middle), 0, -np.sin(middle)])
        frame, _ = frame_of(chain, turns, k)
        vector = frame.T @ vector
        pitch, side_limit, roll = (float(x) for x in arrays.limit[k])
        turns[k, :2] = into_ellipse(vector[0], vector[1], pitch, side_limit)
        turns[k, 2] = np.clip(vector[2], -roll, roll)
        turns[k] += arrays.bias[k]
    return turns


def frame_of(chain, turns, k):
    """Frame of joint `k` before its own turn."""
    rotation, position = chain.root, chain.pelvis
    for j in range(k + 1):
        position = position + rotation @ chain.offset[j]
        rotation = rotation @ chain.local[j] @ (turned(turns[j]) if j < k else np.eye(3))
    return rotation, position


def gaze(
    arrays, limits, scale, place, yaw, trunk, follow, target_world, saccade, dt, pose_row, pelvis, person
):
    """One step; `target_world` None for nothing. Returns local matrices of chain and eyes, and the error."""
    chain = Chain(arrays, scale, pose_row, pelvis)
    rotation, position = chain.head(np.zeros((len(chain.local), 3)))
    eyes = position + rotation @ chain.between
    target = eyes + 2 * rotation[:, 2]
    is_looking = False
    if target_world is not None:
        there = turned([0, -yaw, 0]) @ (np.asarray(target_world) - [place[0], 0, place[2]])
        is_looking = bool(0.1 < np.linalg.norm(there - eyes) < 1e6)
        target = there if is_looking else target
    goal = float(is_looking)
    weight, person.weight_rate = spring(person.weight, person.weight_rate, goal, float(limits.fade_rate), dt)
    weight = float(np.clip(weight, 0, 1))
    mean = 0.5 * (person.weight + weight)
    person.weight = weight
    heading = person.turn[:, 1].sum()
    side = 0.0 if abs(heading) < 0.1 else np.sign(heading)
    wanted = mean * wanted_turns(arrays, limits, chain, target, trunk, side)
    goals = person.turn + follow * (wanted - person.turn)
    moved, rate = np.zeros_like(wanted), np.zeros_like(wanted)
    for k in range(len(wanted)):
        moved[k], rate[k] = spring(person.turn[k], person.rate[k], goals[k], float(arrays.rate[k]), dt)
    step = moved - person.turn
    slow = min(float(limits.head_speed) * dt / max(np.linalg.norm(step, axis=1).sum(), 1e-12), 1.0)
    person.turn, person.rate = person.turn + slow * step, slow * rate
    local = [chain.local[k] @ turned(person.turn[k]) for k in range(len(wanted))]
    head_rotation, head_position = chain.head(person.turn)
    local_eyes, errors = [], []
    for eye in range(2):
        frame = head_rotation @ chain.eye_local[eye]
        ray = frame.T @ (target - head_position - head_rotation @ chain.eye_offset[eye])
        ray /= np.linalg.norm(ray)
        aim = np.zeros(2)
        if is_looking:
            angle = np.arctan2(np.hypot(ray[0], ray[1]), ray[2])
            aim = angle * np.array([-ray[1], ray[0]]) / max(np.hypot(ray[0], ray[1]), 1e-12)
        pitch, side_limit = float(limits.eye_pitch), float(limits.eye_heading)
        change = into_ellipse(*aim, pitch, side_limit) - person.eye_turn[eye]
        most = float(limits.eye_speed) * dt
        person.eye_turn[eye] += change * min(most / max(np.linalg.norm(change), 1e-12), 1.0)
        axis = turned([*person.eye_turn[eye], 0])[:, 2]
        errors.append(np.arctan2(np.linalg.norm(np.cross(axis, ray)), axis @ ray))
        local_eyes.append(
            chain.eye_local[eye]
            @ turned([*into_ellipse(*(person.eye_turn[eye] + saccade), pitch, side_limit), 0])
        )
    return np.array(local + local_eyes), max(errors) if is_looking else 0.0


def eye_point(arrays, scale, place, yaw, pose_row, pelvis):
    """Point between the eyes in the world."""
    chain = Chain(arrays, scale, pose_row, pelvis)
    rotation, position = chain.head(np.zeros((len(chain.local), 3)))
    return np.array([place[0], place[1], place[2]]) + turned([0, yaw, 0]) @ (
        position + rotation @ chain.between
    )
