"""A model that knows how fast its wheels turn, in closed form."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from service.physics.prior import Prior
from service.physics.scenario import Array, Motion, Positions, Scenarios
from service.twin import Twin


@dataclass(frozen=True)
class Rolling:
    """Speeds up evenly, 1 m/s2 less for every 45 deg; the rear wheels turn 1.5 times, the front wheels 1.25 times as
    fast as they roll, and not at all where there is no torque.
    """

    prior: Prior
    quick: ClassVar[bool] = True
    knows_wheel_speeds: ClassVar[bool] = True

    def positions(self, scenarios: Scenarios, time_s: Array) -> Positions:
        return self.motion(scenarios, time_s)

    def motion(self, scenarios: Scenarios, time_s: Array) -> Motion:
        pull = 0.1 - scenarios.slope_angle_rad[:, None] / (np.pi / 4)
        speed = pull * time_s
        rolling = np.abs(speed) / self.prior.rover.wheel_radius_m * (scenarios.torque_nm[:, None] > 0)
        height = np.full(speed.shape, self.prior.rover.wheel_radius_m)
        return Motion(0.5 * speed * time_s, height, speed, 1.5 * rolling, 1.25 * rolling)


def rolling(twin: Twin) -> Twin:
    """The same twin with that model, and without a doubt: that is of a model with a force balance."""
    band = None if twin.doubt else twin.band
    return replace(twin, model=Rolling(twin.model.prior), band=band)
