"""Rovers moved on step by step: the engine's motion whatever the pieces, and states that go on anywhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from model_store import ModelStore
from service.errors import InvalidValueError
from service.learning.drive.inputs import Controls, Track
from service.settings import Settings
from service.twin import Scenario
from service.twin.load import load_twin
from service.twin.moment import moves, slip_ratios
from service.twin.steps import STATE_SIZE, Live, StateError, Stepper

CELL_S = 0.1  # a multiple of the engine's cells of time, before and after 0.3 s


def steps(live: Live, count: int, **told):
    for _ in range(count):
        found = live.step("a", **told)
    return found


@given(
    slope_deg=st.floats(-25, 32),
    torque_nm=st.floats(0, 130),
    mass_kg=st.floats(300, 900),
    pieces=st.lists(st.floats(0.001, 1.5), min_size=1, max_size=12),
)
def test_pieces_end_where_one_go_ends(twin, slope_deg, torque_nm, mass_kg, pieces):
    live = Live(twin)
    live.start("a", mass_kg=mass_kg, slope_deg=slope_deg)
    for dt in pieces:
        found = live.step("a", slope_deg=slope_deg, torque_nm=torque_nm, dt_s=dt)

    slope = float(np.radians(slope_deg))
    start = twin.model.start(mass_kg, slope)
    until = np.array([sum(pieces)])
    motion, _ = twin.model.engine.drive(start, Track.constant(slope), Controls.constant(torque_nm), until)
    assert found.time_s[0] == pytest.approx(until[0], abs=1e-9)
    assert found.x_m[0] == pytest.approx(motion.x_m[0], abs=1e-9)
    assert found.y_m[0] == pytest.approx(motion.y_m[0], abs=1e-9)
    assert found.speed_m_s[0] == pytest.approx(motion.speed_m_s[0], abs=1e-9)


@given(st.floats(-20, 30), st.floats(20, 120), st.lists(st.booleans(), min_size=5, max_size=40))
def test_controls_that_change_are_those_of_one_drive(twin, slope_deg, torque_nm, brakes):
    live, slope = Live(twin), float(np.radians(slope_deg))
    live.start("a", mass_kg=430, slope_deg=slope_deg)
    for brake in brakes:
        found = live.step("a", slope_deg=slope_deg, torque_nm=torque_nm, brake=brake, dt_s=CELL_S)

    times = CELL_S * np.arange(len(brakes))
    controls = Controls(times, np.full(len(brakes), torque_nm), np.array(brakes))
    end = np.array([CELL_S * len(brakes)])
    motion, _ = twin.model.engine.drive(twin.model.start(430, slope), Track.constant(slope), controls, end)
    assert found.x_m[0] == pytest.approx(motion.x_m[0], abs=1e-9)
    assert found.speed_m_s[0] == pytest.approx(motion.speed_m_s[0], abs=1e-9)


def test_pieces_that_end_with_the_engines_cells_change_no_bit(twin):
    once, often = Live(twin), Live(twin)
    for live in (once, often):
        live.start("a", mass_kg=430, slope_deg=20)
    one = once.step("a", slope_deg=20, torque_nm=60, dt_s=0.5)
    many = steps(often, 5, slope_deg=20, torque_nm=60, dt_s=CELL_S)

    assert one.x_m[0] == pytest.approx(many.x_m[0], abs=1e-12)
    assert one.speed_m_s[0] == pytest.approx(many.speed_m_s[0], abs=1e-12)


def test_a_rover_moves_as_it_would_alone(twin):
    rng, count = np.random.default_rng(0), 50
    ids = [f"r{n}" for n in range(count)]
    mass, slope, torque = rng.uniform(300, 900, count), rng.uniform(-20, 30, count), rng.uniform(0, 120, count)
    brake, dt = rng.random(count) < 0.2, rng.uniform(0.01, 1.2, count)
    together = Live(twin)
    together.start(ids, mass_kg=mass, slope_deg=slope)
    alone = [Live(twin) for _ in ids]
    for each, name, kg, deg in zip(alone, ids, mass, slope, strict=True):
        each.start(name, mass_kg=kg, slope_deg=deg)
    for _ in range(4):
        all_of_them = together.step(ids, slope_deg=slope, torque_nm=torque, brake=brake, dt_s=dt)
    for at, (each, name) in enumerate(zip(alone, ids, strict=True)):
        for _ in range(4):
            one = each.step(name, slope_deg=slope[at], torque_nm=torque[at], brake=bool(brake[at]), dt_s=dt[at])
        for column in ("x_m", "y_m", "speed_m_s", "rear_wheel_speed_rad_s", "front_wheel_speed_rad_s", "time_s"):
            assert getattr(one, column)[0] == getattr(all_of_them, column)[at], column
        assert one.x_half_width_m[0] == pytest.approx(all_of_them.x_half_width_m[at], rel=1e-9)
        assert one.outside_of[0] == all_of_them.outside_of[at]
        assert one.slip_ratio[0] == all_of_them.slip_ratio[at]


@given(st.integers(0, 30), st.floats(-20, 30), st.floats(0, 120))
def test_a_state_goes_on_at_another_server_to_the_bit(twin, other_instance, before, slope_deg, torque_nm):
    here, there = Live(twin), Live(other_instance)
    here.start("a", mass_kg=550, slope_deg=slope_deg)
    steps(here, before, slope_deg=slope_deg, torque_nm=torque_nm, dt_s=0.037) if before else None

    there.restore(here.states())

    told = {"slope_deg": slope_deg + 1, "torque_nm": torque_nm, "dt_s": 0.013}
    one, other = steps(here, 5, **told), steps(there, 5, **told)
    assert one.x_m[0] == other.x_m[0]
    assert one.x_half_width_m[0] == other.x_half_width_m[0]
    assert here.states() == there.states()


@given(st.floats(-45, 45), st.floats(50, 2000), st.floats(0, 300))
def test_one_place_is_as_far_from_the_runs_as_many_are(twin, slope_deg, mass_kg, torque_nm):
    near = twin.domain.neighbourhood
    many = near.least_distances(near.places_of(*np.array([[slope_deg], [mass_kg], [torque_nm]])))
    assert near.least_distance(slope_deg, mass_kg, torque_nm) == pytest.approx(many[0], rel=1e-9, abs=1e-7)


def test_what_is_said_of_a_moment_is_what_drives_say(twin):
    live = Live(twin)
    live.start("a", mass_kg=430, slope_deg=20)
    found = steps(live, 20, slope_deg=20, torque_nm=60, dt_s=0.1)
    radius = twin.model.prior.rover.wheel_radius_m
    speeds = found.speed_m_s, found.rear_wheel_speed_rad_s, found.front_wheel_speed_rad_s

    assert found.slip_ratio[0] == slip_ratios(radius, *speeds)[0]
    assert found.moving[0] == moves(found.speed_m_s)[0]


@given(st.floats(-45, 45), st.floats(50, 2000), st.floats(0, 300), st.booleans(), st.floats(0.001, 40), st.booleans())
def test_the_domain_is_that_of_the_version(twin, slope_deg, mass_kg, torque_nm, brake, dt, several):
    ids = ["a", "b"] if several else ["a"]
    live = Live(twin)
    live.start(ids, mass_kg=mass_kg, slope_deg=slope_deg)
    found = live.step(ids, slope_deg=slope_deg, torque_nm=torque_nm, brake=brake, dt_s=dt)
    verdict = twin.domain.judge(slope_deg, mass_kg, torque_nm, float(found.time_s[0]))
    expected = [each.field for each in verdict.reasons]
    if brake:
        expected = [each for each in expected if each not in ("torque_nm", "torque_ratio", "joint")]
    assert all(each == expected for each in found.outside_of)


def test_half_widths_grow_and_are_about_those_of_the_band(twin):
    live = Live(twin)
    live.start("a", mass_kg=430, slope_deg=15)
    widths = [float(steps(live, 10, slope_deg=15, torque_nm=70, dt_s=0.1).x_half_width_m[0]) for _ in range(10)]

    assert 0 < widths[0] < widths[-1]
    band = twin.predict(Scenario(15, 430, 70, 10), np.array([0.0, 10.0]), band_level=0.9).band
    whole = 0.5 * float(band.x_upper_m[-1] - band.x_lower_m[-1])
    assert whole / 2.5 < widths[-1] < 2.5 * whole


def test_half_widths_hardly_depend_on_the_pieces(twin):
    ends = []
    for dt, count in ((0.02, 500), (0.1, 100), (0.5, 20), (10.0, 1)):
        live = Live(twin)
        live.start("a", mass_kg=430, slope_deg=20)
        ends.append(float(steps(live, count, slope_deg=20, torque_nm=60, dt_s=dt).x_half_width_m[0]))
    assert max(ends) < 1.1 * min(ends), ends


def test_a_version_without_doubt_has_no_half_width(twin):
    live = Live(replace(twin, band=None))
    live.start(["a", "b"], mass_kg=430, slope_deg=20)
    assert np.isnan(live.step(["a", "b"], slope_deg=20, torque_nm=60, dt_s=0.1).x_half_width_m).all()


def test_rovers_come_and_go(twin):
    live = Live(twin)
    live.start([f"r{n}" for n in range(40)], mass_kg=430, slope_deg=10)
    before = live.states("r7")
    live.remove([f"r{n}" for n in range(0, 40, 2)])
    assert len(live) == 20
    assert "r7" in live
    assert "r8" not in live
    live.start(["x", "y"], mass_kg=500, slope_deg=0)
    live.step(["x", "y"], slope_deg=[0, 5], torque_nm=40, dt_s=[0.1, 0.2])
    assert live.states("r7") == before
    assert live.ids[-2:] == ["x", "y"]
    with pytest.raises(KeyError):
        live.step("r8", slope_deg=0, torque_nm=0, dt_s=0.1)


def test_a_rover_that_is_started_twice_at_once_is_one(twin):
    live = Live(twin)
    live.start(["a", "a"], mass_kg=[430, 550], slope_deg=20)
    live.start("b", mass_kg=700, slope_deg=20)
    assert len(live) == 2
    assert live.stepper.masses_kg(live._states[live._rows_of(["a", "b"])]).tolist() == [550, 700]


def test_starting_again_starts_anew(twin):
    live = Live(twin)
    live.start("a", mass_kg=430, slope_deg=20)
    fresh = live.states()
    steps(live, 3, slope_deg=20, torque_nm=60, dt_s=0.1)
    live.start("a", mass_kg=430, slope_deg=20)
    assert live.states() == fresh


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("slope_deg", 90.0),
        ("slope_deg", np.nan),
        ("torque_nm", -1.0),
        ("torque_nm", np.inf),
        ("dt_s", 0.0),
        ("dt_s", 1e9),
        ("dt_s", np.nan),
        ("torque_nm", [1.0, 2.0]),
    ],
)
def test_numbers_that_cannot_be_are_refused_by_name_and_nothing_moves(twin, field, value):
    live = Live(twin)
    live.start("a", mass_kg=430, slope_deg=20)
    before = live.states()
    with pytest.raises(InvalidValueError, match=field):
        live.step("a", **({"slope_deg": 20, "torque_nm": 60, "dt_s": 0.1} | {field: value}))
    assert live.states() == before


@pytest.mark.parametrize(("field", "value"), [("mass_kg", 0.0), ("mass_kg", np.nan), ("start_speed_m_s", np.inf)])
def test_starts_that_cannot_be_are_refused(twin, field, value):
    live = Live(twin)
    with pytest.raises(InvalidValueError, match=field):
        live.start("a", **({"mass_kg": 430.0, "slope_deg": 0.0} | {field: value}))
    assert not len(live)


def test_a_rover_moves_once_in_a_call(twin):
    live = Live(twin)
    live.start("a", mass_kg=430, slope_deg=0)
    with pytest.raises(InvalidValueError, match="ids"):
        live.step(["a", "a"], slope_deg=0, torque_nm=0, dt_s=0.1)


def test_a_version_that_knows_no_steps_says_so():
    network = load_twin(ModelStore.open(Settings().store_url), "viper-lunar-paper", 1)
    with pytest.raises(InvalidValueError, match="drive_model"):
        Live(network)


def test_states_of_others_are_refused_and_nothing_changes(twin):
    live = Live(twin)
    live.start(["a", "b"], mass_kg=430, slope_deg=20)
    states, before = live.states(), live.states()
    older = replace(twin, manifest=twin.manifest.model_copy(update={"version": 4}))
    foreign = Live(older)
    foreign.start("c", mass_kg=430, slope_deg=20)
    for wrong in (foreign.states()["c"], states["a"][:-9], b"", states["a"] + b"\0", b"rubbish" * 200):
        with pytest.raises(StateError, match="state of c"):
            live.restore({"b": states["a"], "c": wrong})
        assert live.states() == before


def test_numbers_of_another_law_or_of_no_rover_are_refused(twin):
    stepper = Stepper(twin)
    state = stepper.start(np.array([430.0]), np.array([20.0]), np.array([np.nan]))
    assert stepper.wrong(state) == {}
    assert state.shape == (1, STATE_SIZE)
    for at, value, said in ((1, 5.0, "another version"), (2, -1.0, "not those"), (40, np.nan, "not those")):
        forged = state.copy()
        forged[0, at] = value
        assert said in str(stepper.wrong(forged)[0])
    assert "start anew" in str(stepper.wrong(state[:, :-1])[0])


@given(
    st.lists(st.tuples(st.integers(2, STATE_SIZE - 1), st.floats(allow_nan=False, allow_infinity=False)), max_size=8)
)
def test_forged_numbers_are_moved_on_without_harm(twin, forged):
    stepper = Stepper(twin)
    state = stepper.start(np.array([430.0]), np.array([20.0]), np.array([0.1]))
    for at, value in forged:
        state[0, at] = value
    if not stepper.wrong(state):
        one = np.ones(1)
        found = stepper.advance(state, 20 * one, 60 * one, one < 0, 0.5 * one)
        assert found.finite is None or found.finite.shape == (1,)


@given(
    slope_deg=st.floats(-10, 24),
    torque_nm=st.floats(60, 130),
    mass_kg=st.floats(320, 880),
    parts=st.sampled_from([2, 4, 5, 20, 40, 80, 100, 200]),
)
def test_how_sure_a_position_is_does_not_depend_on_the_steps(twin, slope_deg, torque_nm, mass_kg, parts):
    def half_width(parts):
        live = Live(twin)
        live.start("a", mass_kg=mass_kg, slope_deg=slope_deg)
        for seconds, brake in ((4.0, False), (2.0, True), (4.0, False)):
            for _ in range(parts):
                found = live.step("a", slope_deg=slope_deg, torque_nm=torque_nm, brake=brake, dt_s=seconds / parts)
        return float(found.x_half_width_m[0])

    assert half_width(parts) == pytest.approx(half_width(1), rel=0.25)


@pytest.mark.parametrize("brake", ["false", 1, [0]])
def test_a_brake_is_on_or_off(twin, brake):
    live = Live(twin)
    live.start("a", mass_kg=430, slope_deg=5)
    with pytest.raises(InvalidValueError, match="brake"):
        live.step("a", slope_deg=5, torque_nm=60, dt_s=0.1, brake=brake)


def test_times_so_late_that_they_have_no_fractions_end(twin):
    live = Live(twin)
    live.start("a", mass_kg=430, slope_deg=5)
    live._states[0, 3] = 1e300  # forged: the number `time_s` of the engine's state

    live.step("a", slope_deg=5, torque_nm=60, dt_s=60.0)
