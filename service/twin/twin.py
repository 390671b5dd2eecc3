"""A twin: one version of a model in memory, answering scenarios."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from model_store import Manifest
from service.errors import InvalidValueError
from service.learning.band import Band
from service.learning.domain import Domain
from service.learning.model import TrajectoryModel
from service.physics.frames import slope_to_world
from service.physics.scenario import Array, Positions, Scenarios
from service.physics.wheel_speed import slip_ratio, wheel_speed_rad_s
from service.twin.prediction import Frame, NonFiniteError, Prediction, PredictionBand
from service.twin.scenario import Scenario
from service.twin.summary import LAST_PART, Summary, outcome_of


@dataclass(frozen=True, slots=True, eq=False)
class Twin:
    """Immutable once made, so that any number of threads may share it.

    `wheel_motion_resistance` calibrates how fast the wheels turn; None where no run recorded it. `band` is None where
    the version was published without one.
    """

    manifest: Manifest
    model: TrajectoryModel
    domain: Domain
    wheel_motion_resistance: float | None
    band: Band | None = None

    @property
    def name(self) -> str:
        """Name of the model."""
        return self.manifest.name

    @property
    def version(self) -> int:
        """Number of the version."""
        return self.manifest.version

    def predict(
        self, scenario: Scenario, time_s: Array, frame: Frame = Frame.SLOPE, band_level: float | None = None
    ) -> Prediction:
        """The trajectory at `time_s`, of shape (time,), which ends at the scenario's horizon.

        With a `band_level` it has a band: an interval for x and one for y. Turned into the world frame it would be
        neither, so it is offered in the slope frame only.

        Raises InvalidValueError for a band in the world frame, of a version without one or at a level that is not
        0.5 to 0.99, and NonFiniteError instead of answering with NaN or infinity.
        """
        if band_level is not None and frame is not Frame.SLOPE:
            raise InvalidValueError("frame", frame.value, "slope where a band is asked for: it bounds x and y there")
        physics = scenario.as_physics()
        with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused below
            # One more time, since the outcome must not depend on the sampling that was asked for.
            late_s = (1.0 - LAST_PART) * scenario.horizon_s
            times = np.append(time_s, late_s)
            with_late_prior = self.model.prior.positions(physics, times)
            with_late = self.model.corrected(with_late_prior, physics, times)
            prior, corrected = _but_last(with_late_prior), _but_last(with_late)
            summary = self._summarise(scenario, physics, corrected, late_x_m=float(with_late.x_m[0, -1]))
            band = None if band_level is None else self._band_around(corrected, physics, time_s, band_level)
        totals = np.array([summary.distance_m, summary.mean_speed_m_s])
        bounds = () if band is None else band.columns().values()
        numbers = (corrected.x_m, corrected.y_m, prior.x_m, prior.y_m, totals, *bounds)
        if not all(np.isfinite(each).all() for each in numbers):
            raise NonFiniteError(f"{self.name}@{self.version} has no finite answer for {scenario}")
        return Prediction(
            scenario=scenario,
            frame=frame,
            trajectory={"time_s": time_s, **_in_frame(corrected, physics, frame)},
            prior_name=self.model.prior.name,
            prior=_in_frame(prior, physics, frame),
            domain=self.domain.judge(scenario.slope_deg, scenario.mass_kg, scenario.torque_nm, scenario.horizon_s),
            summary=summary,
            band=band,
        )

    def half_widths(self, scenarios: Scenarios, time_s: Array, level: float) -> tuple[Array, Array]:
        """Half-widths (m) of the band in x and y, each of shape (scenario, time).

        Raises InvalidValueError for a version without a band or a level that is not 0.5 to 0.99.
        """
        if self.band is None:
            none = f"prior; {self.name}@{self.version} was published without a band"
            raise InvalidValueError("include", "band", none)
        reach = self.model.positions(scenarios, np.array([self.band.reach_time_s])).x_m[:, 0]
        return self.band.half_widths(scenarios, time_s, level, reach)

    def _band_around(self, positions: Positions, physics: Scenarios, time_s: Array, level: float) -> PredictionBand:
        (half_x,), (half_y,) = self.half_widths(physics, time_s, level)
        x, y = positions.x_m[0], positions.y_m[0]
        return PredictionBand(level, x - half_x, x + half_x, y - half_y, y + half_y)

    def _summarise(self, scenario: Scenario, physics: Scenarios, positions: Positions, late_x_m: float) -> Summary:
        """`late_x_m` is x where the last part of the horizon begins."""
        x, y = positions.x_m[0], positions.y_m[0]
        mean_speed = float(x[-1] - x[0]) / scenario.horizon_s
        return Summary(
            outcome=outcome_of((float(x[-1]) - late_x_m) / (LAST_PART * scenario.horizon_s)),
            final_x_m=float(x[-1]),
            final_y_m=float(y[-1]),
            distance_m=float(np.hypot(np.diff(x), np.diff(y)).sum()),
            mean_speed_m_s=mean_speed,
            slip_ratio=self._slip_ratio(physics, mean_speed),
        )

    def _slip_ratio(self, physics: Scenarios, mean_speed_m_s: float) -> float | None:
        if self.wheel_motion_resistance is None:
            return None
        prior = self.model.prior
        wheels = wheel_speed_rad_s(prior.rover, prior.regolith, self.wheel_motion_resistance, physics)
        return slip_ratio(prior.rover, mean_speed_m_s, float(wheels[0]))


def _but_last(positions: Positions) -> Positions:
    return Positions(positions.x_m[:, :-1], positions.y_m[:, :-1])


def _in_frame(positions: Positions, physics: Scenarios, frame: Frame) -> Mapping[str, Array]:
    """Positions of a batch of one as columns of the frame."""
    x, y = positions.x_m[0], positions.y_m[0]
    if frame is Frame.SLOPE:
        return {"x_m": x, "y_m": y}
    horizontal, up = slope_to_world(x, y, float(physics.slope_angle_rad[0]))
    return {"x_m": horizontal, "z_m": up}
