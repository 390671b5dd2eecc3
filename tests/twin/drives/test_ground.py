"""The ground under a drive: worlds that follow it, elevations that become slopes."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.errors import InvalidValueError
from service.physics.frames import slope_to_world
from service.twin import Frame
from service.twin.drives import DriveQuestion, Ground, Wanted, controls_of, drive
from tests.twin.drives.made import champion, grounds


@given(slope=st.floats(-45, 45), x=st.lists(st.floats(-50, 50), min_size=1, max_size=9))
def test_the_world_of_a_constant_slope_is_the_slope_turned(slope, x):
    along, above = np.array(x), np.full(len(x), 0.23)
    for ground in (Ground.constant(slope), Ground.of_slopes([-3, 1, 7], [slope] * 3)):
        found, known = ground.world(along, above), slope_to_world(along, above, np.radians(slope))
        np.testing.assert_allclose(found, known, rtol=0, atol=1e-9)


@given(ground=grounds(45.0))
def test_the_world_is_the_integral_of_the_slope(ground):
    knots = np.concatenate([[-8.0], ground.distance_m[ground.distance_m > -8.0], [60.0]])
    places = np.unique(np.concatenate([[0.0], *(np.linspace(*ends, 2001) for ends in pairwise(knots))]))
    middle = np.radians(ground.slopes_at(0.5 * (places[1:] + places[:-1])))
    step = np.diff(places)
    across, up = (np.concatenate([[0.0], np.cumsum(part)]) for part in (step * np.cos(middle), step * np.sin(middle)))
    start = int(np.flatnonzero(places == 0.0)[0])
    found = ground.world(places, np.zeros(len(places)))

    np.testing.assert_allclose(found[0], across - across[start], rtol=0, atol=5e-7)
    np.testing.assert_allclose(found[1], up - up[start], rtol=0, atol=5e-7)


@given(ground=grounds(45.0), low=st.floats(-6, 6), length=st.floats(0, 20))
def test_the_steepest_slope_is_that_of_a_fine_look(ground, low, length):
    slope, place = ground.steepest(low, low + length)
    fine = np.abs(ground.slopes_at(np.linspace(low, low + length, 2001))).max()

    assert low <= place <= low + length
    assert ground.slopes_at(np.array([place]))[0] == pytest.approx(slope)
    assert abs(slope) >= fine - 1e-9


@given(slope=st.floats(-44, 44), places=st.lists(st.floats(-20, 30), min_size=2, max_size=9, unique=True))
def test_a_straight_ramp_is_a_constant_slope(slope, places):
    across = np.array(sorted(places))
    across = across[np.concatenate([[True], np.diff(across) > 1e-3])]
    if len(across) < 2:
        return
    ground = Ground.of_elevations(across, 5.0 + np.tan(np.radians(slope)) * across)

    np.testing.assert_allclose(ground.slope_deg, slope, rtol=0, atol=5e-7)
    np.testing.assert_allclose(
        ground.distance_m, 0.5 * (across[1:] + across[:-1]) / np.cos(np.radians(slope)), atol=1e-7
    )


def test_the_rounding_of_elevations_is_no_steeper_slope():
    ground = Ground.of_elevations([0.0, 1.0, 2.0], [0.0, 1.0000000001, 0.0], 45.0)

    assert ground.slope_deg.tolist() == [45.0, -45.0]
    with pytest.raises(InvalidValueError, match="45"):
        Ground.of_elevations([0.0, 1.0], [0.0, 1.0000001], 45.0)


@pytest.mark.parametrize("frame", Frame)
def test_a_drive_up_a_ramp_is_the_same_from_slopes_and_from_elevations(frame):
    across = np.array([-2.0, 1.0, 4.0, 11.0])
    slopes = Ground.of_slopes([0, 10], [18, 18])
    elevations = Ground.of_elevations(across, np.tan(np.radians(18)) * across)
    found = [
        drive(champion(), DriveQuestion(430, each, controls_of([0], [80])), Wanted(frame=frame))
        for each in (slopes, elevations)
    ]

    for name in found[0].position_names:
        np.testing.assert_allclose(found[0].trajectory[name], found[1].trajectory[name], rtol=0, atol=1e-9)


def test_the_world_of_elevations_follows_them():
    across = np.linspace(0.0, 12.0, 241)
    elevation = 0.8 * np.sin(across / 3.0) + 0.1 * across
    ground = Ground.of_elevations(across, elevation)
    x = np.linspace(0.2, 11.0, 100)
    found = ground.world(x, np.zeros(100))

    np.testing.assert_allclose(found[1], np.interp(found[0], across, elevation), atol=1e-3)


def test_horizontal_zero_is_where_the_rear_wheel_starts():
    behind = Ground.of_elevations([-4.0, 0.0, 4.0], [0.0, 0.0, 2.0])
    ahead = Ground.of_elevations([1.0, 3.0, 7.0], [0.0, 0.0, 2.0])

    np.testing.assert_allclose(behind.distance_m, [-2.0, np.hypot(4, 2) / 2])
    np.testing.assert_allclose(ahead.distance_m, [2.0, 3.0 + np.hypot(4, 2) / 2])


@pytest.mark.parametrize(
    ("make", "field"),
    [
        (lambda: Ground.of_slopes([], []), "track.distance_m"),
        (lambda: Ground.of_slopes([0, 1], [1]), "track.slope_deg"),
        (lambda: Ground.of_slopes([0, 0], [1, 1]), "track.distance_m"),
        (lambda: Ground.of_slopes([0, 2, 1], [1, 1, 1]), "track.distance_m"),
        (lambda: Ground.of_slopes([0, np.nan], [1, 1]), "track.distance_m"),
        (lambda: Ground.of_slopes([0, np.inf], [1, 1]), "track.distance_m"),
        (lambda: Ground.of_slopes([0, 1], [1, np.nan]), "track.slope_deg"),
        (lambda: Ground.of_slopes([0, 1], [1, 90]), "track.slope_deg"),
        (lambda: Ground.of_elevations([0], [1]), "track.horizontal_m"),
        (lambda: Ground.of_elevations([0, 1], [1]), "track.elevation_m"),
        (lambda: Ground.of_elevations([1, 0], [1, 1]), "track.horizontal_m"),
        (lambda: Ground.of_elevations([0, 1], [1, np.inf]), "track.elevation_m"),
        (lambda: Ground.of_elevations([0, 1, 2], [0, 0, 2], 45.0), "track.elevation_m"),
        (lambda: controls_of([], []), "controls.time_s"),
        (lambda: controls_of([0.5], [1]), "controls.time_s"),
        (lambda: controls_of([-1, 0], [1, 1]), "controls.time_s"),
        (lambda: controls_of([0, 2, 2], [1, 1, 1]), "controls.time_s"),
        (lambda: controls_of([0, 1], [1]), "controls.torque_nm"),
        (lambda: controls_of([0], [-1]), "controls.torque_nm"),
        (lambda: controls_of([0], [np.nan]), "controls.torque_nm"),
        (lambda: controls_of([0], [1], [True, False]), "controls.brake"),
        (lambda: DriveQuestion(0.0, Ground.constant(0), controls_of([0], [1])), "mass_kg"),
        (lambda: DriveQuestion(np.nan, Ground.constant(0), controls_of([0], [1])), "mass_kg"),
        (lambda: DriveQuestion(1, Ground.constant(0), controls_of([0], [1]), np.inf), "start_speed_m_s"),
        (lambda: DriveQuestion(1, Ground.constant(0), controls_of([0], [1]), horizon_s=1e9), "horizon_s"),
        (lambda: DriveQuestion(1, Ground.constant(0), controls_of([0], [1]), until_distance_m=-1), "until_distance_m"),
        (lambda: DriveQuestion(1, Ground.constant(0), controls_of([0], [1]), until_distance_m=0), "until_distance_m"),
    ],
)
def test_what_is_no_drive_is_refused_by_the_name_of_its_field(make, field):
    with pytest.raises(InvalidValueError) as refused:
        make()
    assert refused.value.field == field


def test_the_track_ends_where_the_last_elevation_is() -> None:
    fine = Ground.of_elevations([0, 5, 10], [0, 0.5, 1])
    coarse = Ground.of_elevations([0, 10], [0, 1])

    assert fine.end_m == pytest.approx(np.hypot(10, 1))
    assert coarse.end_m == pytest.approx(fine.end_m)
    assert Ground.of_slopes([0], [5]).end_m is None
