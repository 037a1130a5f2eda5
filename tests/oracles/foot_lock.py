"""Slow twin of `crowd_kernels.foot_lock`: one person in world space, with rotations of SciPy and matrices."""

from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

SWING, HEEL = 0, 1
GROUND = [0, 2]
LOWEST = 0.12


def rotation(quaternion):
    w, x, y, z = quaternion
    return Rotation.from_quat([x, y, z, w])


def about_y(angle):
    return Rotation.from_rotvec([0, angle, 0])


def spring(value, rate, goal, stiffness, dt):
    """A critically damped spring, by the exponential of its matrix."""
    step = expm(np.array([[0, 1], [-(stiffness**2), -2 * stiffness]]) * dt)
    offset, rate = step @ [value - goal, rate]
    return goal + offset, rate


@dataclass
class Foot:
    """What the lock remembers of one foot."""

    contact: int = SWING
    is_released: bool = False
    anchor: np.ndarray = field(default_factory=lambda: np.zeros(2))
    anchor_yaw: float = 0.0
    offset: np.ndarray = field(default_factory=lambda: np.zeros(3))
    offset_rate: np.ndarray = field(default_factory=lambda: np.zeros(3))
    yaw: float = 0.0
    yaw_rate: float = 0.0
    need: float = 0.0

    def fade(self, rate, dt):
        for axis in range(3):
            self.offset[axis], self.offset_rate[axis] = spring(
                self.offset[axis], self.offset_rate[axis], 0, rate, dt
            )
        self.yaw, self.yaw_rate = spring(self.yaw, self.yaw_rate, 0, rate, dt)

    def plan(self, wanted, heel, ball, tip, heading, leg_scale, limits, dt):
        """Where the foot goes: an offset and a turn of its animation."""
        if wanted == SWING:
            self.is_released = False
        elif self.is_released:
            wanted = SWING
        if wanted != SWING:
            point = heel if wanted == HEEL else ball
            if self.contact == SWING:
                self.anchor_yaw = heading + self.yaw
                self.anchor = (point + self.offset)[GROUND]
            elif wanted != self.contact:
                old = heel if self.contact == HEEL else ball
                self.anchor = (old + self.offset + about_y(self.yaw).apply(point - old))[GROUND]
            turned = np.angle(np.exp(1j * (self.anchor_yaw - heading)))
            yaw = np.clip(turned, -limits.release_yaw, limits.release_yaw)
            if yaw != turned:
                self.anchor_yaw = heading + yaw
            way = self.anchor - point[GROUND]
            if np.linalg.norm(way) > limits.release_distance * leg_scale:
                self.is_released, wanted = True, SWING
        if wanted == SWING:
            self.fade(limits.swing_rate, dt)
        else:
            self.offset_rate[GROUND] = (way - self.offset[GROUND]) / dt
            self.offset[GROUND] = way
            self.offset[1], self.offset_rate[1] = spring(
                self.offset[1], self.offset_rate[1], -point[1], limits.ground_rate, dt
            )
            self.yaw, self.yaw_rate = yaw, (yaw - self.yaw) / dt
        lowest = min(heel[1], ball[1], *([] if wanted == HEEL else [tip[1]]))
        if self.offset[1] < -lowest:
            self.offset[1], self.offset_rate[1] = -lowest, max(self.offset_rate[1], 0)
        self.contact = wanted


def needed_drop(hip, ankle, length, stretch):
    """How far a hip comes down until its leg is no longer than a softly limited share of its length."""
    slack = max(1 - np.linalg.norm(ankle - hip) / length, 0)
    used = (1 - slack - (1 - stretch) * np.exp(-slack / (1 - stretch))) * length
    down = hip - ankle
    away, height = np.hypot(down[0], down[2]), down[1]
    if height <= 0 or np.linalg.norm(down) <= used:
        return 0.0
    if away >= used:
        return height
    return brentq(lambda drop: np.hypot(away, height - drop) - used, 0, height, xtol=1e-15)


@dataclass
class Person:
    """What the lock remembers of one person."""

    feet: tuple[Foot, Foot] = field(default_factory=lambda: (Foot(), Foot()))
    deciding: Foot | None = None
    is_new: bool = True
    gap: float = 0.0
    gap_rate: float = 0.0
    drop: float = 0.0

    def lower(self, needs, leg_scale, limits, dt):
        """Follow the need of one leg at once, and ease away what another one leaves."""
        now, need = None, 0.0
        for foot, value in zip(self.feet, needs, strict=True):
            if foot.contact != SWING and value > need:
                now, need = foot, value
        fastest = limits.pelvis_speed * leg_scale
        rates = [
            np.clip((value - foot.need) / dt, -fastest, fastest)
            for foot, value in zip(self.feet, needs, strict=True)
        ]
        rate_of = {id(foot): rate for foot, rate in zip(self.feet, rates, strict=True)} | {id(None): 0.0}
        if not self.is_new:
            lowered = self.gap + (self.deciding.need if self.deciding else 0.0)
            lowered_rate = self.gap_rate + rate_of[id(self.deciding)]
            goal_rate = rate_of[id(now)]
            self.gap, self.gap_rate = spring(
                lowered - (need - goal_rate * dt), lowered_rate - goal_rate, 0, limits.pelvis_rate, dt
            )
        self.drop = np.clip(need + self.gap, 0, LOWEST * leg_scale)
        if self.drop != need + self.gap:
            self.gap, self.gap_rate = self.drop - need, 0.0
        for foot, value in zip(self.feet, needs, strict=True):
            foot.need = value
        self.deciding, self.is_new = now, False


@dataclass
class Leg:
    """Joints and limbs of one leg in the world."""

    hip: np.ndarray
    rotations: list[Rotation]
    limbs: list[np.ndarray]
    sole: np.ndarray

    def joints(self):
        knee = self.hip + self.rotations[0].apply(self.limbs[0])
        return knee, knee + self.rotations[1].apply(self.limbs[1])

    def points(self):
        """Heel, ball and tip."""
        ankle = self.joints()[1]
        heel, ball = ankle + self.rotations[2].apply(self.sole[:2])
        toe = ankle + self.rotations[2].apply(self.limbs[2])
        return heel, ball, toe + self.rotations[3].apply(self.sole[2])

    def bend(self, target, turn, stretch):
        """Take the ankle to a target: bend the knee in its plane, then turn the leg the shortest way."""
        knee, ankle = self.joints()
        upper, lower = np.linalg.norm(knee - self.hip), np.linalg.norm(ankle - knee)
        distance = np.clip(np.linalg.norm(target - self.hip), abs(upper - lower), stretch * (upper + lower))
        now = self._knee_angle(knee, ankle)
        then = np.arccos(np.clip((distance**2 - upper**2 - lower**2) / (2 * upper * lower), -1, 1))
        axis = np.cross(knee - self.hip, ankle - knee)
        bent = Rotation.from_rotvec((then - now) * axis / np.linalg.norm(axis))
        reached = knee - self.hip + bent.apply(ankle - knee)
        way = target - self.hip
        across = np.cross(reached, way)
        angle = np.arctan2(np.linalg.norm(across), reached @ way)
        swung = Rotation.from_rotvec(angle * across / max(np.linalg.norm(across), 1e-300))
        self.rotations[0] = swung * self.rotations[0]
        self.rotations[1] = swung * bent * self.rotations[1]
        self.rotations[2] = turn * self.rotations[2]

    def _knee_angle(self, knee, ankle):
        upper, lower = knee - self.hip, ankle - knee
        return np.arctan2(np.linalg.norm(np.cross(upper, lower)), upper @ lower)


def lock(person, legs, limits, scale, position, yaw, wanted, dt, quaternions, pelvis):
    """Lock the feet of a person.

    Returns the new matrices of thighs, shanks and feet against their parents (2, 3, 3, 3), the pelvis, heel
    and ball of both feet (2, 2, 3), and the contacts.
    """
    leg_scale = float(scale[legs.leg_segment])
    facing = about_y(yaw)
    place = np.array([position[0], 0, position[2]])
    body = facing * rotation(quaternions[0])
    root = place + facing.apply(np.asarray(pelvis, float) * leg_scale)
    built, targets, needs = [], [], []
    for side, foot in enumerate(person.feet):
        offsets = legs.offset[side] * np.asarray(scale, float)[legs.segment[side], None]
        rotations = [body]
        for joint in legs.joint[side]:
            rotations.append(rotations[-1] * rotation(quaternions[joint]))
        sole = legs.sole[side] * float(scale[legs.foot_segment])
        leg = Leg(root + body.apply(offsets[0]), rotations[1:], list(offsets[1:]), sole)
        heel, ball, tip = leg.points()
        ahead = leg.rotations[2].apply([0, 0, 1])
        foot.plan(wanted[side], heel, ball, tip, np.arctan2(ahead[0], ahead[2]), leg_scale, limits, dt)
        pivot = heel if foot.contact == HEEL else ball
        target = pivot + foot.offset + about_y(foot.yaw).apply(leg.joints()[1] - pivot)
        length = sum(np.linalg.norm(limb) for limb in offsets[1:3])
        built.append(leg)
        targets.append(target)
        needs.append(min(needed_drop(leg.hip, target, length, limits.stretch), LOWEST * leg_scale))
    person.lower(needs, leg_scale, limits, dt)
    local = np.zeros((2, 3, 3, 3))
    for side, (leg, target, foot) in enumerate(zip(built, targets, person.feet, strict=True)):
        leg.hip = leg.hip - [0, person.drop, 0]
        leg.bend(target, about_y(foot.yaw), limits.stretch)
        chain = [body, *leg.rotations[:3]]
        for part in range(3):
            local[side, part] = (chain[part].inv() * chain[part + 1]).as_matrix()
    lowered = np.asarray(pelvis, float) - [0, person.drop / leg_scale, 0]
    points = np.array([leg.points()[:2] for leg in built])
    return local, lowered, points, [foot.contact for foot in person.feet]
