"""Steeper never gets further: how often a model breaks that, and whether it does so for sure."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from service.learning.domain import Domain
from service.learning.doubt.doubt import Doubt
from service.learning.doubt.meeting import OffsetModel
from service.physics.scenario import Array, Scenarios

STEP_DEG, ALLOWED_M, HORIZON_S, LEVEL = 0.25, 0.01, 10.0, 0.9
_MASSES, _TORQUES = 9, 13


def measure_steeper(model: OffsetModel, doubt: Doubt, domain: Domain) -> dict[str, Any]:
    """Over columns of one mass and torque inside the domain, as JSON values: steps of a quarter degree after which a
    rover gets more than a centimetre further, and those of them where the bands of both slopes do not overlap.
    """
    masses = np.unique(np.linspace(*domain.spans["mass_kg"], _MASSES))
    torques = np.unique(np.linspace(*domain.spans["torque_nm"], _TORQUES))
    low, high = domain.spans["slope_deg"]
    slopes = np.arange(max(low, 0.0), high + 1e-9, STEP_DEG)
    steps = further = sure = columns = broken = 0
    for mass in masses:
        for torque in torques:
            found = _column(model, doubt, domain, slopes, float(mass), float(torque))
            steps += int(found[0].sum())
            further += int(found[1].sum())
            sure += int(found[2].sum())
            columns += int(found[0].any())
            broken += int(found[1].any())
    share = further / steps if steps else 0.0
    return {
        "steps": steps,
        "further": further,
        "share": share,
        "sure": sure,
        "columns": columns,
        "columns_with_one": broken,
        "step_deg": STEP_DEG,
        "allowed_m": ALLOWED_M,
    }


def _column(
    model: OffsetModel, doubt: Doubt, domain: Domain, slopes: Array, mass_kg: float, torque_nm: float
) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
    """Of each step between two slopes: that both are inside, that it gets further, that it surely does."""
    mass, torque = np.full(len(slopes), mass_kg), np.full(len(slopes), torque_nm)
    inside = domain.judge_many(slopes, mass, torque, np.full(len(slopes), HORIZON_S)).inside
    counts = inside[1:] & inside[:-1]
    if not counts.any():
        return counts, counts, counts
    scenarios, times = Scenarios(np.radians(slopes), mass, torque), np.array([HORIZON_S])
    centre = model.positions(scenarios, times)
    x = centre.x_m[:, 0]
    further = counts & (x[1:] - x[:-1] > ALLOWED_M)
    if not further.any():
        return counts, further, further
    seen = model.positions(scenarios, doubt.look_s).x_m
    edges = doubt.edges(model, scenarios, times, LEVEL, centre, seen)
    return counts, further, further & (edges.x_low_m[1:, 0] > edges.x_high_m[:-1, 0])
