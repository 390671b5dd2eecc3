"""Values refuse nonsense when made."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from service.physics.parameters import LUNAR_REGOLITH, VIPER
from service.physics.scenario import Scenarios


@pytest.mark.parametrize(
    ("field", "value"),
    [("wheel_radius_m", 0.0), ("wheel_radius_m", np.nan), ("wheelbase_m", -1.0), ("wheels", 0)],
)
def test_impossible_rovers_are_refused(field, value):
    with pytest.raises(ValueError, match=field):
        replace(VIPER, **{field: value})


def test_a_centre_of_mass_beyond_the_front_axle_is_refused():
    with pytest.raises(ValueError, match="between the axles"):
        replace(VIPER, centre_of_mass_ahead_of_rear_axle_m=2.0)


@pytest.mark.parametrize(
    ("field", "value"), [("gravity_m_s2", 0.0), ("cohesion_pa", -1.0), ("friction_angle_rad", 2.0)]
)
def test_impossible_soils_are_refused(field, value):
    with pytest.raises(ValueError, match=field):
        replace(LUNAR_REGOLITH, **{field: value})


@pytest.mark.parametrize(
    ("slope", "mass", "torque", "named"),
    [(np.nan, 430, 60, "slope"), (20, 0, 60, "mass_kg"), (20, 430, -1, "torque_nm"), (20, np.inf, 60, "mass_kg")],
)
def test_impossible_scenarios_are_refused(slope, mass, torque, named):
    with pytest.raises(ValueError, match=named):
        Scenarios.of(slope, mass, torque)


def test_columns_of_different_lengths_are_refused():
    with pytest.raises(ValueError, match="same length"):
        Scenarios(np.zeros(2), np.ones(1), np.ones(1))
