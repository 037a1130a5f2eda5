"""Make the file of skins anew: ``python -m crowd.body``; needs ``pip install "crowd-engine[body]"``."""

from crowd.body.builds import RECIPES, SKINS
from crowd.body.generate import generate
from crowd.body.skin import write_skins
from crowd.body.stance import Stance
from crowd.motion.body import build_skeleton


def main() -> None:
    """Generate every build and write the file beside this one."""
    stance = Stance(build_skeleton())
    builds = []
    for number, recipe in enumerate(RECIPES, 1):
        print(f"{number} of {len(RECIPES)}: {recipe.name}", flush=True)
        builds.append(generate(recipe, stance))
    write_skins(SKINS, builds)
    print(f"{SKINS}, {SKINS.stat().st_size} bytes")


if __name__ == "__main__":
    main()
