"""The compiled engine and the plain reference are one law."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings

from service.learning.drive.engine import Engine
from service.learning.drive.reference import Reference
from tests.learning.drive.drives import Drive, drives


@given(drives())
@settings(max_examples=25)
def test_both_drive_alike(engine: Engine, drive: Drive):
    times = np.sort(np.concatenate([np.linspace(0.0, drive.horizon_s, 60), drive.controls.time_s]))
    motion, _ = engine.drive(engine.start(drive.mass_kg, drive.start_speed_m_s), drive.track, drive.controls, times)
    reference = Reference(engine.law, drive.mass_kg)
    found = reference.drive(drive.start_speed_m_s, drive.track, drive.controls, times)
    # The engine stops its search for the rims' speeds at steps of 1e-6 m/s, the reference goes on to the end.
    np.testing.assert_allclose(motion.x_m, found[0], rtol=0, atol=1e-7)
    np.testing.assert_allclose(motion.speed_m_s, found[1], rtol=0, atol=1e-6)
    np.testing.assert_allclose(motion.y_m, found[2], rtol=0, atol=1e-7)
