"""Steeper never gets further: how often a model breaks that, and whether it does so for sure."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from service.learning.domain import Domain
from service.learning.doubt.doubt import Doubt
from service.learning.doubt.meeting import OffsetModel
from service.physics.scenario import Array, Scenarios

Flags = npt.NDArray[np.bool_]

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
    found = [_column(model, doubt, domain, slopes, float(mass), float(torque)) for mass in masses for torque in torques]
    counted, gained, sure = (np.array(each) for each in zip(*found, strict=True))  # (column, step)
    further = counted & (gained > ALLOWED_M)
    where = slopes[1:][further.any(axis=0)]
    steps = int(counted.sum())
    return {
        "steps": steps,
        "further": int(further.sum()),
        "share": float(further.sum()) / steps if steps else 0.0,
        "sure": int(sure.sum()),
        "columns": int(counted.any(axis=1).sum()),
        "columns_with_one": int(further.any(axis=1).sum()),
        "between_deg": [float(where[0]) - STEP_DEG, float(where[-1])] if len(where) else None,
        "most_m": float(gained[further].max()) if len(where) else 0.0,
        "step_deg": STEP_DEG,
        "allowed_m": ALLOWED_M,
    }


def _column(
    model: OffsetModel, doubt: Doubt, domain: Domain, slopes: Array, mass_kg: float, torque_nm: float
) -> tuple[Flags, Array, Flags]:
    """Of each step between two slopes: that both are inside, how much further it gets (m), that it surely does."""
    mass, torque = np.full(len(slopes), mass_kg), np.full(len(slopes), torque_nm)
    inside = domain.judge_many(slopes, mass, torque, np.full(len(slopes), HORIZON_S)).inside
    counts, scenarios = inside[1:] & inside[:-1], Scenarios(np.radians(slopes), mass, torque)
    centre = model.positions(scenarios, np.array([HORIZON_S]))
    gained = np.diff(centre.x_m[:, 0])
    further = counts & (gained > ALLOWED_M)
    if not further.any():
        return counts, gained, further
    seen = model.positions(scenarios, doubt.look_s).x_m
    edges = doubt.edges(model, scenarios, np.array([HORIZON_S]), LEVEL, centre, seen)
    return counts, gained, further & (edges.x_low_m[1:, 0] > edges.x_high_m[:-1, 0])
