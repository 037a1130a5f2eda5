"""The flesh of a body: distances to trunk, head, arms, hands and legs around the skeleton."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from crowd.body.distances import Points, Values, ellipsoid, join, joined, loft, round_cone, rounded_box
from crowd.body.stance import Stance

FloatArray = npt.NDArray[np.float64]

# Height, half width, half depth and middle of the trunk of a man of 1.75 m, m.
TRUNK = np.array(
    [
        (0.845, 0.135, 0.098, -0.010), (0.905, 0.166, 0.116, -0.012), (0.960, 0.168, 0.119, -0.012),
        (1.020, 0.158, 0.109, -0.004), (1.090, 0.147, 0.101, 0.002), (1.160, 0.148, 0.104, 0.003),
        (1.240, 0.157, 0.113, -0.002), (1.320, 0.166, 0.119, -0.008), (1.385, 0.163, 0.109, -0.018),
        (1.435, 0.128, 0.086, -0.026), (1.470, 0.085, 0.068, -0.024), (1.505, 0.061, 0.059, -0.014),
        (1.560, 0.056, 0.057, -0.002), (1.600, 0.054, 0.056, 0.008),
    ]
)  # fmt: skip
HIP_HEIGHT, WAIST_HEIGHT, CHEST_HEIGHT = 0.94, 1.09, 1.31


@dataclass(frozen=True)
class Figure:
    """How a body differs from that of an average man; all are factors of 1 but for lengths in m.

    Attributes
    ----------
    hip, waist, chest : float
        Widths and depths of the trunk.
    belly, bust : float
        How far they stand out, m.
    shoulder, arm, hand, leg, neck, head, jaw : float
        Thickness of the parts.
    """

    hip: float = 1.0
    waist: float = 1.0
    chest: float = 1.0
    belly: float = 0.0
    bust: float = 0.0
    shoulder: float = 1.0
    arm: float = 1.0
    hand: float = 1.0
    leg: float = 1.0
    neck: float = 1.0
    head: float = 1.0
    jaw: float = 1.0

    @cached_property
    def trunk_rings(self) -> FloatArray:
        """Rings of the trunk."""
        heights = (0.80, HIP_HEIGHT, WAIST_HEIGHT, CHEST_HEIGHT, 1.44, 1.52, 1.60)
        factors = (
            self.hip,
            self.hip,
            self.waist,
            self.chest,
            0.5 * (self.chest + self.neck),
            self.neck,
            self.neck,
        )
        rings = TRUNK.copy()
        rings[:, 1:3] *= np.interp(rings[:, 0], heights, factors)[:, None]
        return rings


class Flesh:
    """Distances to a figure in the stance it is sculpted in; `points` are always there.

    Parameters
    ----------
    figure : Figure
    stance : Stance
    """

    def __init__(self, figure: Figure, stance: Stance) -> None:
        self.figure = figure
        self.stance = stance

    def trunk(self, points: Points) -> Values:
        """From the crotch to the neck."""
        figure, p = self.figure, mirrored(points)
        value = loft(p, figure.trunk_rings, 2.3)
        value = join(
            value, ellipsoid(p, (0.078, 0.915, -0.062), (0.078 * figure.hip, 0.085, 0.064 * figure.hip)), 0.05
        )
        value = join(value, round_cone(p, (0.045, 1.462, -0.028), (0.150, 1.424, -0.026), 0.042, 0.042), 0.05)
        if figure.bust > 0.0:
            size = 0.045 + 0.5 * figure.bust
            value = join(
                value,
                ellipsoid(p, (0.072, 1.275, 0.062 + figure.bust), (size + 0.012, size + 0.008, size)),
                0.05,
            )
        if figure.belly > 0.0:
            value = join(
                value, ellipsoid(p, (0, 1.06, figure.belly), (0.13 * figure.waist, 0.12, 0.105)), 0.09
            )
        return value

    def head(self, points: Points) -> Values:
        """Skull, face and neck."""
        figure = self.figure
        p = mirrored(points)
        neck = round_cone(p, (0, 1.42, -0.030), (0, 1.57, 0.0), 0.061 * figure.neck, 0.054 * figure.neck)
        middle = np.array([0.0, 1.585, 0.0], np.float32)
        p = (p - middle) / np.float32(figure.head) + middle
        jaw = figure.jaw
        value = joined(
            [
                (ellipsoid(p, (0, 1.668, -0.004), (0.0745, 0.084, 0.098)), 0),
                (ellipsoid(p, (0, 1.612, 0.036), (0.060 * jaw, 0.086, 0.063)), 0.04),
                (ellipsoid(p, (0, 1.551, 0.064), (0.031 * jaw, 0.026, 0.031)), 0.035),
                (ellipsoid(p, (0.047 * jaw, 1.570, 0.022), (0.018, 0.034, 0.036)), 0.03),
                (ellipsoid(p, (0.038, 1.606, 0.070), (0.024, 0.024, 0.022)), 0.03),
                (round_cone(p, (0, 1.657, 0.090), (0.042, 1.654, 0.074), 0.013, 0.011), 0.02),
            ]
        )
        # Sockets, and eyeballs in them.
        socket = ellipsoid(p, (0.032, 1.637, 0.106), (0.020, 0.013, 0.017))
        value = -join(-value, socket, 0.014)
        value = joined(
            [
                (value, 0),
                (ellipsoid(p, (0.0315, 1.6375, 0.0845), (0.0125, 0.0115, 0.0125)), 0.004),
                (round_cone(p, (0, 1.646, 0.098), (0, 1.606, 0.117), 0.0070, 0.0115), 0.012),
                (ellipsoid(p, (0.011, 1.602, 0.106), (0.008, 0.008, 0.010)), 0.008),
                (ellipsoid(p, (0, 1.576, 0.094), (0.023, 0.0065, 0.011)), 0.006),
                (ellipsoid(p, (0, 1.566, 0.093), (0.019, 0.0065, 0.010)), 0.005),
            ]
        )
        ear = ellipsoid(
            turned_about(p, (0.074, 1.632, -0.006), -0.35), (0.074, 1.632, -0.006), (0.0095, 0.031, 0.018)
        )
        value = join(value, ear, 0.006) * np.float32(figure.head)
        return join(value, neck, 0.025)

    def arm(self, points: Points) -> Values:
        """Shoulder to wrist."""
        p, f, s = self.stance.arm_at_rest(mirrored(points)), self.figure.arm, self.figure.shoulder
        x, z = 0.1855, -0.0245
        return joined(
            [
                (ellipsoid(p, (x - 0.010, 1.392, z), (0.050 * s, 0.070, 0.053 * s)), 0),
                (round_cone(p, (x - 0.006, 1.385, z), (x, 1.11, z), 0.046 * f, 0.038 * f), 0.04),
                (ellipsoid(p, (x, 1.265, z + 0.010), (0.042 * f, 0.085, 0.045 * f)), 0.03),
                (round_cone(p, (x, 1.106, z), (x, 0.86, z), 0.039 * f, 0.026 * (0.5 + 0.5 * f)), 0.03),
                (ellipsoid(p, (x, 1.045, z + 0.004), (0.041 * f, 0.080, 0.043 * f)), 0.03),
            ]
        )

    def hand(self, points: Points) -> Values:
        """Wrist, palm and fingers."""
        stance, f = self.stance, self.figure.hand
        ends = mirrored(points)
        p = stance.arm_at_rest(ends)
        x, z = 0.1855, -0.0245
        value = joined(
            [
                (round_cone(p, (x, 0.89, z), (x, 0.835, z), 0.0255 * f, 0.026 * f, (0.82, 1, 1.05)), 0),
                (rounded_box(p, (x, 0.815, z - 0.001), (0.0135 * f, 0.042, 0.040 * f), 0.013), 0.022),
                (ellipsoid(p, (x - 0.006, 0.825, z + 0.024), (0.015, 0.032, 0.016)), 0.012),
            ]
        )
        for finger, sizes in FINGER_RADIUS.items():
            at = stance.finger_at_rest(ends, finger)
            bones = stance.finger_bones(finger)
            value_finger = joined(
                [
                    (round_cone(at, a, b, r0 * f, r1 * f), 0.003)
                    for a, b, r0, r1 in zip(bones[:-1], bones[1:], sizes[:-1], sizes[1:], strict=True)
                ]
            )
            value = join(value, value_finger, 0.008)
        return value

    def leg(self, points: Points) -> Values:
        """Hip to ankle."""
        p, f = self.stance.leg_at_rest(mirrored(points)), self.figure.leg
        x = 0.0875
        return joined(
            [
                (round_cone(p, (x + 0.004, 0.90, -0.008), (x, 0.50, 0.0), 0.081 * f, 0.053 * f), 0),
                (ellipsoid(p, (x + 0.002, 0.72, 0.014), (0.066 * f, 0.17, 0.068 * f)), 0.05),
                (ellipsoid(p, (x, 0.495, 0.012), (0.046 * f, 0.055, 0.046 * f)), 0.03),
                (round_cone(p, (x, 0.49, -0.004), (x, 0.075, -0.012), 0.049 * f, 0.033 * f), 0.03),
                (ellipsoid(p, (x + 0.001, 0.36, -0.030), (0.044 * f, 0.115, 0.042 * f)), 0.04),
            ]
        )


FINGER_RADIUS = {
    "thumb": (0.0125, 0.0110, 0.0098, 0.0075),
    "index": (0.0095, 0.0088, 0.0080, 0.0066),
    "middle": (0.0097, 0.0090, 0.0081, 0.0067),
    "ring": (0.0094, 0.0087, 0.0078, 0.0064),
    "little": (0.0086, 0.0077, 0.0069, 0.0058),
}


def mirrored(points: Points) -> Points:
    """Points of both sides put on the left one."""
    return np.column_stack([np.abs(points[:, 0]), points[:, 1:]])


def turned_about(points: Points, centre: tuple[float, float, float], angle: float) -> Points:
    """Points turned about an axis along x through a centre, rad."""
    away = points - np.asarray(centre, np.float32)
    c, s = np.float32(np.cos(angle)), np.float32(np.sin(angle))
    turned = np.stack([away[:, 0], c * away[:, 1] - s * away[:, 2], s * away[:, 1] + c * away[:, 2]], axis=1)
    value: Points = turned + np.asarray(centre, np.float32)
    return value
