"""Bodies of people: smooth skins made from signed distances around the built-in skeleton."""

from crowd.body.builds import Build, Recipe, built_in_builds
from crowd.body.clothes import Material, Outfit
from crowd.body.figure import Figure
from crowd.body.skin import Skin

__all__ = ["Build", "Figure", "Material", "Outfit", "Recipe", "Skin", "built_in_builds"]
