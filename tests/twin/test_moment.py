"""What is said of a moment holds for any speeds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.twin.moment import MOVES_M_S, moves, slip_ratio, slip_ratios

RADIUS_M = 0.25
speeds = st.floats(-1e6, 1e6)


def one(speed: float, rear: float, front: float) -> float:
    return float(slip_ratios(RADIUS_M, np.array([speed]), np.array([rear]), np.array([front]))[0])


@given(speeds, speeds, speeds)
def test_the_slip_ratio_is_finite_and_between_minus_two_and_two(speed, rear, front):
    assert -2.0 <= one(speed, rear, front) <= 2.0


@given(speeds, speeds, speeds)
def test_one_is_as_many(speed, rear, front):
    assert slip_ratio(RADIUS_M, speed, rear, front) == one(speed, rear, front)


@given(st.floats(0.01, 10.0), st.floats(0.01, 40.0), st.floats(0.01, 40.0))
def test_a_driving_rover_slips_by_one_minus_speed_over_rim_speed(speed, rear, front):
    rim = RADIUS_M * (rear + front) / 2
    if speed <= rim:
        assert one(speed, rear, front) == pytest.approx(1.0 - speed / rim, abs=1e-12)


@given(speeds, speeds, speeds)
def test_mirrored_motion_slips_the_other_way(speed, rear, front):
    assert one(-speed, -rear, -front) == -one(speed, rear, front)


def test_corner_cases():
    assert one(0.0, 0.0, 0.0) == 0.0
    assert one(1e-10, 1e-9, 1e-9) == 0.0
    assert one(0.0, 2.0, 2.0) == 1.0  # spins on the spot
    assert one(-0.5, 2.0, 2.0) == 2.0  # and goes back as fast
    assert one(-0.5, 0.0, 0.0) == 1.0  # braked, slides back
    assert one(0.5, 0.0, 0.0) == -1.0  # braked, slides on
    assert one(0.5, 2.0, 2.0) == 0.0  # rolls


@given(st.floats(-10, 10))
def test_what_moves_has_a_millimetre_per_second_at_least(speed):
    assert bool(moves(np.array([speed]))[0]) == (abs(speed) >= MOVES_M_S)


def test_shapes_are_kept():
    ones = np.ones((2, 3))
    assert slip_ratios(RADIUS_M, ones, ones, ones).shape == moves(ones).shape == (2, 3)
