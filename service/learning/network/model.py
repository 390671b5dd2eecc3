"""Prior plus residual: the formula of the paper's equation (3), for many scenarios and times at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from service.learning.network.corrections import Correction
from service.learning.network.inputs import InputSignature
from service.learning.trajectory_model import motion_by_difference
from service.physics.prior import Prior
from service.physics.scenario import Array, Motion, Positions, Scenarios


@dataclass(frozen=True, slots=True)
class PhysicsInformedModel:
    """x_corr = x_phys + dx, y_corr = y_phys + dy (IAC-23-A3.IP.204, eq. 3), in float64.

    Immutable and safe to share by threads. Torch trains what gives dx and dy (`Residual.correction`).
    """

    prior: Prior
    signature: InputSignature
    correction: Correction

    quick: ClassVar[bool] = False
    knows_wheel_speeds: ClassVar[bool] = False

    def __post_init__(self) -> None:
        if self.correction.input_count != len(self.signature.inputs):
            raise ValueError(
                f"the residual takes {self.correction.input_count} inputs, the signature names "
                f"{len(self.signature.inputs)}"
            )

    def positions(self, scenarios: Scenarios, time_s: Array) -> Positions:
        """Corrected positions (m), shape (scenario, time), at `time_s` of shape (time,) or (scenario, time)."""
        prior = self.prior.positions(scenarios, time_s)
        correction = self.corrections(scenarios, time_s)
        return Positions(prior.x_m + correction.x_m, prior.y_m + correction.y_m)

    def motion(self, scenarios: Scenarios, time_s: Array) -> Motion:
        """The same positions with their speeds; the wheels' are not known."""
        return motion_by_difference(self.positions, scenarios, time_s)

    def corrections(self, scenarios: Scenarios, time_s: Array) -> Positions:
        """What the residual adds (m), shape (scenario, time)."""
        times = np.broadcast_to(self.signature.time_column(time_s), (len(scenarios), time_s.shape[-1]))
        x, y = self.correction.metres(self.signature.scenario_columns(scenarios), times)
        return Positions(x, y)
