"""What holds of every drive: against predictions, against itself sampled otherwise, against energy and the clock."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from service.errors import InvalidValueError
from service.twin import Frame, Outcome, Scenario, sample_times
from service.twin.drives import DriveOutcome, DriveQuestion, EventName, Ground, Wanted, controls_of, drive
from tests.twin.drives.made import champion, questions

NAMES = {
    Outcome.CLIMBS: DriveOutcome.PASSES,
    Outcome.STALLS: DriveOutcome.STICKS,
    Outcome.SLIDES: DriveOutcome.SLIDES,
}
GRAVITY = 1.62


def level(slope: float, mass: float, torque: float, horizon: float, **more: object) -> DriveQuestion:
    return DriveQuestion(mass, Ground.constant(slope), controls_of([0], [torque]), horizon_s=horizon, **more)


@settings(max_examples=25)
@given(
    slope=st.floats(-25, 33),
    mass=st.floats(300, 900),
    torque=st.floats(0, 130),
    horizon=st.sampled_from([0.7, 10.0, 20.0, 33.3]),
    frame=st.sampled_from(Frame),
)
def test_a_constant_drive_is_a_prediction(slope, mass, torque, horizon, frame):
    twin = champion()
    wanted = Wanted(frame=frame, wheel_speed=True)
    found = drive(twin, level(slope, mass, torque, horizon), wanted)
    scenario = Scenario(slope, mass, torque, horizon)
    known = twin.predict(scenario, sample_times(horizon, 0.05), frame, with_speed=True, with_wheel_speed=True)

    for name, column in known.trajectory.items():
        np.testing.assert_allclose(found.trajectory[name], column, rtol=0, atol=1e-9, err_msg=name)
    assert found.summary.final_x_m == pytest.approx(known.summary.final_x_m, abs=1e-9)
    assert found.summary.final_y_m == pytest.approx(known.summary.final_y_m, abs=1e-9)
    assert found.summary.mean_speed_m_s == pytest.approx(known.summary.mean_speed_m_s, abs=1e-9)
    assert found.summary.distance_m == pytest.approx(known.summary.distance_m, rel=1e-3, abs=1e-3)
    assert found.domain.inside == known.domain.inside


@pytest.mark.parametrize("scenario", [(10, 430, 60), (28, 430, 60), (33, 430, 30), (-10, 500, 20)])
def test_a_constant_drive_ends_as_a_prediction_does(scenario):
    found = drive(champion(), level(*scenario, 10.0), Wanted())
    known = champion().predict(Scenario(*scenario, 10.0), np.array([0.0, 10.0]))

    assert found.summary.outcome is NAMES[known.summary.outcome]


@settings(max_examples=40)
@given(question=questions(), dt=st.sampled_from([0.013, 0.2, 7.0]))
def test_the_sampling_changes_neither_summary_nor_events(question, dt):
    usual, other = (drive(champion(), question, Wanted(dt_s=step)) for step in (0.05, dt))
    end = question.horizon_s
    times = np.array([0.0, 0.31 * end, 0.77 * end, end])
    few = drive(champion(), question, Wanted(times_s=times))

    assert usual.summary == other.summary == few.summary
    assert usual.events == other.events == few.events
    assert usual.domain == other.domain == few.domain


@settings(max_examples=40)
@given(question=questions())
def test_the_points_at_shared_times_are_the_same(question):
    fine, coarse = (drive(champion(), question, Wanted(dt_s=step)).trajectory for step in (0.1, 0.2))
    shared = np.flatnonzero(np.isin(fine["time_s"], coarse["time_s"]))
    kept = np.flatnonzero(np.isin(coarse["time_s"], fine["time_s"]))

    for name, column in fine.items():
        np.testing.assert_allclose(column[shared], coarse[name][kept], rtol=0, atol=1e-9, err_msg=name)


@settings(max_examples=40)
@given(question=questions())
def test_motors_give_at_least_what_height_and_speed_gain(question):
    found = drive(champion(), question, Wanted(dt_s=0.01)).trajectory
    x, speed, sine = found["x_m"], found["speed_m_s"], np.sin(np.radians(found["slope_deg"]))
    potential = question.mass_kg * GRAVITY * float((0.5 * (sine[1:] + sine[:-1]) * np.diff(x)).sum())
    kinetic = 0.5 * question.mass_kg * float(speed[-1] ** 2 - speed[0] ** 2)
    energy = drive(champion(), question, Wanted()).summary.motor_energy_j

    assert energy >= potential + kinetic - max(2.0, 0.01 * abs(energy))


@settings(max_examples=40)
@given(question=questions())
def test_the_energy_is_that_of_a_finer_sum(question):
    found = drive(champion(), question, Wanted(dt_s=0.002, wheel_speed=True))
    columns, no_load = found.trajectory, champion().model.prior.rover.no_load_speed_rad_s
    power = np.zeros(len(columns["time_s"]))
    for name in ("rear_wheel_speed_rad_s", "front_wheel_speed_rad_s"):
        wheel = columns[name]
        power += 2.0 * columns["torque_nm"] * np.clip(1.0 - wheel / no_load, 0.0, 1.0) * wheel
    fine = float((power[1:] * np.diff(columns["time_s"])).sum())

    assert found.summary.motor_energy_j == pytest.approx(fine, rel=0.02, abs=5.0)


@settings(max_examples=60)
@given(question=questions(), place=st.floats(0.05, 12.0))
def test_who_arrives_is_there_at_the_last_time(question, place):
    found = drive(champion(), replace(question, until_distance_m=place), Wanted(dt_s=0.1))
    free = drive(champion(), replace(question, until_distance_m=None), Wanted(dt_s=0.1))
    time, x = found.trajectory["time_s"], found.trajectory["x_m"]
    arrived = found.summary.arrival_time_s

    if arrived is None:
        assert free.trajectory["x_m"].max() < place
        np.testing.assert_allclose(x, free.trajectory["x_m"], rtol=0, atol=1e-9)
        assert EventName.ARRIVES not in [each.event for each in found.events]
        return
    assert arrived == time[-1] == found.summary.duration_s <= question.horizon_s
    assert x[-1] == pytest.approx(place, abs=1e-9)
    assert (x[:-1] < place).all()
    np.testing.assert_allclose(x[:-1], free.trajectory["x_m"][: len(x) - 1], rtol=0, atol=1e-9)
    last = found.events[-1]
    assert (last.event, last.time_s, last.x_m) == (EventName.ARRIVES, arrived, pytest.approx(place, abs=1e-9))


def test_an_arrival_has_an_interval_around_it_that_grows_with_the_level():
    asked = replace(level(15, 430, 60, 60), until_distance_m=8.0)
    narrow, wide = (drive(champion(), asked, Wanted(band_level=each)).summary for each in (0.5, 0.99))

    assert wide.arrival_earliest_s < narrow.arrival_earliest_s < narrow.arrival_time_s
    assert narrow.arrival_time_s < narrow.arrival_latest_s < wide.arrival_latest_s
    assert narrow.arrival_time_s == wide.arrival_time_s


def test_who_does_not_arrive_says_so():
    found = drive(champion(), replace(level(33, 600, 40, 20), until_distance_m=8.0), Wanted()).summary

    assert (found.arrival_time_s, found.arrival_latest_s) == (None, None)
    assert found.duration_s == 20.0


@settings(max_examples=25)
@given(question=questions())
def test_the_band_holds_the_trajectory_and_grows_with_the_level(question):
    found = [drive(champion(), question, Wanted(band=True, band_level=each)) for each in (0.5, 0.9, 0.99)]
    x = found[0].trajectory["x_m"]

    for inner, outer in pairwise(found):
        assert (outer.band.x_lower_m <= inner.band.x_lower_m).all()
        assert (outer.band.x_upper_m >= inner.band.x_upper_m).all()
    assert (found[0].band.x_lower_m <= x).all()
    assert (x <= found[0].band.x_upper_m).all()


def test_a_band_neither_falls_faster_than_freely_nor_outruns_idling_motors():
    found = drive(champion(), level(30, 430, 0, 2.0, start_speed_m_s=0.0), Wanted(band=True, band_level=0.99))
    time, band = found.trajectory["time_s"], found.band
    fall = 0.5 * GRAVITY * np.sin(np.radians(30)) * time**2

    assert (band.x_lower_m >= np.minimum(-fall, found.trajectory["x_m"]) - 1e-12).all()
    assert (band.x_upper_m <= 0.25 * np.pi * time + 1e-12).all()


@settings(max_examples=40)
@given(question=questions())
def test_outcomes_are_probable(question):
    chances = drive(champion(), question, Wanted()).summary.probabilities
    each = [chances.passes, chances.sticks, chances.slides]

    assert sum(each) == pytest.approx(1.0)
    assert min(each) > 0


@settings(max_examples=40)
@given(question=questions())
def test_stretches_cover_the_way_without_gaps(question):
    found = drive(champion(), question, Wanted(dt_s=1.0))
    stretches = found.domain.stretches

    assert stretches[0].from_s == 0.0
    assert stretches[-1].to_s == pytest.approx(found.summary.duration_s)
    assert stretches[-1].to_m == pytest.approx(found.summary.final_x_m)
    for one, then in pairwise(stretches):
        assert (one.to_s, one.to_m) == (then.from_s, then.from_m)
        assert [reason.field for reason in one.reasons] != [reason.field for reason in then.reasons]
    assert found.domain.inside == all(each.inside for each in stretches)
    for stretch in stretches:
        assert all(not reason.lowest <= reason.value <= reason.highest for reason in stretch.reasons)


def test_a_steep_part_of_a_track_is_a_stretch_outside():
    ground = Ground.of_slopes([0, 3, 3.5, 4.5, 5], [15, 15, 36, 36, 15])
    found = drive(champion(), DriveQuestion(430, ground, controls_of([0], [100])), Wanted()).domain

    assert [each.inside for each in found.stretches][:2] == [True, False]
    assert "slope_deg" in [reason.field for reason in found.stretches[1].reasons]
    assert 2.0 < found.stretches[1].from_m < 3.0
    steepest = next(reason for reason in found.verdict().reasons if reason.field == "slope_deg")
    assert 32.0 < steepest.value <= 36.0


def test_longer_than_any_run_is_outside_from_then_on():
    found = drive(champion(), level(10, 430, 60, 40), Wanted()).domain

    assert [each.inside for each in found.stretches] == [True, False]
    assert found.stretches[1].from_s == pytest.approx(champion().settled_horizon_s, abs=0.06)


def test_only_a_version_with_the_drive_model_drives():
    other = replace(champion(), model=champion().model.prior)

    with pytest.raises(InvalidValueError) as refused:
        drive(other, level(10, 430, 60, 5), Wanted())
    assert refused.value.field == "model"
