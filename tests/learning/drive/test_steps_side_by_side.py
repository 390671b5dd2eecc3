"""Rovers that step side by side have the bits that each has alone: whatever the width, the order, the others."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from service.learning.drive.engine import Engine
from service.physics.scenario import Array
from tests.learning.drive.test_hostile import WILD
from tests.learning.drive.test_side_by_side import assert_same_bits

STEPS_S = [1e-6, 0.004, 0.02, 0.05, 0.1, 0.1 + 1e-11, 0.13, 1.0]


def started(engine: Engine, rng: np.random.Generator, count: int) -> Array:
    """States of rovers that begin to move."""
    return engine.start_many(rng.choice([300.0, 430.0, 900.0], count), rng.normal(0.0, 0.2, count))


def inputs_of(rng: np.random.Generator, before: Array, *, changing: float, extreme: bool) -> Array:
    """Slope, torque, brake and duration of each rover, (4, rover); some change, all of them are of a few kinds."""
    count = before.shape[1]
    slopes = [-1.5, 0.0, 1.5] if extreme else [-0.3, 0.1, 0.3, 0.5]
    torques = [0.0, 5e-324, 1e9] if extreme else [0.0, 40.0, 60.0, 110.0]
    fresh = np.stack([rng.choice(slopes, count), rng.choice(torques, count), rng.random(count) < 0.1, np.zeros(count)])
    found = np.where(rng.random((4, count)) < changing, fresh, before)
    found[3] = np.where(rng.random(count) < 0.1, rng.choice(STEPS_S, count), rng.choice(STEPS_S))
    return found


def alone(engine: Engine, states: Array, inputs: Array) -> tuple[Array, Array]:
    """Each by itself: states and what is said of them."""
    found, said = states.copy(), []
    for row in range(len(found)):
        one, own = found[[row]], np.ascontiguousarray(inputs[:, [row]])
        said.append(engine.advance(one, own))
        found[row] = one[0]
    return found, np.concatenate(said, axis=1)


@given(
    st.integers(0, 2**32 - 1), st.integers(1, 40), st.sampled_from([0.0, 0.02, 0.3]), st.integers(1, 6), st.booleans()
)
@settings(max_examples=60)
def test_each_steps_as_it_does_alone(
    engines: list[Engine], seed: int, count: int, changing: float, steps: int, extreme: bool
):
    rng = np.random.default_rng(seed)
    first = started(engines[0], rng, count)
    together, wanted = [first.copy() for _ in engines], first
    inputs = np.tile([[0.2], [60.0], [0.0], [0.1]], count)
    inputs = inputs_of(rng, inputs, changing=0.5, extreme=extreme)
    for _ in range(steps):
        wanted, said = alone(engines[0], wanted, inputs)
        for engine, states in zip(engines, together, strict=True):
            assert_same_bits(engine.advance(states, inputs), said)
            assert_same_bits(states, wanted)
        inputs = inputs_of(rng, inputs, changing=changing, extreme=extreme)


def test_a_fleet_may_be_cut_anywhere_and_be_in_any_order(engines: list[Engine]):
    rng = np.random.default_rng(4)
    inputs = np.stack([rng.uniform(-0.3, 0.5, 100), rng.uniform(0, 120, 100), np.zeros(100), np.full(100, 0.25)])
    for engine in engines:
        states = started(engine, rng, 100)
        engine.advance(states, inputs)
        whole, order = states.copy(), rng.permutation(100)
        engine.advance(whole, inputs)
        parts = [(rows, states[rows]) for rows in np.split(order, [1, 3, 20, 57])]
        for rows, part in parts:
            engine.advance(part, np.ascontiguousarray(inputs[:, rows]))
            assert_same_bits(part, whole[rows])


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=60)
def test_no_number_leads_out_of_bounds_or_to_others(engines: list[Engine], seed: int):
    rng, count = np.random.default_rng(seed), 11
    first = started(engines[0], rng, count)
    inputs = np.tile([[0.2], [60.0], [0.0], [0.1]], count)
    engines[0].advance(first, inputs)
    spoilt, wild = rng.integers(0, count, 2), first.copy()
    for row in spoilt:
        wild[row, rng.integers(3, first.shape[1], 3)] = rng.choice(WILD, 3)
    inputs[rng.integers(0, 3), spoilt[:1]] = rng.choice(WILD)
    wanted, _ = alone(engines[0], first, inputs)
    others = np.setdiff1d(np.arange(count), spoilt)
    for engine in engines:
        states = wild.copy()
        engine.advance(states, inputs)
        assert_same_bits(states[others], wanted[others])
