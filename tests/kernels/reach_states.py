"""States of one person's hands for tests of the kernels of reaches."""

from crowd.state import State
from crowd_kernels.reach_state import ReachState


def state_of(arm, **known):
    """The state of one person's hands: zeros, but for what is given for one of them."""
    state = State.create(1)
    arrays = {name: getattr(state, f"reach_{name}") for name in ReachState._fields}
    for value in arrays.values():
        value.fill(0)
    for name, value in known.items():
        arrays[name][0, arm] = value
    return ReachState(**arrays)
