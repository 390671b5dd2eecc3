"""Scenarios side by side have the bits that each has alone: whatever the width, the order, the others, the threads."""

from __future__ import annotations

from collections.abc import Iterator
from ctypes import addressof

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from service.learning.drive import threads
from service.learning.drive.engine import Engine
from service.learning.drive.library import address, library
from service.physics.scenario import Array
from tests.learning.drive.test_hostile import WILD


@pytest.fixture
def three_threads() -> Iterator[None]:
    threads.allow_threads(3)
    yield
    threads.allow_threads(1)


def columns_of(rng: np.random.Generator, count: int, *, extreme: bool) -> tuple[Array, ...]:
    """Slopes, masses, torques, start speeds and offsets."""
    if not extreme:
        slope, mass, torque = rng.uniform(-0.45, 0.6, count), rng.uniform(300, 900, count), rng.uniform(0, 130, count)
        return slope, mass, torque, rng.normal(0, 0.1, count), rng.normal(0, 0.03, count)
    slope = rng.choice([-1.5, -0.4, -0.0, 0.0, 0.2, 0.5, 1.5], count)
    mass, torque = rng.choice([1e-3, 50.0, 430.0, 1e6], count), rng.choice([0.0, 5e-324, 40.0, 130.0, 1e9], count)
    return slope, mass, torque, rng.choice([-30.0, -0.01, 0.0, 0.4, 50.0], count), rng.choice([-1.0, 0.0, 0.02], count)


def times_of(rng: np.random.Generator, count: int, *, shared: bool) -> Array:
    """Times that rise: some at 0, some twice, some beside the ends of cells; rows end when they like."""
    rows = 1 if shared else count
    times = rng.uniform(0, 1, (rows, 40)) * rng.choice([0.0, 0.01, 1.0, 4.0], (rows, 1))
    times[:, :12] = rng.choice([0.0, 1e-11, 0.02, 0.02 + 1e-11, 0.3, 0.35, 0.35 - 1e-11], (rows, 12))
    times.sort(axis=1)
    return np.array(times[0] if shared else times)


def alone(engine: Engine, columns: tuple[Array, ...], times: Array) -> Array:
    """Of each scenario by itself, (5, scenario, time)."""
    found = []
    for row in range(len(columns[0])):
        slope, mass, torque, speed, offset = (column[[row]] for column in columns)
        found.append(
            np.stack(engine.constant(slope, mass, torque, speed, times if times.ndim == 1 else times[[row]], offset))
        )
    return np.concatenate(found, axis=1)


def together(engine: Engine, columns: tuple[Array, ...], times: Array) -> Array:
    slope, mass, torque, speed, offset = columns
    return np.stack(engine.constant(slope, mass, torque, speed, times, offset))


def assert_same_bits(found: Array, wanted: Array) -> None:
    np.testing.assert_array_equal(found.view(np.uint64), np.ascontiguousarray(wanted).view(np.uint64))


@given(st.integers(0, 2**32 - 1), st.integers(3, 40), st.booleans(), st.booleans())
@settings(max_examples=40)
def test_each_is_as_it_is_alone(engines: list[Engine], seed: int, count: int, shared: bool, extreme: bool):
    rng = np.random.default_rng(seed)
    columns, times = columns_of(rng, count, extreme=extreme), times_of(rng, count, shared=shared)
    wanted = alone(engines[0], columns, times)
    assert np.isfinite(wanted).all()
    for engine in engines:
        assert_same_bits(together(engine, columns, times), wanted)
        slope, mass, torque, speed, offset = columns
        assert_same_bits(engine.ways(slope, mass, torque, speed, times, offset), wanted[0])
        assert_same_bits(np.stack(engine.places(slope, mass, torque, speed, times, offset)), wanted[[0, 4]])


def test_the_order_does_not_matter(engines: list[Engine]):
    rng = np.random.default_rng(1)
    columns, times = columns_of(rng, 200, extreme=False), np.linspace(0, 12, 77)
    for engine in engines:
        wanted, order = together(engine, columns, times), rng.permutation(200)
        found = together(engine, tuple(column[order] for column in columns), times)
        assert_same_bits(found, wanted[:, order])


def test_times_in_any_order_of_rows_that_end_when_they_like(engines: list[Engine]):
    rng = np.random.default_rng(2)
    columns = columns_of(rng, 30, extreme=False)
    times = rng.uniform(0, 1, (30, 25)) * rng.uniform(0.001, 9, (30, 1))
    for engine in engines:
        assert_same_bits(together(engine, columns, times), alone(engine, columns, times))


@given(st.integers(0, 2**32 - 1), st.integers(1, 30), st.booleans())
@settings(max_examples=25)
def test_the_whole_way_is_that_of_its_times(engines: list[Engine], seed: int, count: int, shared: bool):
    rng = np.random.default_rng(seed)
    slope, mass, torque, speed, _ = columns_of(rng, count, extreme=False)
    times = times_of(rng, count, shared=shared)
    horizons = np.full(count, 7.3) if shared else rng.uniform(0.001, 9.0, count)
    looks = np.array([2.1, 9.7])[: seed % 3]
    own = horizons[:, None] * (np.arange(401) / 400)
    x, _, front, rear, y = engines[0].constant(slope, mass, torque, speed, own)
    seen = engines[0].ways(slope, mass, torque, speed, looks)
    wheels = front + rear
    path = np.sqrt(np.square(np.diff(x)) + np.square(np.diff(y)))
    mean = (wheels.sum(axis=1) - 0.5 * (wheels[:, 0] + wheels[:, -1])) / 800
    first = None
    for engine in engines:
        columns, whole = engine.whole(slope, mass, torque, speed, times, horizons, looks)
        assert_same_bits(np.stack(columns), together(engine, (slope, mass, torque, speed, np.zeros(count)), times))
        placed, standing = engine.whole(slope, mass, torque, speed, times, horizons, looks, moving=False)
        assert_same_bits(np.stack(placed), np.stack([columns[0], columns[4]]))
        assert_same_bits(standing.path_m, whole.path_m)
        for found, wanted in ((whole.late_x_m, x[:, 300]), (whole.end_x_m, x[:, -1]), (whole.end_y_m, y[:, -1])):
            assert_same_bits(found, wanted)
        assert_same_bits(np.ascontiguousarray(whole.seen_m), seen)
        np.testing.assert_allclose(whole.path_m, path.sum(axis=1), rtol=1e-12, atol=1e-15)
        np.testing.assert_allclose(whole.wheels_rad_s, mean, rtol=1e-12, atol=1e-15)
        first = first or whole
        assert_same_bits(whole.path_m, first.path_m)
        assert_same_bits(whole.wheels_rad_s, first.wheels_rad_s)
        ways = engine.whole_ways(slope, mass, torque, speed, horizons, looks)
        for name in ("late_x_m", "end_x_m", "wheels_rad_s"):
            assert_same_bits(getattr(ways, name), getattr(whole, name))
        assert_same_bits(np.ascontiguousarray(ways.seen_m), seen)
        assert not ways.path_m.any()
        assert not ways.end_y_m.any()


@pytest.mark.usefixtures("three_threads")
def test_threads_change_nothing(engine: Engine):
    rng = np.random.default_rng(3)
    columns, times = columns_of(rng, 3 * threads.PART + 5, extreme=False), np.linspace(0, 5, 31)
    found = together(engine, columns, times)
    threads.allow_threads(1)
    assert_same_bits(found, together(engine, columns, times))


@pytest.mark.usefixtures("three_threads")
@pytest.mark.parametrize("count", [0, 1, threads.PART, threads.PART + 1, 7 * threads.PART - 1])
def test_parts_are_all_of_it_once(count: int):
    seen = np.zeros(count, dtype=int)

    def work(first: int, end: int) -> None:
        seen[first:end] += 1

    threads.in_parts(work, count)
    assert (seen == 1).all()


@pytest.mark.usefixtures("three_threads")
def test_what_a_part_raises_is_raised():
    def work(first: int, end: int) -> None:
        raise ValueError(f"{first} to {end}")

    with pytest.raises(ValueError, match="to"):
        threads.in_parts(work, 5 * threads.PART)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=60)
def test_no_number_leads_out_of_bounds(engines: list[Engine], seed: int):
    """As `test_hostile` says of one rover; what is not finite stays in its own row."""
    rng, count, times = np.random.default_rng(seed), 11, 30
    for engine in engines:
        struct = type(engine._laid_out.struct).from_buffer_copy(engine._laid_out.struct)
        numbers = np.array(engine.law.parameters)
        scenarios = np.stack(columns_of(rng, count, extreme=False))
        moments = np.tile(np.linspace(0, 2, times), (count, 1))
        for array in (numbers, scenarios, moments):
            if rng.random() < 0.5:
                array.flat[rng.integers(0, array.size, 3)] = rng.choice(WILD, 3)
        moments[moments > 100.0] = 100.0  # or it takes a while
        struct.parameters = address(numbers)
        outputs, order = np.full((5, count, times), -7.0), rng.permutation(count)
        to, law = address(outputs), addressof(struct)
        rows = address(scenarios), times, address(moments), times
        library().rover_side_by_side(law, count - 1, address(order), count, *rows, 5, to, None)
        assert (outputs[:, order[-1]] == -7.0).all()  # was not asked for
        one = np.full((5, count, times), -7.0)
        library().rover_constant(law, count, *rows, address(one))
        rise = (np.diff(moments) >= 0.0).all()  # of others only the place is right
        if rise and np.isfinite(one).all() and np.isfinite(scenarios).all():  # a torque of NaN is new in each cell
            assert_same_bits(outputs[:, order[:-1]], one[:, order[:-1]])
