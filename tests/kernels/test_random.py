"""Random numbers that depend on their keys alone: exact against a twin, and random enough."""

import ast
import math
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy import stats

from crowd_kernels.random import mix, normal, uniform
from tests.oracles import random as oracle

REPOSITORY = Path(__file__).resolve().parents[2]
whole = st.integers(-(2**63), 2**63 - 1)
keys = st.tuples(whole, whole, whole, whole)


@given(x=st.integers(0, 2**64 - 1), key=whole)
def test_mix_matches_oracle(x, key):
    assert int(mix(np.uint64(x), key)) == oracle.mix(x, key)


@pytest.mark.parametrize(
    ("state", "output"),
    [
        (1234567, 6457827717110365317),
        (1234567 + 0x9E3779B97F4A7C15, 3203168211198807973),
        (1234567 + 2 * 0x9E3779B97F4A7C15, 9817491932198370423),
    ],
)
def test_mix_gives_the_published_sequence_of_splitmix64(state, output):
    assert int(mix(np.uint64(0), np.uint64(state % 2**64))) == output


@given(four=keys)
@example(four=(0, 0, 0, 0))
@example(four=(-1, -1, -1, -1))
def test_uniform_matches_oracle(four):
    value = uniform(*four)
    assert value == oracle.uniform(*four)
    assert 0 <= value < 1


@given(four=keys)
@example(four=(0, 0, 0, 0))
def test_normal_matches_oracle(four):
    value = normal(*four)
    assert math.isfinite(value)
    assert value == pytest.approx(oracle.normal(*four), rel=1e-12, abs=1e-12)


def test_integer_types_of_a_key_do_not_matter():
    values = {uniform(7, kind(3), 11, 2) for kind in (int, np.int32, np.int64, np.uint8, np.uint64)}
    assert len(values) == 1


def draws(function, vary, count=20_000):
    """Numbers along one key, the others fixed."""
    fixed = {"seed": 1, "character": 2, "step": 3, "purpose": 4}
    return np.array([function(*(fixed | {vary: index}).values()) for index in range(count)])


@pytest.mark.parametrize("vary", ["seed", "character", "step", "purpose"])
def test_draws_along_any_key_are_uniform_and_independent(vary):
    values = draws(uniform, vary)
    assert stats.kstest(values, "uniform").pvalue > 1e-3
    for lag in (1, 2, 16):
        assert abs(np.corrcoef(values[:-lag], values[lag:])[0, 1]) < 5 / math.sqrt(len(values))


@pytest.mark.parametrize("vary", ["character", "step"])
def test_normal_draws_are_normal(vary):
    assert stats.kstest(draws(normal, vary), "norm").pvalue > 1e-3


def test_keys_in_other_order_give_other_numbers():
    assert len({uniform(*order) for order in [(1, 2, 3, 4), (2, 1, 3, 4), (1, 3, 2, 4), (1, 2, 4, 3)]}) == 4


def test_one_bit_of_a_key_flips_half_of_the_hash():
    flips = [
        (oracle.mix(0, key) ^ int(mix(np.uint64(0), np.uint64(key ^ (1 << bit))))).bit_count()
        for key in range(40)
        for bit in range(64)
    ]
    assert 30 < np.mean(flips) < 34
    assert min(flips) > 8


def purposes():
    """Every ``PURPOSE_...`` number in the code with the places that define it."""
    found = defaultdict(list)
    for folder in ("crowd", "kernels"):
        for path in sorted((REPOSITORY / folder).rglob("*.py")):
            for node in ast.parse(path.read_text(encoding="utf-8")).body:
                if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
                    name = node.targets[0].id
                    if name.startswith("PURPOSE_"):
                        found[ast.literal_eval(node.value)].append(f"{path.name}: {name}")
    return found


def test_no_two_purposes_share_a_number():
    found = purposes()
    assert len(found) > 10
    # Normal numbers also use the complement of their purpose.
    taken = [*found, *(~number for number in found)]
    assert len(set(taken)) == len(taken)
    assert {number: places for number, places in found.items() if len(places) > 1} == {}
