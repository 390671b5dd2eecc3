"""Scenarios and priors for property tests."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from service.physics.scenario import Scenarios

slopes_deg = st.floats(-45, 45)
masses_kg = st.floats(50, 5000)
torques_nm = st.floats(0, 500)
coefficients = st.floats(-0.5, 1.5)
scenario = st.builds(Scenarios.of, slopes_deg, masses_kg, torques_nm)
scenarios = st.lists(scenario, min_size=1, max_size=5).map(Scenarios.stack)
times = st.lists(st.floats(0, 60), min_size=1, max_size=8).map(lambda values: np.array(sorted(values)))
