"""Slow twin of `crowd_kernels.ik`: one character, explicit Jacobians, rotations as SciPy's, float64."""

import numpy as np
from scipy.spatial.transform import Rotation


def rotation(q):
    """SciPy rotation of a quaternion (w, x, y, z)."""
    return Rotation.from_quat([q[1], q[2], q[3], q[0]])


def quaternion(r):
    """Quaternion (w, x, y, z) of a SciPy rotation."""
    return r.as_quat()[[3, 0, 1, 2]]


def kinematics(parent, offset, local, root=(0.0, 0.0, 0.0)):
    """Places (K, 3) and rotations of joints."""
    places, frames = [], []
    for above, ahead, q in zip(parent, np.asarray(offset, float), local, strict=True):
        outer = frames[above] if above >= 0 else Rotation.identity()
        base = places[above] if above >= 0 else np.asarray(root, float)
        places.append(base + outer.apply(ahead))
        frames.append(outer * rotation(q))
    return np.array(places), frames


def clipped(vector, longest):
    """Vector shortened to a length."""
    return vector * min(1.0, longest / max(np.linalg.norm(vector), 1e-12))


def split(limits, k, q):
    """Swing (x, y) and twist angle of a joint in the frames of its limit."""
    frame = [rotation(limits.parent_frame[k]), rotation(limits.joint_frame[k])]
    w, x, y, z = quaternion(frame[0].inv() * rotation(q) * frame[1])
    twist = Rotation.from_quat([0, 0, z, w])
    swing = Rotation.from_quat([x, y, z, w]) * twist.inv()
    half = quaternion(swing)
    half *= np.sign(half[0]) or 1.0
    return half[1:3], 2 * np.arctan(z / w)


def join(limits, k, swing, twist):
    """Local rotation of swing and twist, the inverse of `split`."""
    frame = [rotation(limits.parent_frame[k]), rotation(limits.joint_frame[k])]
    x, y = swing
    half = Rotation.from_quat([x, y, 0, np.sqrt(max(0, 1 - x * x - y * y))])
    return frame[0] * half * Rotation.from_rotvec([0, 0, twist]) * frame[1].inv()


def violation(tree, local):
    """How far a pose leaves limits: share of the swing ellipse beyond it, or rad of twist."""
    worst = 0.0
    for k in range(len(tree.joint)):
        if tree.is_limited[k] and tree.weight[k] > 0:
            swing, twist = split(tree, k, local[k])
            low, high = 2 * np.arctan(np.asarray(tree.twist[k], float))
            worst = max(worst, np.linalg.norm(swing * tree.inverse_swing[k]) - 1)
            if tree.is_free[k, 2]:
                worst = max(worst, twist - high, low - twist)
    return worst


def normals(limits, k, local, outer):
    """Numerical gradients of swing value, swing x, swing y and twist with respect to root-frame rotations."""

    def values(q):
        swing, twist = split(limits, k, q)
        return np.array([np.sum((swing * limits.inverse_swing[k]) ** 2), *swing, twist])

    result = np.zeros((4, 3))
    for axis in range(3):
        small = np.zeros(3)
        small[axis] = 1e-6
        there = quaternion(outer.inv() * Rotation.from_rotvec(small) * outer * rotation(local))
        back = quaternion(outer.inv() * Rotation.from_rotvec(-small) * outer * rotation(local))
        result[:, axis] = (values(there) - values(back)) / 2e-6
    return result


class Motion:
    """What one joint can do in one iteration: a drift, and directions that follow torques."""

    def __init__(self, weight, drift):
        self.weight = weight
        self.mobility = weight * np.eye(3)
        self.drift = drift

    def fix(self, normal, motion):
        """Take out a direction along which the rotation vector is given."""
        along = self.mobility @ normal
        pivot = normal @ along
        if pivot <= 0.1 * self.weight * (normal @ normal) + 1e-12:
            return False
        self.drift = self.drift + along * (motion - normal @ self.drift) / pivot
        self.mobility = self.mobility - np.outer(along, along) / pivot
        return True


def iterate(tree, settings, local, reference, last, point, target, target_rotation, task):
    """One iteration of the solver; returns the new local rotations (K, 4)."""
    count, effectors = len(tree.joint), len(tree.effector)
    places, frames = kinematics(tree.parent, tree.offset, local)
    tips, miss, rows = [], np.zeros(6 * effectors), np.zeros(6 * effectors, bool)
    for e, carrier in enumerate(tree.effector):
        tips.append(places[carrier] + frames[carrier].apply(point[e]))
        rows[6 * e : 6 * e + 3] = task[e] & 1
        rows[6 * e + 3 : 6 * e + 6] = task[e] & 2
        length, k = np.linalg.norm(point[e]), carrier
        while k != tree.base[e]:
            length, k = length + np.linalg.norm(tree.offset[k]), tree.parent[k]
        origin = places[tree.base[e]]
        goal = origin + clipped(target[e] - origin, settings.reach * length)
        miss[6 * e : 6 * e + 3] = clipped(goal - tips[e], settings.place_step)
        is_far = np.linalg.norm(goal - tips[e]) > settings.waiting_distance
        if task[e] & 1 and settings.place_first > 0 and is_far:
            rows[6 * e + 3 : 6 * e + 6] = False
        turn = (rotation(target_rotation[e]) * frames[carrier].inv()).as_rotvec()
        miss[6 * e + 3 : 6 * e + 6] = clipped(turn, settings.turn_step)
    miss[~rows] = 0
    jacobian = np.zeros((6 * effectors, 3 * count))
    motions, outers = [], []
    for k in range(count):
        outer = frames[tree.parent[k]] if tree.parent[k] >= 0 else Rotation.identity()
        outers.append(outer)
        way = quaternion(rotation(reference[k]) * rotation(local[k]).inv())
        way *= np.sign(way[0]) or 1.0
        pull = clipped(2 * settings.pull * way[1:], settings.pull_step)
        motion = Motion(float(tree.weight[k]), outer.apply(pull) if tree.weight[k] > 0 else np.zeros(3))
        if tree.is_limited[k] and tree.weight[k] > 0:
            gradient = normals(tree, k, local[k], outer)
            for axis, normal in enumerate(gradient[1:]):
                if tree.is_free[k, axis] == 0:
                    motion.fix(normal, 0.0)
        motions.append(motion)
        for e in range(effectors):
            if tree.moves[e, k]:
                x, y, z = tips[e] - places[k]
                jacobian[6 * e : 6 * e + 3, 3 * k : 3 * k + 3] = [[0, z, -y], [-z, 0, x], [y, -x, 0]]
                jacobian[6 * e + 3 : 6 * e + 6, 3 * k : 3 * k + 3] = np.eye(3)
    jacobian[~rows] = 0
    steps = np.linalg.norm(miss.reshape(effectors, 2, 3), axis=2).sum(axis=0)
    damping = settings.damping**2 + steps * (settings.error_damping, settings.turn_error_damping)
    damping = np.tile(np.repeat(damping, 3), effectors)
    for _ in range(settings.passes):
        weights = np.zeros((3 * count, 3 * count))
        for k, motion in enumerate(motions):
            weights[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = motion.mobility
        drift = np.concatenate([motion.drift for motion in motions])
        system = jacobian @ weights @ jacobian.T + np.diag(damping)
        step = drift + weights @ jacobian.T @ np.linalg.solve(system, miss - jacobian @ drift)
        found, excess = [], np.zeros((count, 2))
        for k in range(count):
            half = outers[k].inv().apply(step[3 * k : 3 * k + 3]) / 2
            after = Rotation.from_quat([*half, 1.0]) * rotation(local[k])
            if tree.is_limited[k] and tree.weight[k] > 0:
                after, excess[k] = inside(
                    tree, k, quaternion(after), reference[k], last[k], settings.approach
                )
            found.append(quaternion(after))
        is_done = True
        for k, limit in np.argwhere((excess > 0) & (excess >= 0.6 * excess.max())):
            way = quaternion(rotation(found[k]) * rotation(local[k]).inv())
            motion = outers[k].apply(2 * way[1:] / way[0])
            normal = normals(tree, k, found[k], outers[k])[3 * limit]
            is_done &= not motions[k].fix(normal, normal @ motion)
        if is_done:
            break
    return np.array(found)


def share_of_way(last, following, bound, approach):
    """How much of the way from one swing to the next a joint goes, in units of the ellipse's semi-axes.

    It goes at most a share of the way along its motion to the edge of the enlarged ellipse.
    """
    way = following - last
    square = way @ way
    middle = -(last @ way) / max(square, 1e-12)
    nearest = last + middle * way
    half = np.sqrt(max((1.1 * bound) ** 2 - nearest @ nearest, 0.0) / max(square, 1e-12))
    outside = np.linalg.norm(last) > 1.1 * bound
    leaving = middle + (abs(middle) if outside else half)
    return min(1.0, approach * leaving)


def inside(limits, k, local, reference, last, approach):
    """Projection of a joint into what limits leave to it, and how far swing and twist were beyond, rad."""
    swing, twist = split(limits, k, local)
    held_swing, held_twist = split(limits, k, reference)
    low, high = 2 * np.arctan(np.asarray(limits.twist[k], float))
    low, high = min(low, held_twist), max(high, held_twist)
    bound = max(1.0, np.linalg.norm(held_swing * limits.inverse_swing[k]))
    last_swing, last_twist = split(limits, k, last)
    share = share_of_way(
        last_swing * limits.inverse_swing[k], swing * limits.inverse_swing[k], bound, approach
    )
    value = np.linalg.norm(last_swing * limits.inverse_swing[k])
    bound = min(bound, value + approach * max(bound - value, 0))
    last = np.tan(last_twist / 2)
    ends = np.tan(np.array([low, high]) / 2)
    low = 2 * np.arctan(max(ends[0], last + approach * min(ends[0] - last, 0)))
    high = 2 * np.arctan(min(ends[1], last + approach * max(ends[1] - last, 0)))
    value = np.linalg.norm(swing * limits.inverse_swing[k])
    free_x, free_y, free_twist = limits.is_free[k]
    tangents = np.tan(np.array([low, twist, high]) / 2)
    beyond = max(tangents[1] - tangents[2], tangents[0] - tangents[1])
    twist_excess = 2 * beyond if free_twist > 0 and beyond > 2e-5 else 0.0
    swing_excess = 0.0
    if value**2 > bound**2 * (1 + 2e-5):
        swing_excess = 2 * np.linalg.norm(swing) * (1 - bound / value)
    swing = last_swing + share * (swing - last_swing)
    value = np.linalg.norm(swing * limits.inverse_swing[k])
    swing = swing * min(1.0, bound / max(value, 1e-12))
    swing = np.where([free_x > 0, free_y > 0], swing, held_swing)
    twist = np.clip(twist, low, high) if free_twist > 0 else held_twist
    return join(limits, k, swing, twist), (swing_excess, twist_excess)
