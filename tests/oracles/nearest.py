"""Slow search for the nearest point that a limited arm can come to: many poses, the best refined by SciPy."""

import numpy as np
from scipy.optimize import minimize

from crowd.motion.rotation import conjugate, multiply, rotate


class Search:
    """Poses of one tree of joints with limits.

    Parameters
    ----------
    tree : TreeArrays
        One effector.
    point : (3,) float
        In the frame of the effector's joint, m.
    rest : (K, 4) float
        Rotations of joints that do not turn.
    rng : numpy.random.Generator
    count : int
        Random poses.
    """

    def __init__(self, tree, point, rest, rng, count=10_000):
        self.tree, self.point, self.rest = tree, np.asarray(point, float), np.asarray(rest, float)
        self.turning = np.flatnonzero(tree.weight > 0)
        self.shares = rng.random((count, 3 * len(self.turning)))
        self.tips = self.tip(self.shares)

    def local(self, shares):
        """Rotations (N, K, 4) within limits; shares, 0 to 1: radius, direction, twist of each joint."""
        result = np.repeat(self.rest[None], len(shares), axis=0)
        for place, k in enumerate(self.turning):
            radius, direction, turn = shares[:, 3 * place : 3 * place + 3].T
            inverse = self.tree.inverse_swing[k].astype(float)
            ways = np.stack([np.cos(2 * np.pi * direction), np.sin(2 * np.pi * direction)])
            if (inverse == 0).any():
                ways = np.repeat(2 * direction[None] - 1, 2, axis=0)
            x, y = (
                np.sqrt(radius) * way / i if i > 0 else 0 * way for way, i in zip(ways, inverse, strict=True)
            )
            low, high = 2 * np.arctan(self.tree.twist[k].astype(float)) if self.tree.is_free[k, 2] else (0, 0)
            half = (low + (high - low) * turn) / 2
            swing = np.stack([np.sqrt(np.maximum(1 - x * x - y * y, 0)), x, y, 0 * x], axis=1)
            twist = np.stack([np.cos(half), 0 * half, 0 * half, np.sin(half)], axis=1)
            frames = self.tree.parent_frame[k].astype(float), self.tree.joint_frame[k].astype(float)
            result[:, k] = multiply(multiply(frames[0], multiply(swing, twist)), conjugate(frames[1]))
        return result

    def tip(self, shares):
        """Places (N, 3) of the point."""
        local, k = self.local(shares), self.tree.effector[0]
        place = np.repeat(self.point[None], len(shares), axis=0)
        while k >= 0:
            place = rotate(local[:, k], place) + self.tree.offset[k]
            k = self.tree.parent[k]
        return place

    def nearest(self, target, starts=2):
        """Least distance to a target, m."""
        away = np.linalg.norm(self.tips - target, axis=1)

        def distance(shares):
            return float(np.linalg.norm(self.tip(np.clip(shares, 0, 1)[None])[0] - target))

        bounds = [(0.0, 1.0)] * self.shares.shape[1]
        found = [
            minimize(distance, self.shares[start], method="L-BFGS-B", bounds=bounds).fun
            for start in np.argsort(away)[:starts]
        ]
        return min(found)
