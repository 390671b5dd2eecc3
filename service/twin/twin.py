"""A twin: one version of a model in memory, answering scenarios."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from model_store import Manifest
from service.errors import InvalidValueError
from service.learning.band import Band
from service.learning.domain import Domain, DomainVerdict
from service.learning.trajectory_model import TrajectoryModel
from service.physics.frames import slope_to_world
from service.physics.scenario import Array, Positions, Scenarios
from service.physics.wheel_speed import slip_ratio, wheel_speed_rad_s
from service.twin.batch import PredictionBatch, as_physics
from service.twin.prediction import Frame, NonFiniteError, OutsideDomainError, Prediction, PredictionBand
from service.twin.scenario import Scenario
from service.twin.summary import LAST_PART, Summaries, outcomes_of


@dataclass(frozen=True, slots=True, eq=False)
class _Core:
    """What one or many predictions are made of; members as those of `PredictionBatch`."""

    positions: Mapping[str, Array]
    prior: Mapping[str, Array] | None
    summaries: Summaries
    band: PredictionBand | None


@dataclass(frozen=True, slots=True, eq=False)
class Twin:
    """Immutable once made, so that any number of threads may share it.

    `fingerprint` tells the version from all that were ever published, those of the same name and number too.

    `wheel_motion_resistance` calibrates how fast the wheels turn; None where no run recorded it. `band` is None where
    the version was published without one.
    """

    manifest: Manifest
    model: TrajectoryModel
    domain: Domain
    wheel_motion_resistance: float | None
    band: Band | None = None
    fingerprint: str = field(init=False, repr=False)

    def __post_init__(self) -> None:
        manifest = self.manifest
        files = ",".join(each.sha256 for each in manifest.files.values())
        text = f"{manifest.name}@{manifest.version} {manifest.created_at.isoformat()} {files}"
        object.__setattr__(self, "fingerprint", text)

    @property
    def name(self) -> str:
        """Name of the model."""
        return self.manifest.name

    @property
    def version(self) -> int:
        """Number of the version."""
        return self.manifest.version

    def predict(
        self,
        scenario: Scenario,
        time_s: Array,
        frame: Frame = Frame.SLOPE,
        band_level: float | None = None,
        *,
        with_prior: bool = False,
    ) -> Prediction:
        """The trajectory at `time_s`, of shape (time,), rising, which ends at the scenario's horizon.

        With a `band_level` it has a band: an interval for x and one for y. Turned into the world frame it would be
        neither, so it is offered in the slope frame only. `with_prior` adds the prior's positions.

        Raises InvalidValueError for a band in the world frame, of a version without one or at a level that is not
        0.5 to 0.99, and NonFiniteError instead of answering with NaN or infinity.
        """
        physics, horizons = scenario.as_physics(), np.array([scenario.horizon_s])
        _own_samples(time_s, horizons)
        core = self._predicted((scenario,), physics, horizons, time_s, frame, band_level, with_prior)
        return Prediction(
            scenario=scenario,
            frame=frame,
            trajectory={"time_s": time_s, **_first_row(core.positions)},
            prior_name=self.model.prior.name,
            prior=None if core.prior is None else _first_row(core.prior),
            domain=self.domain.judge(scenario.slope_deg, scenario.mass_kg, scenario.torque_nm, scenario.horizon_s),
            summary=core.summaries[0],
            band=None if core.band is None else PredictionBand(core.band.level, **_first_row(core.band.columns())),
        )

    def predict_many(
        self,
        scenarios: Sequence[Scenario],
        time_s: Array,
        frame: Frame = Frame.SLOPE,
        band_level: float | None = None,
        *,
        with_prior: bool = False,
    ) -> PredictionBatch:
        """`predict` for many scenarios at once: the same answers, but for rounding, much faster than one by one.

        `time_s`, as from `sample_grid`, has shape (time,) or (scenario, time); every row ends at its scenario's
        horizon, and shorter ones repeat it. Raises what `predict` does, for the first scenario without a finite
        answer, and ValueError for times that do not fit the scenarios or for no scenarios.
        """
        horizons = np.array([scenario.horizon_s for scenario in scenarios], dtype=np.float64)
        counts = _own_samples(time_s, horizons)
        physics = as_physics(scenarios)
        core = self._predicted(scenarios, physics, horizons, time_s, frame, band_level, with_prior)
        slopes = np.array([scenario.slope_deg for scenario in scenarios])
        return PredictionBatch(
            scenarios=tuple(scenarios),
            frame=frame,
            time_s=time_s,
            counts=counts,
            positions=core.positions,
            prior_name=self.model.prior.name,
            prior=core.prior,
            domain=self.domain.judge_many(slopes, physics.mass_kg, physics.torque_nm, horizons),
            summaries=core.summaries,
            band=core.band,
        )

    def _predicted(
        self,
        scenarios: Sequence[Scenario],
        physics: Scenarios,
        horizons_s: Array,
        time_s: Array,
        frame: Frame,
        band_level: float | None,
        with_prior: bool,
    ) -> _Core:
        if band_level is not None and frame is not Frame.SLOPE:
            raise InvalidValueError("frame", frame.value, "slope where a band is asked for: it bounds x and y there")
        extra = [(1.0 - LAST_PART) * horizons_s]  # the outcome must not depend on the sampling that was asked for
        if starts_later := bool(time_s[..., 0].any()):
            extra.insert(0, np.zeros(len(horizons_s)))  # nor must the way until the first sample be forgotten
        if band_level is not None:
            extra += [np.full(len(horizons_s), look) for look in self._known_band().look_s]
        with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused below
            found = self.model.positions(physics, _with_times(time_s, extra))
            corrected, x_beyond = _without_last(found, len(extra)), found.x_m[:, -len(extra) :]
            prior = self.model.prior.positions(physics, time_s) if with_prior else None
            whole = _with_start(corrected, _last(found, len(extra))) if starts_later else corrected
            summaries = self._summarise(physics, horizons_s, whole, late_x_m=x_beyond[:, int(starts_later)])
            band = None
            if band_level is not None:
                seen = x_beyond[:, -len(self._known_band().look_s) :]
                band = self._band_around(corrected, physics, time_s, band_level, seen)
        self._require_finite(scenarios, prior, summaries, band)
        return _Core(
            positions=_in_frame(corrected, physics, frame),
            prior=None if prior is None else _in_frame(prior, physics, frame),
            summaries=summaries,
            band=band,
        )

    def outside(self, verdict: DomainVerdict) -> OutsideDomainError:
        """What to tell a client that asked to be strict of a scenario with this verdict."""
        return OutsideDomainError(f"{self.name}@{self.version}", verdict)

    def half_widths(self, scenarios: Scenarios, time_s: Array, level: float) -> tuple[Array, Array]:
        """Half-widths (m) of the band in x and y, each of shape (scenario, time).

        Raises InvalidValueError for a version without a band or a level that is not 0.5 to 0.99.
        """
        band = self._known_band()
        return band.half_widths(scenarios, time_s, level, self.model.positions(scenarios, band.look_s).x_m)

    def slip_ratios(self, scenarios: Scenarios, mean_speeds_m_s: Array) -> tuple[float | None, ...]:
        """Of each scenario at its mean speed, shape (scenario,); None where the wheels stand still or nobody knows."""
        if self.wheel_motion_resistance is None:
            return (None,) * len(scenarios)
        rover, regolith = self.model.prior.rover, self.model.prior.regolith
        wheels = wheel_speed_rad_s(rover, regolith, self.wheel_motion_resistance, scenarios)
        both = zip(mean_speeds_m_s.tolist(), wheels.tolist(), strict=True)
        return tuple(slip_ratio(rover, speed, wheel) for speed, wheel in both)

    def _known_band(self) -> Band:
        if self.band is None:
            none = f"prior; {self.name}@{self.version} was published without a band"
            raise InvalidValueError("include", "band", none)
        return self.band

    def _band_around(
        self, positions: Positions, physics: Scenarios, time_s: Array, level: float, seen_m: Array
    ) -> PredictionBand:
        half_x, half_y = self._known_band().half_widths(physics, time_s, level, seen_m)
        x, y = positions.x_m, positions.y_m
        return PredictionBand(level, x - half_x, x + half_x, y - half_y, y + half_y)

    def _summarise(self, physics: Scenarios, horizons_s: Array, positions: Positions, late_x_m: Array) -> Summaries:
        """`positions` begin at rest; `late_x_m` (scenario,) is x where the last part of the horizon begins."""
        x, y = positions.x_m, positions.y_m
        mean_speed = (x[:, -1] - x[:, 0]) / horizons_s
        return Summaries(
            outcome=outcomes_of((x[:, -1] - late_x_m) / (LAST_PART * horizons_s)),
            final_x_m=x[:, -1],
            final_y_m=y[:, -1],
            distance_m=_path_length(x, y),
            mean_speed_m_s=mean_speed,
            slip_ratio=self.slip_ratios(physics, mean_speed),
        )

    def _require_finite(
        self,
        scenarios: Sequence[Scenario],
        prior: Positions | None,
        summaries: Summaries,
        band: PredictionBand | None,
    ) -> None:
        # the path goes through every sample: it is finite only if they are
        numbers = [summaries.distance_m[:, None], summaries.mean_speed_m_s[:, None]]
        numbers += [] if prior is None else [prior.x_m, prior.y_m]
        numbers += [] if band is None else band.columns().values()
        if not all(np.isfinite(each).all() for each in numbers):
            finite = np.logical_and.reduce([np.isfinite(each).all(axis=1) for each in numbers])
            raise NonFiniteError(
                f"{self.name}@{self.version} has no finite answer for {scenarios[int(finite.argmin())]}"
            )


def _own_samples(time_s: Array, horizons_s: Array) -> npt.NDArray[np.intp]:
    """How many samples of each row come before the horizon is repeated, shape (scenario,). Raises ValueError."""
    rows = len(horizons_s)
    if rows == 0 or time_s.ndim not in (1, 2) or (time_s.ndim == 2 and len(time_s) != rows) or not time_s.size:
        raise ValueError(f"times of shape {time_s.shape} do not fit {rows} scenarios")
    if rows == 1 and time_s.ndim == 1:
        wrong = time_s[-1] != horizons_s[0]
    else:
        wrong = bool(np.any(time_s[..., -1] != horizons_s))
    if wrong:
        raise ValueError("times must end at their scenario's horizon")
    if time_s.ndim == 1:
        return np.full(rows, len(time_s), dtype=np.intp)
    return np.asarray((time_s >= time_s[:, -1:]).argmax(axis=1) + 1, dtype=np.intp)


def _with_times(time_s: Array, extra: Sequence[Array]) -> Array:
    """Times with more at the end, (scenario,) each: still (time,) where these are the same for all scenarios."""
    if time_s.ndim == 1 and all(len(each) == 1 or (each == each[0]).all() for each in extra):
        return np.concatenate([time_s, *(each[:1] for each in extra)])
    rows = np.broadcast_to(time_s, (len(extra[0]), time_s.shape[-1]))
    return np.column_stack([rows, *extra])


def _without_last(positions: Positions, count: int) -> Positions:
    return Positions(positions.x_m[:, :-count], positions.y_m[:, :-count])


def _last(positions: Positions, count: int) -> Positions:
    return Positions(positions.x_m[:, -count:], positions.y_m[:, -count:])


def _with_start(positions: Positions, start: Positions) -> Positions:
    """Positions after the first one of `start`."""
    x = np.column_stack([start.x_m[:, :1], positions.x_m])
    return Positions(x, np.column_stack([start.y_m[:, :1], positions.y_m]))


def _path_length(x_m: Array, y_m: Array) -> Array:
    """Sum of the straight ways between samples, shape (scenario,). `hypot` would take three times as long."""
    squares = np.square(x_m[:, 1:] - x_m[:, :-1])
    squares += np.square(y_m[:, 1:] - y_m[:, :-1])
    return np.asarray(np.sqrt(squares, out=squares).sum(axis=1))


def _first_row(columns: Mapping[str, Array]) -> dict[str, Array]:
    return {name: column[0] for name, column in columns.items()}


def _in_frame(positions: Positions, physics: Scenarios, frame: Frame) -> Mapping[str, Array]:
    """Positions as columns of the frame, shape (scenario, time)."""
    if frame is Frame.SLOPE:
        return {"x_m": positions.x_m, "y_m": positions.y_m}
    horizontal, up = slope_to_world(positions.x_m, positions.y_m, physics.slope_angle_rad[:, None])
    return {"x_m": horizontal, "z_m": up}
