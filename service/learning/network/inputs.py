"""Input signature: which quantities a residual sees, in which order and scaling. Stored beside the weights."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from service.physics.parameters import RegolithParameters, RoverParameters
from service.physics.scenario import Array, Scenarios
from service.physics.similarity import torque_ratio

_Column = Callable[[Scenarios, RoverParameters, RegolithParameters], Array]


# Everything a residual may be given besides the time. A checkpoint names its inputs from this table.
_SCENARIO_COLUMNS: dict[str, tuple[str, _Column]] = {
    "slope_deg": ("deg", lambda scenarios, _rover, _regolith: np.degrees(scenarios.slope_angle_rad)),
    "mass_kg": ("kg", lambda scenarios, _rover, _regolith: scenarios.mass_kg),
    "torque_nm": ("N m", lambda scenarios, _rover, _regolith: scenarios.torque_nm),
    "torque_ratio": ("1", lambda scenarios, rover, regolith: torque_ratio(rover, regolith, scenarios)),
}
TIME = "time_s"
INPUT_NAMES = (TIME, *_SCENARIO_COLUMNS)


@dataclass(frozen=True, slots=True)
class Input:
    """One input of a residual; the network sees (value - centre) / scale."""

    name: str
    centre: float
    scale: float

    def __post_init__(self) -> None:
        if self.name not in INPUT_NAMES:
            raise ValueError(f"input is {self.name!r}, allowed is one of {', '.join(INPUT_NAMES)}")
        if not (np.isfinite(self.centre) and np.isfinite(self.scale) and self.scale > 0):
            raise ValueError(f"input {self.name} needs a finite centre and a positive scale")

    @property
    def unit(self) -> str:
        """Unit of the value before scaling."""
        return "s" if self.name == TIME else _SCENARIO_COLUMNS[self.name][0]


@dataclass(frozen=True, slots=True)
class InputSignature:
    """The inputs in the order of the network's first layer; the time is always the first."""

    inputs: tuple[Input, ...]
    rover: RoverParameters
    regolith: RegolithParameters

    def __post_init__(self) -> None:
        names = [each.name for each in self.inputs]
        if not names or names[0] != TIME or len(set(names)) != len(names):
            raise ValueError(f"inputs must begin with {TIME} and not repeat, got {names}")

    @classmethod
    def fitted(
        cls,
        names: Sequence[str],
        scenarios: Scenarios,
        horizon_s: float,
        rover: RoverParameters,
        regolith: RegolithParameters,
    ) -> Self:
        """Scaling that maps the time over the horizon to -1..1 and each scenario input to the same range.

        An input that never varies among the scenarios keeps its own size as scale, so that it maps to 0.
        """
        inputs = [Input(TIME, horizon_s / 2, horizon_s / 2)]
        for name in names[1:] if names and names[0] == TIME else names:
            if name not in _SCENARIO_COLUMNS:
                raise ValueError(f"input is {name!r}, allowed is one of {', '.join(INPUT_NAMES)}")
            column = _SCENARIO_COLUMNS[name][1](scenarios, rover, regolith)
            lowest, highest = float(column.min()), float(column.max())
            half = (highest - lowest) / 2
            inputs.append(Input(name, (lowest + highest) / 2, half if half > 0 else max(abs(highest), 1.0)))
        return cls(tuple(inputs), rover, regolith)

    def scenario_columns(self, scenarios: Scenarios) -> Array:
        """Scaled inputs but for the time; shape (scenario, input - 1)."""
        columns = [
            (_SCENARIO_COLUMNS[each.name][1](scenarios, self.rover, self.regolith) - each.centre) / each.scale
            for each in self.inputs[1:]
        ]
        return np.stack(columns, axis=-1) if columns else np.empty((len(scenarios), 0))

    def time_column(self, time_s: Array) -> Array:
        """Scaled time; the shape of `time_s`."""
        return (time_s - self.inputs[0].centre) / self.inputs[0].scale

    def describe(self) -> list[dict[str, Any]]:
        """The signature as JSON values, in order."""
        return [
            {"name": each.name, "unit": each.unit, "centre": each.centre, "scale": each.scale} for each in self.inputs
        ]

    @classmethod
    def restore(
        cls, description: Sequence[Mapping[str, Any]], rover: RoverParameters, regolith: RegolithParameters
    ) -> Self:
        """Inverse of `describe`. Raises ValueError or KeyError for a description that does not fit."""
        inputs = tuple(Input(str(each["name"]), float(each["centre"]), float(each["scale"])) for each in description)
        return cls(inputs, rover, regolith)
