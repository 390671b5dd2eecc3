"""A small drive model for tests: of three synthetic runs and one that brakes. A second or two."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

from service.learning.drive.fit import FittedDrive, fit_drive
from service.learning.observed import Controls, ObservedRun
from service.physics.priors import make_prior
from tests.learning.synthetic import synthetic_run

PRIOR = make_prior("motor_slope", 0.3)


def few_runs() -> list[ObservedRun]:
    runs = [synthetic_run(slope) for slope in (5, 12, 20)]
    braked = replace(synthetic_run(10), name="braked", controls=Controls(brake=runs[0].time_s > 3.0))
    return [*runs, braked]


@cache
def small_fit() -> FittedDrive:
    return fit_drive(few_runs(), PRIOR)
