"""The people that come with the engine: figures, what they wear, and skins from the file beside this one."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from crowd.body.clothes import Outfit
from crowd.body.figure import Figure
from crowd.body.skin import Skin, read_skins
from crowd.motion.body import build_skeleton
from crowd.motion.skeleton import Skeleton

SKINS = Path(__file__).with_name("skins.npz")


@dataclass(frozen=True)
class Recipe:
    """How one build is made.

    Attributes
    ----------
    name : str
    figure : Figure
    outfit : Outfit
    is_woman, is_old : bool
    often : float
        How often it occurs against the others.
    """

    name: str
    figure: Figure
    outfit: Outfit
    is_woman: bool = False
    is_old: bool = False
    often: float = 1.0


@dataclass(frozen=True)
class Build:
    """A recipe and its skins.

    Attributes
    ----------
    recipe : Recipe
    skins : tuple of Skin
        From fine to coarse.
    """

    recipe: Recipe
    skins: tuple[Skin, ...]


@cache
def built_in_builds() -> tuple[Build, ...]:
    """Every build with its skins, which the built-in skeleton moves."""
    return tuple(Build(*both) for both in zip(RECIPES, read_skins(SKINS), strict=True))


def is_built_in(skeleton: Skeleton) -> bool:
    """The skins fit a skeleton."""
    own = build_skeleton()
    return skeleton.joint_names == own.joint_names and np.allclose(skeleton.offset, own.offset, atol=1e-4)


MAN = Figure()
SLIM_MAN = Figure(hip=0.95, waist=0.93, chest=0.95, arm=0.90, leg=0.93, neck=0.94)
STRONG_MAN = Figure(waist=1.02, chest=1.08, shoulder=1.08, arm=1.14, leg=1.05, neck=1.08, jaw=1.06)
HEAVY_MAN = Figure(
    hip=1.14,
    waist=1.30,
    chest=1.16,
    belly=0.075,
    shoulder=1.06,
    arm=1.15,
    leg=1.14,
    neck=1.14,
    jaw=1.14,
    hand=1.05,
)
OLD_MAN = Figure(hip=1.02, waist=1.14, chest=1.0, belly=0.045, shoulder=0.94, arm=0.93, leg=0.96, neck=0.98)
WOMAN = Figure(
    hip=1.06,
    waist=0.88,
    chest=0.88,
    bust=0.026,
    shoulder=0.84,
    arm=0.82,
    hand=0.88,
    leg=0.98,
    neck=0.82,
    jaw=0.90,
    head=0.97,
)
SLIM_WOMAN = Figure(
    hip=0.98,
    waist=0.82,
    chest=0.84,
    bust=0.020,
    shoulder=0.80,
    arm=0.75,
    hand=0.86,
    leg=0.90,
    neck=0.79,
    jaw=0.88,
    head=0.97,
)
HEAVY_WOMAN = Figure(
    hip=1.24,
    waist=1.18,
    chest=1.05,
    bust=0.040,
    belly=0.045,
    shoulder=0.96,
    arm=1.08,
    hand=0.93,
    leg=1.16,
    neck=0.94,
    jaw=1.02,
)
OLD_WOMAN = Figure(
    hip=1.12,
    waist=1.08,
    chest=0.94,
    bust=0.030,
    belly=0.025,
    shoulder=0.86,
    arm=0.88,
    hand=0.90,
    leg=1.0,
    neck=0.86,
    jaw=0.94,
)
SHORT_SLEEVE, LONG_SLEEVE, NO_SLEEVE = 1.20, 0.872, 1.36
RECIPES = (
    Recipe("man in a T-shirt and jeans", MAN, Outfit(sleeve=SHORT_SLEEVE)),
    Recipe(
        "man in a shirt",
        MAN,
        Outfit("crop", sleeve=LONG_SLEEVE, collar=True, drape=0.8, hem=0.95, cuff=0.056),
    ),
    Recipe(
        "man in a jacket",
        SLIM_MAN,
        Outfit(sleeve=LONG_SLEEVE, slack=0.020, drape=0.9, hem=0.86, collar=True, cuff=0.056),
    ),
    Recipe(
        "man in shorts",
        STRONG_MAN,
        Outfit("crop", sleeve=SHORT_SLEEVE, bottom_hem=0.50, cuff=0.085, shoe=0.10),
    ),
    Recipe(
        "man with a cap",
        SLIM_MAN,
        Outfit("crop", "cap", sleeve=LONG_SLEEVE, slack=0.022, drape=0.7, hem=0.93, cuff=0.052),
        often=0.6,
    ),
    Recipe(
        "man with a backpack",
        MAN,
        Outfit("curls", sleeve=SHORT_SLEEVE, bag="backpack", cuff=0.058),
        often=0.7,
    ),
    Recipe(
        "heavy man",
        HEAVY_MAN,
        Outfit("crop", sleeve=SHORT_SLEEVE, drape=1.0, hem=0.90, cuff=0.068),
        often=0.6,
    ),
    Recipe(
        "old man in a coat",
        OLD_MAN,
        Outfit("short", "", LONG_SLEEVE, 0.022, 1.0, 0.66, 0.012, True, cuff=0.062),
        is_old=True,
        often=0.7,
    ),
    Recipe(
        "bald man with a bag",
        STRONG_MAN,
        Outfit("bald", sleeve=LONG_SLEEVE, drape=0.5, bag="shoulder"),
        often=0.6,
    ),
    Recipe(
        "woman in a top and jeans",
        WOMAN,
        Outfit("long", sleeve=SHORT_SLEEVE, slack=0.007, drape=0.25, hem=0.95, cuff=0.046),
        is_woman=True,
    ),
    Recipe(
        "woman in a dress",
        SLIM_WOMAN,
        Outfit("bob", "", NO_SLEEVE, 0.008, 0.1, 0.54, 0.030, bottom="", bottom_hem=0.54, shoe=0.085),
        is_woman=True,
    ),
    Recipe(
        "woman in a skirt",
        WOMAN,
        Outfit(
            "bun",
            sleeve=LONG_SLEEVE,
            slack=0.009,
            drape=0.3,
            hem=0.97,
            collar=True,
            bottom="skirt",
            bottom_hem=0.52,
            shoe=0.085,
        ),
        is_woman=True,
    ),
    Recipe(
        "woman in sportswear",
        SLIM_WOMAN,
        Outfit("ponytail", sleeve=NO_SLEEVE, slack=0.006, drape=0.2, hem=0.97, cuff=0.040, shoe=0.10),
        is_woman=True,
        often=0.7,
    ),
    Recipe(
        "woman in a coat",
        WOMAN,
        Outfit("long", "", LONG_SLEEVE, 0.020, 0.45, 0.58, 0.022, True, cuff=0.046),
        is_woman=True,
    ),
    Recipe(
        "woman with a headscarf",
        WOMAN,
        Outfit("short", "scarf", LONG_SLEEVE, 0.014, 0.8, 0.62, 0.020, cuff=0.056),
        is_woman=True,
        often=0.45,
    ),
    Recipe(
        "woman with a bag",
        SLIM_WOMAN,
        Outfit("bob", sleeve=LONG_SLEEVE, slack=0.014, drape=0.6, hem=0.91, cuff=0.044, bag="shoulder"),
        is_woman=True,
    ),
    Recipe(
        "heavy woman",
        HEAVY_WOMAN,
        Outfit("bob", sleeve=SHORT_SLEEVE, slack=0.012, drape=0.9, hem=0.86, cuff=0.060),
        is_woman=True,
        often=0.6,
    ),
    Recipe(
        "old woman in a skirt",
        OLD_WOMAN,
        Outfit("curls", "", LONG_SLEEVE, 0.014, 0.8, 0.90, 0.006, False, "skirt", 0.36),
        is_woman=True,
        is_old=True,
        often=0.6,
    ),
    Recipe(
        "woman with a woollen hat",
        WOMAN,
        Outfit("long", "beanie", LONG_SLEEVE, 0.020, 0.7, 0.88, cuff=0.050, bag="backpack"),
        is_woman=True,
        often=0.5,
    ),
)
