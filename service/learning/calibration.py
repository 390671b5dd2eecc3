"""Calibrating what the physics leaves open, by least squares on runs: one coefficient each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from service.learning.observed import ObservedRun, require_constant
from service.physics.parameters import RegolithParameters, RoverParameters
from service.physics.prior import Prior
from service.physics.wheel_speed import motion_resistance_at

P = TypeVar("P", bound=Prior)


def calibrate_prior(prior: P, runs: Sequence[ObservedRun]) -> P:
    """The prior with the coefficient that brings x closest to the runs, in least squares, each run weighing the same.

    Positions are affine in the coefficient, x(c) = x(0) + c b, so that c = <x_run - x(0), b> / <b, b>.
    Raises ValueError without runs, TrainingError for runs whose slope, torque or brake change.
    """
    if not runs:
        raise ValueError("a prior cannot be calibrated without runs")
    require_constant(runs)
    without, unit = prior.with_coefficient(0.0), prior.with_coefficient(1.0)
    numerator = denominator = 0.0
    for run in runs:
        start = without.positions(run.scenario, run.time_s).x_m[0]
        effect = unit.positions(run.scenario, run.time_s).x_m[0] - start
        numerator += float(np.mean((run.x_m - start) * effect))
        denominator += float(np.mean(effect**2))
    return prior.with_coefficient(numerator / denominator)


def calibrate_wheel_resistance(
    rover: RoverParameters, regolith: RegolithParameters, runs: Sequence[ObservedRun]
) -> float | None:
    """The motion-resistance coefficient of `service.physics.wheel_speed`: median over the runs that say how the wheels
    turned while the motor law was in its linear range; None where none says so.

    The median, since runs that slide back or stall make single values meaningless. Runs whose slope, torque or brake
    change have no one speed of their wheels and do not count.
    """
    values = [
        motion_resistance_at(rover, regolith, run.scenario, run.mean_wheel_speed_rad_s)
        for run in runs
        if not run.varies and run.mean_wheel_speed_rad_s is not None and run.mean_wheel_speed_rad_s > 0
    ]
    return float(np.median(values)) if values else None
