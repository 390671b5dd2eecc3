"""A small prediction that proves a twin can answer, on the path that requests take."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from service.twin.scenario import Scenario
from service.twin.twin import Twin

_PROBE = Scenario(slope_deg=10.0, mass_kg=430.0, torque_nm=60.0, horizon_s=1.0)
_PROBE_TIMES_S = np.array([0.0, 0.5, 1.0])


@dataclass(frozen=True, slots=True)
class Probed:
    """Where the rover of the probe ends (m), and how long the prediction took (s)."""

    final_x_m: float
    took_s: float


def probe(twin: Twin) -> Probed:
    """One prediction. Raises what `Twin.predict` raises."""
    began = time.perf_counter()
    batch = twin.predict_many((_PROBE,), _PROBE_TIMES_S)
    return Probed(batch[0].summary.final_x_m, time.perf_counter() - began)
