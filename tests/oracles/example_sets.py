"""Locomotion parameters to try: published sets, regular and irregular ones."""

import numpy as np

from crowd.blending.parameter_space import ParameterSpace

# Measured parameters of three public example sets of the SmartBody animation system (characters ChrUtah,
# ChrMarine and ChrHarmony): forward m/s, turn deg/s, side m/s.
UTAH = [
    (1.349, 0, 0), (0, 0, 0), (0, 168.8, 0), (0, -168.8, 0), (0.938, 0, 0), (0.422, 0, 0), (2.875, 0, 0),
    (4.125, 0, 0), (1.413, 72.2, 0), (1.392, -76.9, 0), (1.105, 168.8, 0), (1.064, -168.8, 0),
    (3.959, 67.5, 0), (3.882, -60, 0), (3.12, 270, 0), (3.166, -270, 0), (0, 0, -1.003), (0, 0, 1.003),
    (0, 0, -2.125), (0, 0, 2.375),
]  # fmt: skip
MARINE = [
    (0, 0, 0), (2.105, 0, 0), (0.844, 0, 0), (3.911, 0, 0), (2.271, 78.8, 0), (2.271, -78.8, 0),
    (1.631, 144.3, 0), (1.631, -144.3, 0), (0, 0, 0.346), (0, 0, -0.346), (1.105, 0, 0), (0.793, 44.3, 0),
    (0.793, -44.3, 0), (0.539, 94.9, 0), (0.539, -94.9, 0), (0, 168.8, 0), (0, -168.8, 0), (0, 0, 2.041),
    (0, 0, -2.041),
]  # fmt: skip
HARMONY = [
    (0.549, 0, 0), (0, 0, 0), (0.437, 47.7, 0), (0.437, -47.7, 0), (0.359, 87.4, 0), (0.359, -87.4, 0),
    (0, 0, -0.22), (0, 0, 0.22),
]  # fmt: skip
# Every tetrahedron of a regular lattice can be cut in several equally good ways.
LATTICE = [
    (forward, turn, side) for forward in (0, 0.7, 1.4) for turn in (-60, 0, 60) for side in (-0.5, 0, 0.5)
]
# The four quadrants of this one leave pockets below the convex hull.
POCKETS = [
    (0, 0, 0), (-1.1, 0, 0), (3.6, 0, 0), (1.3, 0, 0), (1, 110, 0), (1, -110, 0), (1.2, 0, 1), (0.8, 0, -1),
    (3.9, 25, 0), (3.8, -30, 0), (2.5, 40, 0.45), (0.5, -60, 0.5), (0.4, 50, -0.6), (-0.6, -40, -0.3),
]  # fmt: skip
# Nothing straight ahead: the quadrants fill little of the hull and do not meet.
ONLY_TURNS = [
    (0, 60, 0.4), (0, -60, 0.5), (1.4, 80, 0.1), (1.3, -70, -0.1), (2.5, 30, -0.2), (2.4, -35, 0.1),
    (0.3, 50, -0.6), (0.2, -50, -0.5),
]  # fmt: skip
ALL = {
    "utah": UTAH,
    "marine": MARINE,
    "harmony": HARMONY,
    "lattice": LATTICE,
    "pockets": POCKETS,
    "only_turns": ONLY_TURNS,
}


# Time of two cycles of each published example, s.
TWO_CYCLES = {
    "utah": [
        2.133, 2.133, 2.13, 2.13, 3.067, 2.133, 1.6, 1.333, 2.133, 2.133, 2.133, 2.133, 1.333, 1.333, 1.333,
        1.333, 2.13, 2.133, 1.6, 1.6,
    ],
    "marine": [
        2.07, 1.4, 2.333, 1.066, 1.566, 1.566, 1.4, 1.4, 2.3, 2.3, 2.067, 2.6, 2.6, 2.93, 2.93, 2.13, 2.13,
        1.6, 1.6,
    ],
    "harmony": [2.63, 2.13, 2.67, 2.67, 2.67, 2.67, 2.67, 2.67],
}  # fmt: skip


def make_space(table, duration=None):
    """Build a space; without durations, examples get very different ones."""
    parameters = np.array(table, float).reshape(-1, 3)
    parameters[:, 1] = np.radians(parameters[:, 1])
    duration = np.linspace(1.5, 0.6, len(table)) if duration is None else np.asarray(duration, float)
    return ParameterSpace.build(parameters, duration, [str(number) for number in range(len(table))])


def spaces():
    """All sets as spaces, the published ones with their own durations."""
    return {
        name: make_space(table, np.array(TWO_CYCLES[name]) / 2 if name in TWO_CYCLES else None)
        for name, table in ALL.items()
    }


def sample(space, rng, count, spread=1.0):
    """Random points in the bounding box of the examples, or in `spread` times that box."""
    low, high = space.parameters.min(axis=0), space.parameters.max(axis=0)
    return 0.5 * (low + high) + spread * 0.5 * (high - low) * rng.uniform(-1, 1, (count, 3))


def dense_weights(space, points):
    """Pose weights as (N, E) over all examples."""
    example, weight, _, _ = space.locate(points)
    dense = np.zeros((len(points), len(space.names)))
    np.add.at(dense, (np.arange(len(points))[:, None], example), weight)
    return dense
