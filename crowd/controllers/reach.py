"""Layer 5, reach: hands go to targets by blended examples, exact by inverse kinematics."""

from functools import cache

from crowd.blending.reach_space import SIDES, ReachSpace
from crowd.motion.body import build_skeleton
from crowd.motion.procedural.reaching import seated_reaches, standing_reaches


@cache
def built_in_reach_space() -> ReachSpace:
    """Space of the built-in reaches: standing right and left, seated right and left; made once."""
    parts = (standing_reaches(), seated_reaches())
    sets = [
        [clip for clip in part if clip.reach and clip.reach.side == side] for part in parts for side in SIDES
    ]
    return ReachSpace.build(build_skeleton(), sets)
