"""Segments keep what the run did."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.learning.observed import ObservedRun
from service.learning.resistance.segments import segments_of
from service.physics.scenario import Scenarios


def _run(speed: float, horizon_s: float = 6.0, step_s: float = 0.005) -> ObservedRun:
    time = np.arange(round(horizon_s / step_s) + 1) * step_s
    return ObservedRun("r", "unit", Scenarios.of(10, 430, 60), time, 3.0 + speed * time, 0.24 - 0.001 * time)


@given(st.floats(-0.7, 0.7))
def test_steady_motion_is_steady_in_every_segment(speed: float):
    segments = segments_of(_run(speed))
    assert segments.duration_s.sum() == pytest.approx(6.0, abs=1e-9)
    np.testing.assert_allclose(segments.speed_m_s, speed, atol=1e-9)
    np.testing.assert_allclose(segments.speed_change_m_s, 0.0, atol=1e-9)
    np.testing.assert_allclose(segments.height_m, 0.24 - 0.001 * segments.time_s, atol=1e-9)
    assert segments.start_speed_m_s == pytest.approx(speed, abs=1e-9)


def test_segments_add_up_to_the_run(paper_runs: list[ObservedRun]):
    for run in paper_runs:
        segments = segments_of(run)
        assert (segments.duration_s > 0).all()
        travelled = float(segments.speed_m_s @ segments.duration_s)
        assert travelled == pytest.approx(run.x_m[-1] - run.x_m[0], abs=1e-9)
        assert len(segments.time_s) < 100


def test_a_glimpse_is_no_run():
    with pytest.raises(ValueError, match="lasts"):
        segments_of(_run(0.1, horizon_s=0.05))
