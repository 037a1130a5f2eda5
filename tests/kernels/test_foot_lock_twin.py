"""Foot locking as its slow twin does it, on people who sway, turn, slip, step and are dragged."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from crowd.controllers.foot_lock import FootLock
from crowd.motion.body import build_skeleton
from tests.oracles import foot_lock as oracle
from tests.oracles import pose

DT = 1 / 60
SKELETON = build_skeleton()
COUNT = 5


class Walk:
    """People whose legs swing, bend and straighten, on a root that wanders."""

    def __init__(self, seed, sway, drift):
        rng = np.random.default_rng(seed)
        self.rng, self.drift = rng, drift
        self.lock = FootLock(SKELETON, capacity=COUNT, dt=DT)
        self.people = [oracle.Person() for _ in range(COUNT)]
        self.scale = rng.uniform(0.85, 1.15, (COUNT, 8)).astype(np.float32)
        self.bend = rng.uniform(0.02, 0.5, (COUNT, 2))
        self.sway = rng.normal(0, sway, (COUNT, 2, 4, 3))
        self.speed = rng.uniform(1.0, 6.0, (COUNT, 2, 4, 1))
        self.trunk = rng.normal(0, 0.1, (COUNT, 3))
        self.velocity = rng.normal(0, drift, (COUNT, 3))
        self.position, self.yaw = rng.normal(0, 2, (COUNT, 3)), rng.uniform(-3, 3, COUNT)
        self.turn_rate = rng.normal(0, drift, COUNT)
        self.wanted = rng.integers(0, 3, (COUNT, 2)).astype(np.uint8)
        self.time = 0.0

    def poses(self):
        """Pose rows and pelvis heights at which the longer leg just stands, or hangs a little."""
        rows, pelvis = [], np.zeros((COUNT, 3), np.float32)
        for k in range(COUNT):
            quaternions = np.zeros((SKELETON.joint_count, 4))
            quaternions[:, 0] = 1
            quaternions[0] = oracle.Rotation.from_rotvec(self.trunk[k]).as_quat()[[3, 0, 1, 2]]
            for leg, side in enumerate(("right", "left")):
                bend = self.bend[k, leg] * (1.1 + np.sin(3 * self.time + leg + k))
                for part, (name, angle) in enumerate(
                    (("thigh", -bend), ("shank", 2 * bend), ("foot", -bend), ("toe", 0))
                ):
                    turned = self.sway[k, leg, part] * np.sin(self.speed[k, leg, part] * self.time)
                    turned = turned + [angle, 0, 0]
                    if name == "shank":
                        turned[1:] *= 0.2
                    quaternions[SKELETON.joint(f"{side}_{name}")] = oracle.Rotation.from_rotvec(
                        turned
                    ).as_quat()[[3, 0, 1, 2]]
            rows.append(pose.quaternions_to_row(quaternions))
            pelvis[k] = SKELETON.offset[0] + (0, 0.01 - 0.04 * np.sin(2 * self.time + k), 0.02)
        return np.array(rows), pelvis

    def step(self):
        """Advance, and give what kernel and twin make of it: pairs of arrays by name."""
        self.time += DT
        self.position += self.velocity * (1, 0, 1) * DT
        self.yaw += self.turn_rate * DT
        changed = self.rng.random((COUNT, 2)) < 0.08
        self.wanted[changed] = self.rng.integers(0, 3, int(changed.sum()))
        rows, pelvis = self.poses()
        before, pelvis_before = rows.copy(), pelvis.copy()
        point, contact = np.zeros((COUNT, 2, 2, 3)), np.zeros((COUNT, 2), np.uint8)
        active = np.arange(COUNT, dtype=np.int32)
        lock = self.lock
        lock.evaluate(
            rows, pelvis, self.scale, self.position, self.yaw, self.wanted, active, DT, point, contact
        )
        for k, person in enumerate(self.people):
            local, lowered, points, contacts = oracle.lock(
                person,
                lock.legs,
                lock.settings.limits,
                self.scale[k],
                self.position[k],
                self.yaw[k],
                self.wanted[k],
                DT,
                pose.row_to_quaternions(before[k]),
                pelvis_before[k],
            )
            written = pose.row_to_quaternions(rows[k])
            matrices = [[pose.matrix(written[joint]) for joint in leg[:3]] for leg in lock.legs.joint]
            yield "rotations", np.array(matrices), local, 2e-7
            yield "pelvis", pelvis[k], lowered, 1.2e-7
            yield "points", point[k], points, 1e-11
            yield "contact", contact[k], contacts, 0
            yield "drop", lock.drop[k], person.drop, 1e-10
            for leg, foot in enumerate(person.feet):
                yield "offset", lock.offset[k, leg], foot.offset, 1e-12
                yield "offset rate", lock.offset_rate[k, leg], foot.offset_rate, 1e-9
                yield "yaw", lock.yaw_offset[k, leg], foot.yaw, 1e-12
                yield "released", lock.is_released[k, leg], foot.is_released, 0
            untouched = np.ones(len(written), bool)
            untouched[lock.legs.joint[:, :3]] = False
            yield "other joints", written[untouched], pose.row_to_quaternions(before[k])[untouched], 0


@settings(max_examples=6)
@given(seed=st.integers(0, 2**32 - 1), sway=st.floats(0, 0.3), drift=st.floats(0, 1.2))
def test_every_step_is_that_of_the_slow_twin(seed, sway, drift):
    walk = Walk(seed, sway, drift)
    for step in range(25):
        for name, found, expected, tolerance in walk.step():
            np.testing.assert_allclose(
                found, expected, rtol=0, atol=tolerance, err_msg=f"{name}, step {step}"
            )


def test_these_people_show_all_that_there_is():
    """Landings, hand-overs, feet let go, pelvises lowered by either leg and legs at their limit all occur.

    The first comparison of a step is enough to take it.
    """
    seen = dict.fromkeys(("heel", "ball", "released", "right decides", "left decides", "neither"), 0)
    for seed in range(4):
        walk = Walk(seed, 0.2, 1.0)
        for _ in range(40):
            next(walk.step())
            seen["heel"] += int((walk.lock.contact == 1).sum())
            seen["ball"] += int((walk.lock.contact == 2).sum())
            seen["released"] += int(walk.lock.is_released.sum())
            for number, name in enumerate(("neither", "right decides", "left decides"), 1):
                seen[name] += int((walk.lock.deciding == number).sum())
    assert min(seen.values()) > 10, seen
