"""Many curves are read as numpy.interp reads one."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from service.learning.curves import interpolate_curves, interpolate_each


@given(st.integers(1, 40), st.integers(1, 5), st.integers(1, 30), st.integers(0, 2**32 - 1))
def test_each_curve_is_read_like_one_alone(points, curves, asked, seed):
    rng = np.random.default_rng(seed)
    grid = np.cumsum(rng.uniform(0.01, 1.0, points))
    values = rng.normal(size=(curves, points))
    places = np.concatenate([rng.uniform(-1.0, grid[-1] + 1.0, asked), grid])
    expected = np.stack([np.interp(places, grid, curve) for curve in values])

    np.testing.assert_array_equal(interpolate_curves(places, grid, values), expected)
    shifts = np.arange(curves)[:, None] * 0.1
    apart = [np.interp(places + shift, grid, curve) for shift, curve in zip(shifts, values, strict=True)]
    np.testing.assert_array_equal(interpolate_curves(places + shifts, grid, values), apart)
    moved = interpolate_each(places + shifts, grid + shifts, values)
    np.testing.assert_allclose(moved, expected, rtol=0, atol=1e-9)
