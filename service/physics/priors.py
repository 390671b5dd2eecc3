"""The closed table of priors, and their form in a checkpoint."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from service.physics.motor_slope import MotorSlope
from service.physics.parameters import LUNAR_REGOLITH, VIPER, RegolithParameters, RoverParameters
from service.physics.prior import Prior
from service.physics.rigid_slope import RigidSlope

_PRIORS: dict[str, type[RigidSlope] | type[MotorSlope]] = {
    RigidSlope.name: RigidSlope,
    MotorSlope.name: MotorSlope,
}
PRIOR_NAMES = tuple(_PRIORS)
DEFAULT_COEFFICIENTS: Mapping[str, float] = {RigidSlope.name: -0.14, MotorSlope.name: 0.34}
"""What a prior keeps where no run calibrates it, dimensionless: what the shipped sets paper, mass and space give."""


def make_prior(
    name: str,
    coefficient: float = 0.0,
    rover: RoverParameters = VIPER,
    regolith: RegolithParameters = LUNAR_REGOLITH,
) -> Prior:
    """The prior of that name. Raises ValueError for a name that is not in the table."""
    if name not in _PRIORS:
        raise ValueError(f"prior is {name!r}, allowed is one of {', '.join(PRIOR_NAMES)}")
    return _PRIORS[name](rover, regolith, coefficient)


def describe_prior(prior: Prior) -> dict[str, Any]:
    """The prior as JSON values: its name, coefficient and every rover and regolith parameter."""
    return {
        "name": prior.name,
        prior.coefficient_name: prior.coefficient,
        "rover": asdict(prior.rover),
        "regolith": asdict(prior.regolith),
    }


def restore_prior(description: Mapping[str, Any]) -> Prior:
    """Inverse of `describe_prior`. Raises ValueError, KeyError or TypeError for a description that does not fit."""
    name = description["name"]
    template = make_prior(name)
    return make_prior(
        name,
        float(description[template.coefficient_name]),
        RoverParameters(**description["rover"]),
        RegolithParameters(**description["regolith"]),
    )
