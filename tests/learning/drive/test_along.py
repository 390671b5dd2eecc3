"""Many drives in one call have the bits that each has alone: whatever the width, the order, the others."""

from __future__ import annotations

from ctypes import addressof

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from service.learning.drive.engine import Engine, Motion
from service.learning.drive.inputs import Controls, Route, Track
from service.learning.drive.library import CompiledRoute, address, library
from service.physics.scenario import Array
from tests.learning.drive.drives import controls_after
from tests.learning.drive.test_hostile import WILD
from tests.learning.drive.test_side_by_side import assert_same_bits

TIMES = np.linspace(0.0, 12.0, 67)
CHANGES_S = [[0.0], [0.0, 5.0], [0.0, 0.31, 0.32, 7.77], [0.0, 5e-11, 3.0], [0.0, 3.0, 3.0 + 5e-11]]


def columns(motion: Motion) -> Array:
    return np.stack(
        [motion.x_m, motion.speed_m_s, motion.front_wheel_rad_s, motion.rear_wheel_rad_s, motion.y_m, motion.slope_rad]
    )


def track_of(rng: np.random.Generator) -> Track:
    knots = int(rng.choice([1, 2, 6]))
    distances = np.cumsum(rng.uniform(0.05, 2.0, knots)) - rng.choice([0.0, 1.0])
    return Track(distances, rng.uniform(-0.4, 0.6, knots))


def routes_of(engine: Engine, rng: np.random.Generator, count: int, *, braked: bool) -> list[Route]:
    """Of a few kinds of controls, so that some go side by side; torques of some stay where those of others change."""
    found = []
    changes = CHANGES_S[int(rng.integers(len(CHANGES_S)))]
    locked = rng.random(len(changes)) < (0.4 if braked else 0.0)
    for _ in range(count):
        times = np.array(changes if rng.random() < 0.9 else CHANGES_S[int(rng.integers(len(CHANGES_S)))])
        torques = rng.choice([0.0, 60.0, 110.0], len(times))
        brake = locked if len(times) == len(locked) else rng.random(len(times)) < (0.3 if braked else 0.0)
        start = engine.start(float(rng.uniform(300, 900)), float(rng.choice([0.0, -0.1, 0.4])))
        found.append(
            Route(start, track_of(rng), Controls(times, torques, brake), float(rng.choice([0.0, -0.02, 0.03])))
        )
    return found


def alone(engine: Engine, routes: list[Route], times: Array) -> Array:
    """Each by itself, (route, column, time)."""
    return np.stack(
        [columns(engine.drive(each.start, each.track, each.controls, times, each.offset)[0]) for each in routes]
    )


def times_of(rng: np.random.Generator) -> Array:
    """Times that rise: some at 0, some twice, some beside the ends of cells and the changes of torques."""
    times = rng.uniform(0.0, float(rng.choice([0.01, 1.0, 12.0])), 30)
    times[:10] = rng.choice([0.0, 1e-11, 0.02, 0.02 + 1e-11, 0.3, 0.31, 5.0, 7.77 - 1e-11], 10)
    times.sort()
    return np.array(times[: int(rng.choice([0, 1, 3, 30]))])


@given(st.integers(0, 2**32 - 1), st.sampled_from([1, 2, 3, 7, 20]), st.booleans())
@settings(max_examples=60)
def test_each_is_as_it_is_alone(engines: list[Engine], seed: int, count: int, braked: bool):
    rng = np.random.default_rng(seed)
    routes, times = routes_of(engines[0], rng, count, braked=braked), times_of(rng)
    wanted = alone(engines[0], routes, times)
    for engine in engines:
        assert_same_bits(np.stack([columns(each) for each in engine.along(routes, times)]), wanted)
        assert_same_bits(engine.ways_along(routes, times), wanted[:, 0])


def test_offsets_of_one_drive_and_any_order(engines: list[Engine]):
    rng = np.random.default_rng(1)
    for engine in engines:
        (one,) = routes_of(engine, rng, 1, braked=False)
        routes = [Route(one.start, one.track, one.controls, offset) for offset in np.linspace(-0.1, 0.3, 21)]
        order = rng.permutation(21)
        found = engine.ways_along([routes[at] for at in order], TIMES)
        assert_same_bits(found, engine.ways_along(routes, TIMES)[order])
        assert_same_bits(found, alone(engine, routes, TIMES)[order, 0])


def test_who_is_underway_goes_on_as_alone(engine: Engine):
    rng = np.random.default_rng(2)
    routes = []
    for each in routes_of(engine, rng, 9, braked=True):
        _, state = engine.drive(each.start, each.track, each.controls, np.array([2.03]))
        routes.append(Route(state, each.track, controls_after(each.controls, 2.03), each.offset))
    before = [each.start.to_bytes() for each in routes]
    found = np.stack([columns(each) for each in engine.along(routes, TIMES)])
    assert_same_bits(found, alone(engine, routes, TIMES))
    assert [each.start.to_bytes() for each in routes] == before


def test_none_are_none(engine: Engine):
    assert engine.along([], TIMES) == []
    assert engine.ways_along([], TIMES).shape == (0, len(TIMES))


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=60)
def test_no_number_leads_out_of_bounds(engines: list[Engine], seed: int):
    """As `test_hostile` says of one rover; what is not finite stays in its own row."""
    rng, count = np.random.default_rng(seed), 9
    routes = routes_of(engines[0], rng, count, braked=False)
    wanted = alone(engines[0], routes, TIMES)
    spoilt = int(rng.integers(count))
    state = routes[spoilt].start.numbers.copy()
    slopes, distances = routes[spoilt].track.slope_rad.copy(), routes[spoilt].track.distance_m.copy()
    torques = routes[spoilt].controls.torque_nm.copy()
    for array in (state[2:], slopes, distances, torques):
        if rng.random() < 0.5:
            array.flat[rng.integers(0, array.size)] = rng.choice(WILD)
    compiled = (CompiledRoute * count)()
    for each, at in zip(routes, compiled, strict=True):
        at.start, at.offset = address(each.start.numbers), each.offset
        at.track, at.controls = addressof(each.track.compiled()), addressof(each.controls.compiled())
    track, controls = routes[spoilt].track.compiled(), routes[spoilt].controls.compiled()
    track = type(track)(track.count, address(distances), address(slopes))
    controls = type(controls)(controls.count, controls.time_s, address(torques), controls.brake)
    wild = compiled[spoilt]
    wild.start, wild.track, wild.controls = address(state), addressof(track), addressof(controls)
    others = np.setdiff1d(np.arange(count), [spoilt])
    for engine in engines:
        outputs = np.empty((6, count, len(TIMES)))
        rows = addressof(compiled), len(TIMES), address(TIMES), 6, address(outputs)
        library().rover_drives(engine._address, count, *rows)
        assert_same_bits(np.ascontiguousarray(outputs[:, others]), wanted[others].transpose(1, 0, 2))
