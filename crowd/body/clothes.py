"""What a person wears and shows: skin, hair, clothes and shoes as separate pieces around the flesh."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

import numpy as np

from crowd.body.distances import (
    Field,
    Points,
    Triple,
    Values,
    cut,
    ellipsoid,
    join,
    joined,
    loft,
    round_cone,
    rounded_box,
)
from crowd.body.figure import Flesh, mirrored
from crowd.body.weights import LEGS_APART


class Material(IntEnum):
    """What a piece is made of; colours are drawn for each person and material."""

    SKIN = 0
    TOP = 1
    BOTTOM = 2
    HAIR = 3
    SHOE = 4
    EXTRA = 5


@dataclass(frozen=True)
class Piece:
    """One closed surface of one material.

    Attributes
    ----------
    material : Material
    distance : callable
        Signed distance of points in the stance.
    low, high : sequence of float
        Box around it, m.
    step : float
        Distance between samples, m.
    share : float
        Of the vertices of a body.
    is_paired : bool
        The box holds the left one of two.
    legs_apart : float
        See `skin_weights`.
    has_limbs : bool
        Arms and legs move it too.
    """

    material: Material
    distance: Field
    low: Triple
    high: Triple
    step: float
    share: float
    is_paired: bool = False
    legs_apart: float = LEGS_APART
    has_limbs: bool = True


@dataclass(frozen=True)
class Outfit:
    """Hair, clothes and shoes.

    Attributes
    ----------
    hair : str
        ``"bald"``, ``"short"``, ``"crop"``, ``"bob"``, ``"long"``, ``"ponytail"``, ``"bun"``, ``"curls"``.
    hat : str
        ``""``, ``"cap"``, ``"beanie"``, ``"scarf"``.
    sleeve : float
        Height to which sleeves reach on an arm that hangs down, m.
    slack : float
        Between the body and the top, m.
    drape : float
        0 for a top that follows the waist, 1 for one that hangs straight.
    hem : float
        Height of the lower edge of the top, m; below 0.85 it hangs around both legs.
    flare : float
        How much wider the hem is than the hips, m.
    collar : bool
    bottom : str
        ``"trousers"``, ``"skirt"`` or ``""`` for none below a long top.
    bottom_hem : float
        Height of the lower edge of the bottom, m.
    cuff : float
        Half width of a trouser leg at the ankle, m.
    bag : str
        ``""``, ``"backpack"`` or ``"shoulder"``.
    """

    hair: str = "short"
    hat: str = ""
    sleeve: float = 1.19
    slack: float = 0.010
    drape: float = 0.6
    hem: float = 0.93
    flare: float = 0.006
    collar: bool = False
    bottom: str = "trousers"
    bottom_hem: float = 0.045
    cuff: float = 0.060
    bag: str = ""
    shoe: float = 0.110
    waist: float = field(default=1.02)

    @property
    def hangs(self) -> bool:
        """The top goes down around both legs."""
        return self.hem < 0.85


def pieces(flesh: Flesh, outfit: Outfit) -> Iterator[Piece]:
    """Everything that is seen of a person."""

    def piece(
        material: Material,
        make: Callable[[Flesh, Outfit, Points], Values],
        low: Triple,
        high: Triple,
        step: float,
        share: float,
        **more: Any,
    ) -> Piece:
        return Piece(material, lambda points: make(flesh, outfit, points), low, high, step, share, **more)

    around_legs = 0.10
    yield piece(Material.SKIN, head, (-0.12, 1.36, -0.15), (0.12, 1.79, 0.16), 0.0045, 0.19)
    if outfit.hat != "scarf" and outfit.hair != "bald":
        low = 1.30 if outfit.hair in ("long", "ponytail") else 1.44
        yield piece(
            Material.HAIR, hair, (-0.17, low, -0.24), (0.17, 1.86, 0.17), 0.006, 0.11, has_limbs=False
        )
    if outfit.hat:
        yield piece(
            Material.EXTRA, hat, (-0.17, 1.36, -0.19), (0.17, 1.86, 0.27), 0.006, 0.09, has_limbs=False
        )
    sleeve_end = flesh.stance.arm_point(outfit.sleeve + 0.05)
    yield piece(
        Material.SKIN, hands, (sleeve_end[0] - 0.07, 0.70, -0.12), (0.60, sleeve_end[1] + 0.03, 0.09), 0.0042,
        0.26, is_paired=True,
    )  # fmt: skip
    wide = max(0.42 if outfit.hangs else 0.32, flesh.stance.arm_point(outfit.sleeve)[0] + 0.10)
    yield piece(
        Material.TOP, top, (-wide, outfit.hem - 0.03, -0.30), (wide, 1.57, 0.33), 0.008, 0.24,
        legs_apart=around_legs if outfit.hangs else LEGS_APART,
    )  # fmt: skip
    low = outfit.bottom_hem - 0.03
    if outfit.bottom == "trousers":
        yield piece(Material.BOTTOM, trousers, (-0.34, low, -0.22), (0.34, 1.10, 0.22), 0.009, 0.16)
    elif outfit.bottom == "skirt":
        yield piece(
            Material.BOTTOM,
            skirt,
            (-0.36, low, -0.34),
            (0.36, 1.10, 0.34),
            0.010,
            0.10,
            legs_apart=around_legs,
        )
    if outfit.bottom != "trousers" or outfit.bottom_hem > 0.15:
        yield piece(
            Material.SKIN, bare_legs, (0.0, 0.03, -0.16), (0.30, 0.86, 0.16), 0.008, 0.07, is_paired=True
        )
    yield piece(Material.SHOE, shoes, (0.03, -0.02, -0.12), (0.28, 0.22, 0.23), 0.005, 0.09, is_paired=True)
    if outfit.bag:
        yield piece(
            Material.EXTRA, bag, (-0.34, 0.74, -0.38), (0.34, 1.54, 0.22), 0.006, 0.09, has_limbs=False
        )


def head(flesh: Flesh, outfit: Outfit, points: Points) -> Values:
    """Head and neck, down into the collar."""
    return cut(flesh.head(points), 1.40 - points[:, 1], 0.02)


def hands(flesh: Flesh, outfit: Outfit, points: Points) -> Values:
    """Hands, and arms up into the sleeves."""
    below = flesh.stance.arm_at_rest(mirrored(points))[:, 1] - min(outfit.sleeve + 0.035, 1.36)
    return cut(join(flesh.hand(points), flesh.arm(points), 0.015), below, 0.01)


def top(flesh: Flesh, outfit: Outfit, points: Points) -> Values:
    """Shirt, jacket, coat or dress, with sleeves and collar."""
    figure, slack = flesh.figure, outfit.slack
    rings = draped(figure.trunk_rings, outfit)
    p = mirrored(points)
    trunk = join(loft(p, rings, 2.3), flesh.trunk(points), 0.05) - slack
    arms = flesh.arm(points) - 0.7 * slack
    down = flesh.stance.arm_at_rest(p)
    tube = round_cone(
        down, (0.1845, 1.33, -0.0245), (0.1855, 0.87, -0.0245),
        0.046 * figure.arm + 0.9 * slack, 0.031 * figure.arm + 1.1 * slack,
    )  # fmt: skip
    sleeve = cut(join(arms, tube, 0.03), outfit.sleeve - down[:, 1], 0.006)
    value = join(trunk, sleeve, 0.03)
    value = cut(value, outfit.hem - points[:, 1], 0.008)
    neck = neck_line(points)
    hole = np.maximum(-neck, np.abs(points[:, 0]) - 0.10)
    value = cut(value, -hole.astype(np.float32), 0.006)
    if outfit.collar:
        around = round_cone(p, (0, 1.42, -0.032), (0, 1.57, -0.002), 0.075 * figure.neck, 0.066 * figure.neck)
        band = np.maximum(np.abs(neck - 0.010) - 0.019, np.abs(around) - 0.008)
        opening = 0.016 - p[:, 0] + 0.35 * np.maximum(neck, 0.0)
        band = np.maximum(band, np.where(points[:, 2] > 0.0, opening, -1.0))
        value = join(value, band.astype(np.float32) - 0.003, 0.008)
    return value


def neck_line(points: Points) -> Values:
    """Height above the plane through the rim of the neck opening."""
    value: Values = points[:, 1] - (1.487 - 0.48 * points[:, 2])
    return value * np.float32(0.9)


def draped(rings: np.ndarray, outfit: Outfit) -> np.ndarray:
    """Rings of a trunk in a top that hangs from the chest."""
    chest = rings[np.abs(rings[:, 0] - 1.32).argmin()]
    hips = rings[np.abs(rings[:, 0] - 0.94).argmin()]
    inner = rings[(rings[:, 0] > outfit.hem) | (rings[:, 0] > 0.9)].copy()
    share = np.clip((chest[0] - inner[:, 0]) / (chest[0] - hips[0]), 0.0, 1.0)
    for column in (1, 2, 3):
        straight = chest[column] + share * (hips[column] - chest[column])
        hanging = (1 - outfit.drape) * inner[:, column] + outfit.drape * np.maximum(
            inner[:, column], straight
        )
        if column == 3:
            hanging = inner[:, column]
        inner[:, column] = np.where(
            (inner[:, 0] < chest[0]) & (inner[:, 0] > hips[0]), hanging, inner[:, column]
        )
    below = share >= 1.0
    inner[below, 1:3] = np.maximum(inner[below, 1:3], hips[1:3])
    inner[:, 1:3] += (outfit.flare * share)[:, None]
    lowest = min(outfit.hem - 0.02, inner[0, 0] - 0.02)
    length = inner[0, 0] - lowest
    ends = [
        lowest,
        inner[0, 1] + outfit.flare * length * 3.0,
        inner[0, 2] + outfit.flare * length * 3.0,
        inner[0, 3],
    ]
    return np.vstack([ends, inner])


def trousers(flesh: Flesh, outfit: Outfit, points: Points) -> Values:
    """Trousers or shorts."""
    figure = flesh.figure
    p = mirrored(points)
    down = flesh.stance.leg_at_rest(p)
    hips = flesh.trunk(points) - 0.005
    x = 0.0875
    knee = outfit.cuff * 0.55 + 0.030 * figure.leg
    leg = joined(
        [
            (flesh.leg(points) - 0.004, 0),
            (round_cone(down, (x + 0.003, 0.86, -0.008), (x, 0.50, 0.0), 0.082 * figure.leg, knee), 0.03),
            (round_cone(down, (x, 0.52, 0.0), (x, 0.04, -0.010), knee, outfit.cuff), 0.03),
        ]
    )
    leg = cut(leg, outfit.bottom_hem - down[:, 1], 0.006)
    value = join(hips, leg, 0.04)
    return cut(value, points[:, 1] - outfit.waist, 0.01)


def skirt(flesh: Flesh, outfit: Outfit, points: Points) -> Values:
    """A skirt from the waist on."""
    hip, waist = flesh.figure.hip, flesh.figure.waist
    length = 0.92 - outfit.bottom_hem
    rings = np.array(
        [
            (outfit.bottom_hem - 0.02, 0.190 * hip + 0.10 * length, 0.142 * hip + 0.11 * length, -0.005),
            (0.80, 0.188 * hip, 0.140 * hip, -0.010),
            (0.92, 0.180 * hip, 0.134 * hip, -0.012),
            (1.03, 0.162 * waist, 0.116 * waist, -0.003),
            (1.10, 0.152 * waist, 0.106 * waist, 0.002),
        ]
    )
    value = join(loft(mirrored(points), rings), flesh.trunk(points) - 0.006, 0.03)
    value = cut(value, outfit.bottom_hem - points[:, 1], 0.008)
    return cut(value, points[:, 1] - outfit.waist, 0.01)


def bare_legs(flesh: Flesh, outfit: Outfit, points: Points) -> Values:
    """Legs up into whatever is above them."""
    hem = outfit.bottom_hem if outfit.bottom else outfit.hem
    down = flesh.stance.leg_at_rest(mirrored(points))
    return cut(flesh.leg(points), down[:, 1] - min(hem + 0.16, 0.80), 0.01)


def shoes(flesh: Flesh, outfit: Outfit, points: Points) -> Values:
    """Shoes with flat soles."""
    p = flesh.stance.foot_at_rest(mirrored(points))
    x = 0.0875
    value = joined(
        [
            (round_cone(p, (x, 0.043, -0.036), (x + 0.003, 0.036, 0.095), 0.040, 0.043, (0.94, 1, 1)), 0),
            (round_cone(p, (x + 0.003, 0.026, 0.095), (x, 0.020, 0.160), 0.042, 0.033, (1, 0.85, 1)), 0.03),
            (round_cone(p, (x, 0.055, -0.016), (x, outfit.shoe + 0.02, -0.012), 0.046, 0.041), 0.03),
            (rounded_box(p, (x + 0.001, 0.012, 0.045), (0.040, 0.014, 0.095), 0.013), 0.02),
        ]
    )
    value = cut(value, p[:, 1] - outfit.shoe, 0.012)
    return cut(value, -p[:, 1], 0.004)


def hair(flesh: Flesh, outfit: Outfit, points: Points) -> Values:
    """Hair of a style."""
    kind = outfit.hair
    size = np.float32(flesh.figure.head)
    middle = np.array([0.0, 1.585, 0.0], np.float32)
    q = (points - middle) / size + middle
    p = mirrored(q)
    thick = {"crop": 0.006, "short": 0.012, "curls": 0.034}.get(kind, 0.015)
    skull = joined(
        [
            (ellipsoid(p, (0, 1.668, -0.006), (0.0745 + thick, 0.084 + thick, 0.098 + thick)), 0),
            (ellipsoid(p, (0, 1.61, -0.045), (0.058 + 0.7 * thick, 0.075, 0.050 + 0.7 * thick)), 0.03),
        ]
    )
    # Above a line from the brow over the ear to the nape.
    front, rise = (1.708, 0.95) if kind != "curls" else (1.700, 0.9)
    line = (front - rise * (0.085 - p[:, 2])) - p[:, 1]
    line = np.where(p[:, 2] > 0.045, line + 0.9 * np.maximum(p[:, 0] - 0.045, 0.0), line)
    value = cut(skull, (0.72 * line).astype(np.float32), 0.018)
    if kind in ("short", "crop"):
        lift = ellipsoid(p, (0, 1.722, 0.058), (0.052, 0.026 + 0.6 * thick, 0.040))
        value = join(value, lift, 0.03)
    if kind == "curls":
        bumps = 0.006 * np.sin(90 * q[:, 0]) * np.sin(85 * q[:, 1]) * np.sin(95 * q[:, 2])
        value = value - bumps.astype(np.float32)
    if kind in ("bob", "long"):
        end = 1.525 if kind == "bob" else 1.36
        curtain = joined(
            [
                (round_cone(p, (0.066, 1.66, 0.002), (0.076, end, -0.006), 0.030, 0.024, (0.75, 1, 1.5)), 0),
                (
                    round_cone(
                        p,
                        (0, 1.66, -0.045),
                        (0, end, -0.062 - 0.10 * (1.55 - end)),
                        0.078,
                        0.066,
                        (1.15, 1, 0.62),
                    ),
                    0.04,
                ),
            ]
        )
        value = join(value, cut(curtain, (end - p[:, 1]).astype(np.float32), 0.02), 0.03)
    if kind == "ponytail":
        value = joined(
            [
                (value, 0),
                (round_cone(p, (0, 1.70, -0.10), (0, 1.66, -0.145), 0.022, 0.026), 0.02),
                (round_cone(p, (0, 1.66, -0.145), (0, 1.50, -0.135), 0.028, 0.020), 0.02),
                (round_cone(p, (0, 1.50, -0.135), (0, 1.41, -0.118), 0.020, 0.008), 0.02),
            ]
        )
    if kind == "bun":
        value = join(value, ellipsoid(p, (0, 1.715, -0.105), (0.045, 0.042, 0.042)), 0.015)
    return value * size


def hat(flesh: Flesh, outfit: Outfit, points: Points) -> Values:
    """Cap, woollen hat or headscarf."""
    size = np.float32(flesh.figure.head)
    middle = np.array([0.0, 1.585, 0.0], np.float32)
    p = (mirrored(points) - middle) / size + middle
    if outfit.hat == "scarf":
        around = joined(
            [
                (ellipsoid(p, (0, 1.668, -0.008), (0.090, 0.100, 0.112)), 0),
                (ellipsoid(p, (0, 1.60, -0.020), (0.088, 0.100, 0.080)), 0.04),
                (round_cone(p, (0, 1.56, -0.004), (0, 1.46, -0.018), 0.080, 0.105, (1, 1, 0.95)), 0.05),
            ]
        )
        face = ellipsoid(p, (0, 1.622, 0.098), (0.060, 0.084, 0.080))
        return cut(cut(around, -face, 0.012), 1.43 - p[:, 1], 0.01) * size
    dome = ellipsoid(p, (0, 1.675, -0.006), (0.094, 0.098, 0.117))
    edge = 1.668 + 0.18 * (p[:, 2] + 0.02)
    value = cut(dome, (edge - p[:, 1]).astype(np.float32), 0.012)
    if outfit.hat == "cap":
        brim = round_cone(p, (0, 1.690, 0.085), (0, 1.682, 0.150), 0.070, 0.055, (1, 0.09, 1))
        value = join(value, brim, 0.010)
    return value * size


def bag(flesh: Flesh, outfit: Outfit, points: Points) -> Values:
    """Backpack with straps, or a bag at the hip on a strap across the chest."""
    figure = flesh.figure
    slack = outfit.slack + 0.006
    trunk = (
        np.minimum(flesh.trunk(points), loft(mirrored(points), draped(figure.trunk_rings, outfit), 2.3))
        - slack
    )
    if outfit.bag == "backpack":
        back = float(figure.trunk_rings[7, 2]) + 0.008 + slack
        body = rounded_box(points, (0, 1.235, -back - 0.075), (0.135, 0.205, 0.075), 0.055)
        body = join(body, rounded_box(points, (0, 1.15, -back - 0.140), (0.105, 0.10, 0.030), 0.028), 0.015)
        # Over the shoulders, in front outwards to below the arms.
        middle = 0.085 + np.where(points[:, 2] > -0.02, 0.40 * np.maximum(1.36 - points[:, 1], 0.0), 0.0)
        strap = np.maximum(np.abs(np.abs(points[:, 0]) - middle) - 0.022, np.abs(trunk) - 0.011)
        strap = np.maximum(strap, np.maximum(1.17 - points[:, 1], points[:, 1] - 1.505))
        return join(body, strap.astype(np.float32), 0.01)
    body = rounded_box(points, (0.235, 0.875, -0.02), (0.045, 0.105, 0.135), 0.035)
    across = np.abs(0.80 * points[:, 0] + 0.60 * (points[:, 1] - 1.20)) - 0.018
    strap = np.maximum(np.maximum(across, np.abs(trunk) - 0.011), 0.93 - points[:, 1])
    strap = np.maximum(strap, np.abs(points[:, 0]) - 0.21)
    return join(body, strap.astype(np.float32), 0.01)
