"""What each person looks like: skin, hair and clothes, drawn once from the person's stable number."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from crowd.body.builds import Recipe

Float32Array = npt.NDArray[np.float32]
FloatArray = npt.NDArray[np.float64]
LOOK_COLUMNS = 8
BUILD_PURPOSE = 90
MIDDLE_STATURE, STATURE_APART, STATURE_SPREAD = 1.69, 0.13, 0.07
OPEN_FRONT, ZIP = 4, 5
"""Patterns of jackets and coats; 0 to 3 are plain, stripes, a band across the chest, and a print."""

# Colours as seen on a screen, 0 to 255; how often each occurs stands in front.
SKIN = (
    (5, 206, 160, 132), (5, 192, 144, 114), (4, 176, 128, 98), (3, 156, 110, 82), (3, 132, 90, 66),
    (2, 118, 80, 58), (2, 88, 58, 42),
)  # fmt: skip
HAIR = (
    (8, 28, 22, 20), (7, 52, 36, 26), (5, 84, 58, 38), (3, 128, 92, 56), (2, 184, 146, 92),
    (1, 122, 58, 34), (2, 104, 100, 97), (1, 150, 146, 141),
)  # fmt: skip
DARK_HAIR = ((6, 22, 18, 17), (3, 34, 26, 23), (1, 110, 106, 104))
GREY_HAIR = ((4, 118, 114, 110), (3, 166, 162, 156), (2, 84, 72, 64))
TOPS = (
    (7, 36, 40, 48), (5, 66, 72, 82), (5, 40, 56, 88), (4, 232, 230, 224), (3, 190, 192, 194),
    (2, 128, 44, 46), (2, 70, 92, 72), (2, 178, 160, 132), (2, 92, 122, 160), (1, 208, 162, 60),
    (1, 186, 92, 74), (1, 104, 80, 120), (1, 60, 118, 124), (2, 138, 136, 128), (1, 222, 186, 180),
)  # fmt: skip
BOTTOMS = (
    (8, 44, 54, 78), (5, 74, 90, 120), (6, 34, 35, 40), (3, 96, 94, 92), (3, 150, 134, 108),
    (2, 82, 72, 58), (1, 190, 184, 172), (1, 66, 74, 58),
)  # fmt: skip
SHOES = ((6, 32, 30, 30), (3, 92, 64, 44), (3, 214, 212, 206), (1, 130, 44, 40), (2, 84, 90, 100))


def mixed(value: npt.NDArray[np.uint32]) -> npt.NDArray[np.uint32]:
    """Hash whole numbers: every bit of the result depends on every bit of the number."""
    value = value ^ (value >> np.uint32(16))
    value = value * np.uint32(0x7FEB352D)
    value = value ^ (value >> np.uint32(15))
    value = value * np.uint32(0x846CA68B)
    return value ^ (value >> np.uint32(16))


def chance(identity: npt.NDArray[np.int64], purpose: int) -> FloatArray:
    """A number in [0, 1) for each person and purpose."""
    key = mixed(identity.astype(np.uint32) + np.uint32(0x9E3779B9))
    return np.asarray(mixed(key ^ np.uint32(purpose * 0x85EBCA6B & 0xFFFFFFFF)) / 4294967296.0, np.float64)


def _pick(colours: tuple[tuple[int, int, int, int], ...], share: FloatArray) -> FloatArray:
    """Linear colours by a share in [0, 1). (P, 3)."""
    table = np.array(colours, np.float64)
    bounds = np.cumsum(table[:, 0]) / table[:, 0].sum()
    chosen = np.minimum(np.searchsorted(bounds, share, side="right"), len(table) - 1)
    return np.asarray((table[chosen, 1:] / 255.0) ** 2.2)


def _varied(colour: FloatArray, identity: npt.NDArray[np.int64], purpose: int, spread: float) -> FloatArray:
    """Colours made a little lighter, darker and of another hue."""
    light = 1.0 + spread * (2.0 * chance(identity, purpose) - 1.0)
    tint = 1.0 + 0.35 * spread * (
        2.0 * np.stack([chance(identity, purpose + k) for k in (1, 2, 3)], axis=1) - 1.0
    )
    return np.clip(colour * light[:, None] * tint, 0.003, 0.9)


def draw_builds(
    identity: npt.NDArray[np.int64], stature: FloatArray, recipes: Sequence[Recipe]
) -> npt.NDArray[np.int32]:
    """Draw a build for each person; taller people are more often men.

    Parameters
    ----------
    identity : (P,) int64
    stature : (P,) float64
        m.
    recipes : sequence of Recipe
        Of the builds.

    Returns
    -------
    (P,) int32
        Places in `recipes`.

    Notes
    -----
    **Source:** statures of adults are about normal with means 13 cm apart and a deviation of 7 cm within each
    sex (order of ANSUR II), which makes the odds exponential in the stature.
    """
    often = np.array([recipe.often for recipe in recipes])
    is_woman = np.array([recipe.is_woman for recipe in recipes])
    if is_woman.all() or not is_woman.any():
        share = np.full(len(identity), float(is_woman.all()))
    else:
        share = 1.0 / (1.0 + np.exp((stature - MIDDLE_STATURE) * STATURE_APART / STATURE_SPREAD**2))
    wanted = chance(identity, BUILD_PURPOSE) < share
    draw = chance(identity, BUILD_PURPOSE + 1)
    build = np.zeros(len(identity), np.int32)
    for sex in (False, True):
        rows = np.flatnonzero(wanted == sex)
        if rows.size:
            bounds = np.cumsum(often * (is_woman == sex))
            build[rows] = np.searchsorted(bounds, draw[rows] * bounds[-1], side="right")
    return build


def draw_looks(
    identity: npt.NDArray[np.int64], build: npt.NDArray[np.int32], recipes: Sequence[Recipe]
) -> Float32Array:
    """Draw looks.

    Parameters
    ----------
    identity : (P,) int64
        Stable number of each person.
    build : (P,) int32
    recipes : sequence of Recipe
        Of the builds.

    Returns
    -------
    (P, 8, 4) float32
        Columns: colours by `Material`, then (belt, 0, stripes per metre, 0), then (height of the waist, 0, 0,
        0). Beside colours: beard with that of the skin, kind with the shoes', pattern with the accent's.
    """
    count = len(identity)
    look = np.zeros((count, LOOK_COLUMNS, 4))
    is_woman = np.array([recipe.is_woman for recipe in recipes])[build]
    is_old = np.array([recipe.is_old for recipe in recipes])[build]
    outer = np.array([recipe.outfit.slack > 0.0135 and recipe.outfit.collar for recipe in recipes])[build]

    def share(purpose: int) -> FloatArray:
        return chance(identity, purpose)

    look[:, 0, :3] = _varied(_pick(SKIN, share(1)), identity, 11, 0.10)
    look[:, 0, 3] = np.where(is_woman, 0.0, np.clip(2.2 * share(2) - 1.0, 0.0, 1.0))
    look[:, 1, :3] = _varied(_pick(TOPS, share(3)), identity, 21, 0.28)
    look[:, 2, :3] = _varied(_pick(BOTTOMS, share(5)), identity, 31, 0.25)
    hair = np.where(is_old[:, None], _pick(GREY_HAIR, share(7)), _pick(HAIR, share(7)))
    # Dark skin goes with dark hair.
    dark = np.clip((0.30 - look[:, 0, 0]) / 0.12, 0.0, 1.0)[:, None] * ~is_old[:, None]
    hair = hair + dark * (_pick(DARK_HAIR, share(7)) - hair)
    look[:, 3, :3] = _varied(hair, identity, 41, 0.2)
    look[:, 4, :3] = _varied(_pick(SHOES, share(9)), identity, 51, 0.2)
    look[:, 4, 3] = share(10) < 0.4
    look[:, 5, :3] = _varied(_pick(TOPS, share(61)), identity, 62, 0.3)
    pattern = share(63)
    casual = np.digitize(pattern, (0.66, 0.82, 0.92)) % 4
    look[:, 5, 3] = np.where(outer, np.where(pattern < 0.5, OPEN_FRONT, ZIP), casual)
    look[:, 6, 0] = share(64) < 0.4
    look[:, 6, 2] = 9.0 + 14.0 * share(66)
    look[:, 7, 0] = np.array([recipe.outfit.waist for recipe in recipes])[build]
    return look.astype(np.float32)
