from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.physics.frames import slope_to_world, world_to_slope

lengths = st.lists(st.floats(-1000, 1000), min_size=1, max_size=6).map(np.array)
angles = st.floats(-1.5, 1.5)


@given(lengths, angles, st.floats(-10, 10))
def test_there_and_back(x, angle, y):
    back = world_to_slope(*slope_to_world(x, np.full_like(x, y), angle), angle)
    np.testing.assert_allclose(back[0], x, atol=1e-9)
    np.testing.assert_allclose(back[1], y, atol=1e-9)


@given(lengths, angles, st.floats(-10, 10))
def test_distances_are_kept(x, angle, y):
    horizontal, up = slope_to_world(x, np.full_like(x, y), angle)
    np.testing.assert_allclose(np.hypot(horizontal, up), np.hypot(x, y), rtol=1e-9, atol=1e-12)


def test_uphill_is_up():
    horizontal, up = slope_to_world(np.array([2.0]), np.array([0.0]), np.radians(30))
    assert horizontal[0] == pytest.approx(np.sqrt(3))
    assert up[0] == pytest.approx(1.0)


def test_normal_leans_downhill():
    horizontal, up = slope_to_world(np.array([0.0]), np.array([1.0]), np.radians(30))
    assert horizontal[0] == pytest.approx(-0.5)
    assert up[0] == pytest.approx(np.sqrt(3) / 2)
