"""Slow twins of reaching: minimum-jerk motion by its equations, and the blended pose of one hand."""

import numpy as np
from scipy.interpolate import BSpline

from crowd.motion.rotation import multiply, rotate


def settle(place, velocity, acceleration, time, dt):
    """The quintic with given start and an end at rest at 0, from the six conditions it fulfils."""
    if time <= dt:
        return 0.0, 0.0, 0.0
    rows, wanted = [], [place, velocity, acceleration, 0.0, 0.0, 0.0]
    for t in (0.0, time):
        for order in range(3):
            rows.append(
                [
                    np.prod(range(p - order + 1, p + 1)) * t ** max(p - order, 0) if p >= order else 0.0
                    for p in range(6)
                ]
            )
    curve = np.polynomial.Polynomial(np.linalg.solve(np.array(rows, float), wanted))
    return curve(dt), curve.deriv()(dt), curve.deriv(2)(dt)


def minimum_jerk(u):
    u = np.clip(u, 0.0, 1.0)
    return u**3 * (u * (6 * u - 15) + 10)


def spline_shares(place, last):
    """Shares of the keys {key: share} by SciPy's quadratic B-splines, whose end pieces go on to the ends."""
    middle = np.clip(np.floor(place + 0.5), 1, last - 1)
    piece = BSpline.basis_element(np.arange(4) - 1.5)
    shares = {}
    for key in range(int(middle) - 1, int(middle) + 2):
        # The polynomial that the piece is around the middle, found at three places of it.
        near = middle + np.array([-0.4, 0.0, 0.4])
        shares[key] = np.polyval(np.polyfit(near - middle, piece(near - key), 2), place - middle)
    return shares


def blend(keys, weights, course):
    """Rotations (J, 4) and pelvis (3,) of examples, {number: weight}, at a course."""
    rotation, pelvis = np.zeros((4, 24)), np.zeros(3)
    for clip, weight in weights.items():
        last = keys.key_count[clip] - 1
        place = (
            course * keys.apex[clip]
            if course <= 1
            else keys.apex[clip] + (course - 1) * (last - keys.apex[clip])
        )
        for key, own in spline_shares(place, last).items():
            row = keys.first_key[clip] + key
            rotation += weight * own * keys.rotation[row].astype(float).reshape(4, 24)
            pelvis += weight * own * keys.pelvis[row]
    rotation = rotation.T[: len(keys.joint)]
    return rotation / np.linalg.norm(rotation, axis=1, keepdims=True), pelvis


def mix(first, second, share):
    """Mix rotations (J, 4) the short way, with shares (J, 1) of the second."""
    sign = np.where((first * second).sum(axis=1, keepdims=True) < 0, -1.0, 1.0)
    mixed = (1 - share) * first + share * sign * second
    return mixed / np.linalg.norm(mixed, axis=1, keepdims=True)


def place_hand(keys, arm, scale, pelvis, rotation):
    """Hand of a pose: position and rotation, root frame."""
    place, turned = np.asarray(pelvis, float), rotation[keys.chain[arm, 0]]
    for k in range(1, 9):
        place = place + rotate(turned, scale[keys.chain_segment[arm, k]] * keys.chain_offset[arm, k])
        turned = multiply(turned, rotation[keys.chain[arm, k]])
    return place, turned


def reach(keys, weights, arm, course, lead, goal, scale, live, live_pelvis):
    """Pose, pelvis at leg scale 1 and hand target of one standing person who reaches with one hand."""
    side = course if course <= 1 else 2 - course
    share = minimum_jerk(side / lead)
    example, example_pelvis = blend(keys, weights, course)
    pose = mix(live, example, np.full((len(live), 1), share))
    pelvis = (1 - share) * live_pelvis + share * example_pelvis
    leg = scale[keys.leg_segment]
    here, _ = place_hand(keys, arm, scale, leg * pelvis, pose)
    apex, apex_pelvis = blend(keys, weights, 1.0)
    there, _ = place_hand(keys, arm, scale, leg * apex_pelvis, apex)
    target = goal if course == 1 else here + minimum_jerk(side) * (goal - there)
    return pose, pelvis, target


def status(stage, before, is_there, is_turned, hold_left):
    """Status and stage after a step, by name: 0 none, 1 move, 2 hold, 3 return; 2 met, 3 not, 4 refused."""
    after = {1: 1, 2: 2 if is_there and is_turned else 3}.get(stage, before)
    if stage in (1, 2) and before == 4:
        after = 4
    return after, 3 if stage == 2 and hold_left < 0 else stage


def shortened(size, longest):
    """Length of a way after `shortened`: its slope falls from 1 to 0 from the longest to twice as far."""
    if size <= longest:
        return size
    beyond = np.linspace(0.0, min(size / longest - 1.0, 1.0), 4001)
    risen = np.trapezoid(1.0 - minimum_jerk(beyond), beyond)
    return longest * (1.0 + risen - 0.65 * minimum_jerk(beyond[-1]))


def time_of_weights(wanted, weight, limits):
    """Time in which weights follow wanted ones: longer by the root of how far more than usual they differ."""
    change = 0.5 * np.abs(np.subtract(wanted, weight)).sum()
    return limits.example_time * np.sqrt(max(change / limits.weight_change, 1.0))


def turn_to_examples(keys, weights, course, live, arm, upper, walking, other):
    """Largest turn of joints from rotations (J, 4) to examples at a course, as far as these count, rad."""
    rotation, _ = blend(keys, weights, course)
    cosine = np.abs((rotation * live).sum(axis=1))
    group = keys.group.reshape(4, 24)[:, : len(cosine)]
    arms = [1.0, (1.0 - walking) * (1.0 - other)]
    trunk = 1.0 / (1.0 + other)
    share = np.array([(1.0 - upper) * trunk, trunk, arms[arm], arms[1 - arm]]) @ group
    return (share * 2.0 * np.arccos(np.minimum(cosine, 1.0))).max()
