"""Which tensors go in and come out. One signature for all models: what differs is where each was trained."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from service.physics.scenario import Array
from service.settings import LIMITS
from service.twin import Frame, Prediction, PredictionBatch
from service.twin.summary import Outcome

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


@dataclass(frozen=True, slots=True, eq=False)
class Answered:
    """What was predicted, as outputs are taken from it: columns (scenario, time), `time_s` (time,) where it is shared.

    `counts` and `inside` have shape (scenario,), `outside` is how many are outside. Prior and band are None unless
    asked for.
    """

    time_s: Array
    counts: npt.NDArray[np.intp]
    trajectory: Mapping[str, Array]
    prior: Mapping[str, Array] | None
    band: Mapping[str, Array] | None
    outcomes: tuple[Outcome, ...]
    inside: npt.NDArray[np.bool_]
    outside: int

    @classmethod
    def of_one(cls, found: Prediction) -> Self:
        """One prediction; its arrays are views of those there."""
        time_s = found.trajectory["time_s"]
        return cls(
            time_s,
            np.array([len(time_s)], dtype=np.intp),
            _rows(found.trajectory),
            None if found.prior is None else _rows(found.prior),
            None if found.band is None else _rows(found.band.columns()),
            (found.summary.outcome,),
            np.array([found.domain.inside]),
            int(not found.domain.inside),
        )

    @classmethod
    def of_many(cls, found: PredictionBatch) -> Self:
        """Many predictions."""
        band = None if found.band is None else found.band.columns()
        outcomes, inside = found.summaries.outcome, found.domain.inside
        outside = len(inside) - int(inside.sum())
        return cls(found.time_s, found.counts, found.trajectory, found.prior, band, outcomes, inside, outside)


def _rows(columns: Mapping[str, Array]) -> dict[str, Array]:
    return {name: column[np.newaxis] for name, column in columns.items()}


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
    take: Callable[[Answered], Values]
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
REQUIRED = tuple(each.name for each in INPUTS.values() if each.required)
"""Names of the inputs that each request has."""


def _position(name: str, frames: frozenset[Frame], meaning: str) -> tuple[OutputTensor, OutputTensor]:
    def of_prior(answered: Answered) -> Values:
        assert answered.prior is not None
        return answered.prior[name]

    return (
        OutputTensor(name, "FP64", 2, "m", meaning, lambda found: found.trajectory[name], usual=True, frames=frames),
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

    def take(answered: Answered) -> Values:
        assert answered.band is not None
        return answered.band[name]

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
            lambda found: found.time_s,
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
            lambda found: [str(each) for each in found.outcomes],
            usual=True,
        ),
        OutputTensor(
            "inside_domain",
            "BOOL",
            1,
            "",
            "whether training runs are near the scenario",
            lambda found: found.inside,
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
            lambda found: found.trajectory["speed_m_s"],
            of_speed=True,
        ),
        OutputTensor(
            "sample_count",
            "INT64",
            1,
            "",
            "how many samples a scenario has; what follows repeats its last one",
            lambda found: found.counts.astype("<i8", copy=False),
        ),
    )
}
