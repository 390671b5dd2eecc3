"""Random drives, as hypothesis draws them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from hypothesis import strategies as st

from service.learning.drive.inputs import Controls, Track
from service.physics.scenario import Array


@dataclass(frozen=True)
class Drive:
    mass_kg: float
    start_speed_m_s: float
    track: Track
    controls: Controls
    horizon_s: float


@st.composite
def drives(draw: st.DrawFn, steepest_deg: float = 32.0, horizon_s: float = 8.0) -> Drive:
    """Climbs, slides, stops and goes on, runs downhill: tracks of up to six knots, controls of up to four parts."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    knots = rng.integers(1, 7)
    low = draw(st.sampled_from([-steepest_deg, 0.0, 15.0]))
    slopes = rng.uniform(low, steepest_deg, knots)
    parts = rng.integers(1, 5)
    times = np.concatenate([[0.0], np.sort(rng.uniform(0.1, horizon_s, parts - 1))])
    torques = rng.choice([0.0, 30.0, 60.0, 90.0, 130.0], parts)
    return Drive(
        float(rng.uniform(300, 900)),
        float(rng.choice([0.0, 0.0, -0.1, 0.4])),
        Track(np.concatenate([[0.0], np.cumsum(rng.uniform(0.3, 2.0, knots - 1))]), np.radians(slopes)),
        Controls(times, torques, rng.random(parts) < 0.2),
        horizon_s,
    )


def controls_after(controls: Controls, time_s: float) -> Controls:
    """Those that remain, counted from that time on."""
    last = max(int(np.searchsorted(controls.time_s, time_s + 1e-10, side="right")) - 1, 0)
    brake: Array = np.asarray(controls.brake)
    return Controls(np.maximum(controls.time_s[last:] - time_s, 0.0), controls.torque_nm[last:], brake[last:])
