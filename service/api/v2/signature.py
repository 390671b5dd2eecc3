"""Which tensors go in and come out. One signature for all models: what differs is where each was trained."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from service.settings import LIMITS
from service.twin import Frame, PredictionBatch

DEFAULT_HORIZON_S = 10.0
DEFAULT_STEP_S = 0.05
INPUT_TYPES: dict[str, np.dtype[Any]] = {
    **{"FP64": np.dtype("<f8"), "FP32": np.dtype("<f4"), "FP16": np.dtype("<f2")},
    **{f"INT{bits}": np.dtype(f"<i{bits // 8}") for bits in (64, 32, 16, 8)},
    **{f"UINT{bits}": np.dtype(f"<u{bits // 8}") for bits in (64, 32, 16, 8)},
}
"""Datatypes of inputs; each value is taken as the float64 of the same value."""

Values = npt.NDArray[Any] | list[str]
_BOTH = frozenset(Frame)
_SLOPE = frozenset({Frame.SLOPE})
_WORLD = frozenset({Frame.WORLD})


@dataclass(frozen=True, slots=True)
class InputTensor:
    """One input of shape [scenario] or, as `time_s`, [time]; `required` or optional."""

    name: str
    unit: str
    lowest: float
    highest: float
    meaning: str
    required: bool = True


@dataclass(frozen=True, slots=True)
class OutputTensor:
    """One output. `usual` ones come when a request names none; `take` gives its values."""

    name: str
    datatype: str
    rank: int
    unit: str
    meaning: str
    take: Callable[[PredictionBatch], Values]
    usual: bool = False
    frames: frozenset[Frame] = _BOTH
    of_band: bool = False
    of_prior: bool = False
    of_speed: bool = False


INPUTS = {
    each.name: each
    for each in (
        InputTensor(
            "slope_deg", "deg", -LIMITS.slope_deg, LIMITS.slope_deg, "slope of the terrain, positive is uphill"
        ),
        InputTensor("mass_kg", "kg", *LIMITS.mass_kg, "mass of the rover"),
        InputTensor("torque_nm", "N m", *LIMITS.torque_nm, "stall torque of the motor of each wheel"),
        InputTensor("horizon_s", "s", *LIMITS.horizon_s, "how far to predict, one for all or one each", required=False),
        InputTensor("time_s", "s", 0.0, LIMITS.horizon_s[1], "times to answer at, rising; ends the horizon", False),
    )
}


def _position(name: str, frames: frozenset[Frame], meaning: str) -> tuple[OutputTensor, OutputTensor]:
    def of_prior(batch: PredictionBatch) -> Values:
        assert batch.prior is not None
        return batch.prior[name]

    return (
        OutputTensor(name, "FP64", 2, "m", meaning, lambda batch: batch.trajectory[name], usual=True, frames=frames),
        OutputTensor(
            f"prior_{name}",
            "FP64",
            2,
            "m",
            f"{meaning}, by the closed-form solution alone",
            of_prior,
            frames=frames,
            of_prior=True,
        ),
    )


def _bound(axis: str, side: str) -> OutputTensor:
    name = f"{axis}_{side}_m"

    def take(batch: PredictionBatch) -> Values:
        assert batch.band is not None
        return batch.band.columns()[name]

    return OutputTensor(name, "FP64", 2, "m", f"{side} edge of the band of {axis}_m", take, frames=_SLOPE, of_band=True)


_X, _PRIOR_X = _position("x_m", _BOTH, "position along the slope, in the world frame horizontally")
_Y, _PRIOR_Y = _position("y_m", _SLOPE, "position normal to the slope, slope frame")
_Z, _PRIOR_Z = _position("z_m", _WORLD, "position upwards, world frame")

OUTPUTS = {
    each.name: each
    for each in (
        OutputTensor(
            "time_s",
            "FP64",
            1,
            "s",
            "times of the positions; of shape [scenario, time] where horizons differ",
            lambda batch: batch.time_s,
            usual=True,
        ),
        _X,
        _Y,
        _Z,
        OutputTensor(
            "outcome",
            "BYTES",
            1,
            "",
            "climbs, stalls or slides",
            lambda batch: [each.value for each in batch.summaries.outcome],
            usual=True,
        ),
        OutputTensor(
            "inside_domain",
            "BOOL",
            1,
            "",
            "whether training runs are near the scenario",
            lambda batch: batch.domain.inside,
            usual=True,
        ),
        _PRIOR_X,
        _PRIOR_Y,
        _PRIOR_Z,
        *(_bound(axis, side) for axis in "xy" for side in ("lower", "upper")),
        OutputTensor(
            "speed_m_s",
            "FP64",
            2,
            "m/s",
            "speed along the slope in both frames, positive uphill",
            lambda batch: batch.trajectory["speed_m_s"],
            of_speed=True,
        ),
        OutputTensor(
            "sample_count",
            "INT64",
            1,
            "",
            "how many samples a scenario has; what follows repeats its last one",
            lambda batch: batch.counts.astype("<i8", copy=False),
        ),
    )
}
