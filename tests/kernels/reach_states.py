"""States of one person's hands for tests of the kernels of reaches."""

import numpy as np

from crowd_kernels.reach_examples import SLOTS
from crowd_kernels.reach_state import ReachState


def state_of(arm, **known):
    """The state of one person's hands: zeros, but for what is given for one of them."""
    shape = {"example": (SLOTS,), "rotation": (4,), "glide_turn": (4,), "target_rotation_world": (4,)}
    flat = {"time_left", "plan_time", "course", "example_count", "stage", "status", "weight"}
    flat |= {"lead_time", "seconds", "turn"}
    arrays = {}
    for name in ReachState._fields:
        last = shape.get(name, (SLOTS,) if name.startswith("example_") else (3,))
        last = () if name in flat else last
        kind = np.int32 if name in ("example", "example_count") else float
        arrays[name] = np.zeros((1, 2, *last), kind)
    for name, value in known.items():
        arrays[name][0, arm] = value
    return ReachState(**arrays)
