"""Idle glances against their twin; whom people look at, and for how long."""

import numpy as np

from crowd.controllers.gaze_settings import GlanceSettings, glance_limits
from crowd.navigation.cell_table import CellTable
from crowd_kernels.glance import CHUNKS, glance_crowd
from tests.oracles import glance as oracle

SETTINGS = GlanceSettings()
LIMITS = glance_limits(SETTINGS)


class Square:
    """People on a square, some of whom walk."""

    def __init__(self, position, velocity, yaw):
        count = len(position)
        self.position, self.velocity, self.yaw = position, velocity, yaw
        self.is_active = np.ones(count, bool)
        self.until, self.index_of_other = np.zeros(count), np.full(count, -1, np.int32)
        self.is_glancing, self.kind = np.zeros(count, bool), np.zeros(count, np.uint8)
        self.trunk, self.may_glance = np.ones(count, np.float32), np.ones(count, bool)
        self.cells = CellTable(count, 0.25, LIMITS.distance)
        self.keys = np.zeros((CHUNKS, 8), np.int64)
        self.index = 0

    @property
    def whom(self):
        """Who is glanced at, -1 for nobody."""
        return np.where(self.is_glancing, self.index_of_other, -1)

    def step(self, dt=0.1, limits=LIMITS, seed=9):
        self.index += 1
        active = np.flatnonzero(self.is_active).astype(np.int32)
        cells = self.cells
        cells.sort(self.position, np.full(len(self.yaw), 0.25), active, LIMITS.distance)
        glance_crowd(
            cells.cell_start, cells.point, cells.character, cells.columns, cells.rows, cells.cell_size,
            limits, self.position, self.velocity, self.yaw, self.is_active, self.may_glance, 0.25, active,
            seed, self.index, self.index * dt, self.keys, self.until, self.is_glancing, self.kind,
            self.index_of_other, self.trunk,
        )  # fmt: skip


def crowd_of(rng, count=40):
    ground = np.array([1.0, 0.0, 1.0])
    yaw = rng.uniform(-np.pi, np.pi, count)
    walk = np.stack([np.sin(yaw), np.zeros(count), np.cos(yaw)], axis=1) * rng.choice([0, 1.3], (count, 1))
    return Square(rng.uniform(-6, 6, (count, 3)) * ground, walk, yaw)


def test_choices_agree_with_the_slow_twin(rng):
    square = crowd_of(rng)
    chosen = 0
    for _ in range(200):
        until, whom = square.until.copy(), square.whom.copy()
        square.position += 0.1 * square.velocity
        square.is_active[3] = square.index % 40 < 20
        square.step()
        for character in np.flatnonzero(square.is_active):
            wanted = oracle.glance(
                LIMITS, square.position, square.velocity, square.yaw, square.is_active, character, 9,
                square.index, square.index * 0.1, 8, until[character], whom[character],
            )  # fmt: skip
            assert (square.until[character], square.whom[character]) == wanted
            chosen += wanted[1] >= 0
    assert chosen > 100


def test_people_look_at_who_comes_towards_them_and_not_at_who_is_behind():
    # The first faces ahead; one comes from the front, one stands there, one follows behind.
    position = np.array([[0.0, 0, 0], [0.3, 0, 3.0], [-0.3, 0, 3.0], [0, 0, -1.5]])
    velocity = np.array([[0.0, 0, 0], [0, 0, -1.3], [0, 0, 0], [0, 0, 1.3]])
    square = Square(position, velocity, np.array([0, np.pi, np.pi, 0]))
    seen = []
    for _ in range(20_000):
        square.step()
        seen.append(square.whom[0])
    share = np.bincount(np.array(seen) + 1, minlength=5) / len(seen)
    assert share[4] == 0, "nobody looks behind"
    assert share[2] > 1.5 * share[3], "who comes nearer draws the eye"
    assert share[0] > 0.6, "glances are short"


def test_lengths_of_glances_are_as_set():
    position = np.array([[0.0, 0, 0], [0, 0, 1.5]])
    square = Square(position, np.zeros((2, 3)), np.array([0.0, np.pi]))
    lengths, since = [], None
    for index in range(60_000):
        before = square.whom[0]
        square.step(dt=0.05)
        if square.whom[0] != before:
            if since is not None and before >= 0:
                lengths.append((index - since) * 0.05)
            since = index
    assert len(lengths) > 100
    assert abs(np.mean(lengths) - SETTINGS.length[0]) < 0.15 * SETTINGS.length[0]


def test_the_choice_does_not_depend_on_cells_or_company_far_away(rng):
    one, other = crowd_of(rng, 30), None
    other = Square(
        np.concatenate([one.position, one.position + [500.0, 0, 0]]),
        np.concatenate([one.velocity, one.velocity]),
        np.concatenate([one.yaw, one.yaw]),
    )
    other.cells.cell_size = 0.4
    for _ in range(80):
        one.step()
        other.step()
    np.testing.assert_array_equal(one.whom, other.whom[:30])
    np.testing.assert_array_equal(one.until, other.until[:30])


def test_a_wanted_gaze_is_left_alone_and_some_people_never_glance(rng):
    square = crowd_of(rng)
    square.kind[:10] = 1
    square.kind[10] = 2
    square.may_glance[11:20] = False
    for _ in range(200):
        square.step()
        assert not square.is_glancing[:20].any()
    assert square.kind[:11].tolist() == [1] * 10 + [2]
    assert not square.kind[11:20].any()
    assert (square.kind[20:] == np.where(square.is_glancing[20:], 2, 0)).all()
    assert (square.trunk[20:] == 0.25).any()
