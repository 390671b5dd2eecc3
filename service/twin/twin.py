"""A twin: one version of a model in memory, answering scenarios."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Self, cast

import numpy as np

from model_store import Manifest
from service.errors import InvalidValueError
from service.learning.band import Band
from service.learning.domain import Domain, DomainVerdict
from service.learning.doubt.doubt import Doubt, ends_of
from service.learning.doubt.meeting import OffsetModel
from service.learning.drive.timetable import Account
from service.learning.drive.whole import MOST_LOOKS, Whole
from service.learning.trajectory_model import TrajectoryModel
from service.physics.scenario import Array, Positions, Scenarios
from service.physics.wheel_speed import slip_ratio, wheel_speed_rad_s
from service.tracing import span_of
from service.twin.batch import PredictionBatch, own_samples
from service.twin.columns import bounds_of, first_band, first_prior, first_row, in_frame, positions_of, speeds
from service.twin.many import ManyScenarios
from service.twin.one import AnswersAtOnce, Asked, is_finite, summary_of, table_of, trajectory_of
from service.twin.prediction import Frame, NonFiniteError, OutsideDomainError, Prediction, PredictionBand
from service.twin.scenario import Scenario
from service.twin.summary import (
    LAST_PART,
    Outcome,
    Summaries,
    Summary,
    late,
    mean_wheel_speed_rad_s,
    named,
    outcomes_of,
    own_times,
    path_length_m,
)
from service.twin.whole import KnowsWholes


@dataclass(frozen=True, slots=True, eq=False)
class _Core:
    """What one or many predictions are made of; members as those of `PredictionBatch`."""

    trajectory: Mapping[str, Array]
    prior: Mapping[str, Array] | None
    summaries: Summaries
    band: PredictionBand | None


@dataclass(slots=True, eq=False)
class _One:
    """What one prediction is made of; members as those of `Prediction`."""

    trajectory: dict[str, Array]
    prior: Mapping[str, Array] | None
    summary: Summary
    band: PredictionBand | None

    @classmethod
    def of(cls, core: _Core, time_s: Array) -> Self:
        """That of the first of many."""
        trajectory = {"time_s": time_s, **first_row(core.trajectory)}
        prior = None if core.prior is None else first_row(core.prior)
        return cls(trajectory, prior, core.summaries[0], first_band(core.band))


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
    band: Band | Doubt | None = None
    fingerprint: str = field(init=False, repr=False)
    _at_once: AnswersAtOnce | None = field(init=False, repr=False)
    _looks_s: tuple[float, ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_at_once", self.model if isinstance(self.model, AnswersAtOnce) else None)
        looks = () if self.band is None else tuple(self.band.look_s.tolist())
        object.__setattr__(self, "_looks_s", looks)
        manifest = self.manifest
        files = ",".join(each.sha256 for each in manifest.files.values())
        text = f"{manifest.name}@{manifest.version} {manifest.created_at.isoformat()} {files}"
        object.__setattr__(self, "fingerprint", hashlib.sha256(text.encode()).hexdigest())

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
        with_speed: bool = False,
        with_wheel_speed: bool = False,
    ) -> Prediction:
        """The trajectory at `time_s`, of shape (time,), rising, which ends at the scenario's horizon.

        With a `band_level` it has a band: an interval for x and one for y. Turned into the world frame it would be
        neither, so it is offered in the slope frame only. `with_prior` adds the prior's positions, `with_speed` and
        `with_wheel_speed` add columns to the trajectory: along the slope in both frames.

        Raises InvalidValueError for a band in the world frame, of a version without one or at a level that is not
        0.5 to 0.99, for wheel speeds of a model that does not know them, and NonFiniteError instead of answering with
        NaN or infinity.
        """
        if time_s.ndim != 1 or not time_s.size or time_s[-1] != scenario.horizon_s:
            raise ValueError("times must be (time,) and end at the scenario's horizon")
        asked = Asked(time_s, frame, band_level, with_prior, with_speed, with_wheel_speed)
        with span_of("predict", self, 1):
            one = self._answered(scenario, asked)
        return Prediction(
            scenario=scenario,
            frame=frame,
            trajectory=one.trajectory,
            prior_name=self.model.prior.name,
            prior=one.prior,
            domain=self.domain.judge(scenario.slope_deg, scenario.mass_kg, scenario.torque_nm, scenario.horizon_s),
            summary=one.summary,
            band=one.band,
        )

    def predict_many(
        self,
        scenarios: Sequence[Scenario],
        time_s: Array,
        frame: Frame = Frame.SLOPE,
        band_level: float | None = None,
        *,
        with_prior: bool = False,
        with_speed: bool = False,
        with_wheel_speed: bool = False,
    ) -> PredictionBatch:
        """`predict` for many scenarios at once: the same answers, but for rounding, much faster than one by one.

        `time_s`, as from `sample_grid`, has shape (time,) or (scenario, time); every row ends at its scenario's
        horizon, and shorter ones repeat it. Raises what `predict` does, for the first scenario without a finite
        answer, and ValueError for times that do not fit the scenarios or for no scenarios.
        """
        many = ManyScenarios.of(scenarios)
        horizons, physics, counts = many.horizon_s, many.as_physics(), own_samples(time_s, many.horizon_s)
        asked = Asked(time_s, frame, band_level, with_prior, with_speed, with_wheel_speed)
        with span_of("predict", self, len(scenarios)):
            core = self._predicted(many, physics, horizons, asked)
        return PredictionBatch(
            scenarios=many,
            frame=frame,
            time_s=time_s,
            counts=counts,
            trajectory=core.trajectory,
            prior_name=self.model.prior.name,
            prior=core.prior,
            domain=self.domain.judge_many(many.slope_deg, physics.mass_kg, physics.torque_nm, horizons),
            summaries=core.summaries,
            band=core.band,
        )

    def _answered(self, scenario: Scenario, asked: Asked) -> _One:
        """One prediction. Raises as `predict` does."""
        if self._at_once is None:
            core = self._predicted((scenario,), scenario.as_physics(), np.array([scenario.horizon_s]), asked)
            return _One.of(core, asked.time_s)
        band, slope_rad = self._band_for(asked), math.radians(scenario.slope_deg)
        table = table_of(asked.time_s, self._looks_s)
        rows, account = self._at_once.scenario(slope_rad, scenario.mass_kg, scenario.torque_nm, table, asked.columns)
        if not is_finite(account):
            raise self._no_finite_answer(scenario)
        likeliest = None if self.doubt is None else partial(self._likeliest, scenario, account)
        summary = summary_of(account, scenario.horizon_s, self.model.prior.rover, likeliest)
        trajectory = trajectory_of(rows, asked, slope_rad)
        if band is None and not asked.prior:
            return _One(trajectory, None, summary, None)
        physics, shown = scenario.as_physics(), Positions(rows[:1], rows[1:2])
        prior, bounds = self._beside(physics, asked, band, shown, self._seen(account))
        self._require_finite((scenario,), [*positions_of(prior), *bounds_of(bounds)])
        return _One(trajectory, first_prior(prior, physics, asked.frame), summary, first_band(bounds))

    def _predicted(self, scenarios: Sequence[Scenario], physics: Scenarios, horizons_s: Array, asked: Asked) -> _Core:
        band = self._band_for(asked)
        with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused below
            shown, seen, summaries = self._driven(physics, horizons_s, asked)
            prior, bounds = self._beside(physics, asked, band, shown, seen)
        trajectory = {**in_frame(shown, physics, asked.frame), **speeds(shown, asked)}
        told = [*trajectory.values(), summaries.distance_m[:, None], summaries.mean_speed_m_s[:, None]]
        self._require_finite(scenarios, [*told, *positions_of(prior), *bounds_of(bounds)])
        return _Core(
            trajectory=trajectory,
            prior=None if prior is None else in_frame(prior, physics, asked.frame),
            summaries=summaries,
            band=bounds,
        )

    def _driven(self, physics: Scenarios, horizons_s: Array, asked: Asked) -> tuple[Positions, Array, Summaries]:
        """What is shown, x (scenario, look) at the looks, and the summaries."""
        model, look_s = self.model, np.array(self._looks_s)
        if len(look_s) <= MOST_LOOKS and isinstance(model, KnowsWholes):
            moving = asked.speed or asked.wheel_speed
            found, whole = model.whole_motion(physics, asked.time_s, horizons_s, look_s, moving=moving)
            return found, whole.seen_m, self._summary_of(physics, horizons_s, found, whole)
        own = own_times(horizons_s, quick=model.quick)
        count, end = asked.time_s.shape[-1], asked.time_s.shape[-1] + own.shape[-1]
        moving = asked.speed or model.knows_wheel_speeds
        ask: Callable[[Scenarios, Array], Positions] = model.motion if moving else model.positions
        found = ask(physics, _joined([asked.time_s, own, look_s], len(horizons_s)))
        shown, seen = found.samples(slice(count)), found.x_m[:, end:]
        return shown, seen, self._summarise(physics, horizons_s, shown, found.samples(slice(count, end)), seen)

    def _beside(
        self, physics: Scenarios, asked: Asked, band: Band | Doubt | None, shown: Positions, seen_m: Array
    ) -> tuple[Positions | None, PredictionBand | None]:
        """The prior's positions and the band's bounds, where they are asked for."""
        prior = self.model.prior.positions(physics, asked.time_s) if asked.prior else None
        if band is None or asked.band_level is None:
            return prior, None
        edges = band.edges(self.offset_model, physics, asked.time_s, asked.band_level, shown, seen_m)
        bounds = edges.x_low_m, edges.x_high_m, edges.y_low_m, edges.y_high_m
        return prior, PredictionBand(asked.band_level, *bounds)

    def _likeliest(self, scenario: Scenario, account: Account, late_speed_m_s: float, end_m: float) -> Outcome:
        """The most probable outcome of one scenario, whose way came to this."""
        horizon, late_speed, end = (np.array([each]) for each in (scenario.horizon_s, late_speed_m_s, end_m))
        return self.likely_outcomes(scenario.as_physics(), horizon, late_speed, end, self._seen(account))[0]

    def _seen(self, account: Account) -> Array:
        """x at the looks of the band, (1, look)."""
        return np.array([(account.seen_m, account.seen_later_m)[: len(self._looks_s)]])

    def outside(self, verdict: DomainVerdict) -> OutsideDomainError:
        """What to tell a client that asked to be strict of a scenario with this verdict."""
        return OutsideDomainError(f"{self.name}@{self.version}", verdict)

    @property
    def doubt(self) -> Doubt | None:
        """What the version knows of the errors of its force balance; None for another kind of band, and without one."""
        return self.band if isinstance(self.band, Doubt) else None

    @property
    def offset_model(self) -> OffsetModel:
        """The model, of a twin that has a `doubt`: `load_twin` sees to it."""
        return cast(OffsetModel, self.model)

    @property
    def settled_horizon_s(self) -> float:
        """How long (s) the longest training run lasts."""
        return self.domain.spans["horizon_s"][1]

    def chances(self, scenarios: Sequence[Scenario]) -> Array | None:
        """Probabilities that each climbs, stalls and slides at its horizon, (scenario, 3); None without a `doubt`.

        Two drives each, and some more near where outcomes turn.
        """
        if self.doubt is None:
            return None
        many = ManyScenarios.of(scenarios)
        physics, horizons = many.as_physics(), many.horizon_s
        end = ends_of(self.offset_model, physics, horizons)
        seen = self.model.positions(physics, self.doubt.look_s).x_m
        return self.doubt.probabilities(self.offset_model, physics, horizons, end, seen)

    def likely_outcomes(
        self, physics: Scenarios, horizons_s: Array, late_speed_m_s: Array, end_m: Array, seen_m: Array
    ) -> tuple[Outcome, ...]:
        """The most probable outcome of each scenario; without a `doubt` that of the trajectory itself.

        `late_speed_m_s` and `end_m` (scenario,) are mean speed over the last quarter and last position, `seen_m`
        (scenario, look) x at the times at which a doubt looks.
        """
        if self.doubt is None:
            return outcomes_of(late_speed_m_s, end_m)
        end = late_speed_m_s, end_m
        return named(self.doubt.likeliest(self.offset_model, physics, horizons_s, end, seen_m))

    def slip_ratios(
        self, scenarios: Scenarios, horizons_s: Array, mean_speeds_m_s: Array, wheels_rad_s: Array | None = None
    ) -> tuple[float | None, ...]:
        """Of each scenario at its mean speed, (scenario,) each; None where the wheels stand still or nobody knows.

        `wheels_rad_s` are the mean speeds of the wheels, for a caller that knows them.
        """
        if wheels_rad_s is None and self.model.knows_wheel_speeds:
            times = own_times(horizons_s, quick=self.model.quick)
            wheels_rad_s = mean_wheel_speed_rad_s(self.model.motion(scenarios, times))
        return self._slip_ratios(scenarios, mean_speeds_m_s, wheels_rad_s)

    def _slip_ratios(
        self, scenarios: Scenarios, mean_speeds_m_s: Array, wheels_rad_s: Array | None
    ) -> tuple[float | None, ...]:
        """With the mean speeds of the wheels, (scenario,), where the model knows them."""
        rover, regolith = self.model.prior.rover, self.model.prior.regolith
        if wheels_rad_s is None and self.wheel_motion_resistance is not None:
            wheels_rad_s = wheel_speed_rad_s(rover, regolith, self.wheel_motion_resistance, scenarios)
        if wheels_rad_s is None:
            return (None,) * len(scenarios)
        both = zip(mean_speeds_m_s.tolist(), wheels_rad_s.tolist(), strict=True)
        return tuple(slip_ratio(rover, speed, wheel) for speed, wheel in both)

    def _known_band(self) -> Band | Doubt:
        if self.band is None:
            none = f"prior or speed; {self.name}@{self.version} was published without a band"
            raise InvalidValueError("include", "band", none)
        return self.band

    def _band_for(self, asked: Asked) -> Band | Doubt | None:
        """The band that is asked for. Raises InvalidValueError for parts that this version does not have."""
        if asked.wheel_speed and not self.model.knows_wheel_speeds:
            none = f"speed; {self.name}@{self.version} does not know how fast its wheels turn"
            raise InvalidValueError("include", "wheel_speed", none)
        return None if asked.band_level is None else self.band_in(asked.frame)

    def band_in(self, frame: Frame) -> Band | Doubt:
        """The band that is asked for in a frame. Raises InvalidValueError for another frame than that of slopes."""
        if frame is not Frame.SLOPE:
            raise InvalidValueError("frame", frame.value, "slope where a band is asked for: it bounds x and y there")
        return self._known_band()

    def _summarise(
        self, physics: Scenarios, horizons_s: Array, shown: Positions, whole: Positions, seen_m: Array
    ) -> Summaries:
        """`whole` has the model's answer at `own_times`, `shown` ends where it does; `seen_m`: `likely_outcomes`."""
        x = whole.x_m
        late_speed = (x[:, -1] - late(x)) / (LAST_PART * horizons_s)
        mean_speed = (x[:, -1] - x[:, 0]) / horizons_s
        return Summaries(
            outcome=self.likely_outcomes(physics, horizons_s, late_speed, x[:, -1] - x[:, 0], seen_m),
            final_x_m=shown.x_m[:, -1],
            final_y_m=shown.y_m[:, -1],
            distance_m=path_length_m(whole),
            mean_speed_m_s=mean_speed,
            slip_ratio=self._slip_ratios(physics, mean_speed, mean_wheel_speed_rad_s(whole)),
        )

    def _summary_of(self, physics: Scenarios, horizons_s: Array, shown: Positions, whole: Whole) -> Summaries:
        """The same of a model that knows it: all ways begin at 0."""
        end, mean_speed = whole.end_x_m, whole.end_x_m / horizons_s
        late_speed = (end - whole.late_x_m) / (LAST_PART * horizons_s)
        return Summaries(
            outcome=self.likely_outcomes(physics, horizons_s, late_speed, end, whole.seen_m),
            final_x_m=shown.x_m[:, -1],
            final_y_m=shown.y_m[:, -1],
            distance_m=whole.path_m,
            mean_speed_m_s=mean_speed,
            slip_ratio=self._slip_ratios(physics, mean_speed, whole.wheels_rad_s),
        )

    def _require_finite(self, scenarios: Sequence[Scenario], numbers: Sequence[Array]) -> None:
        """`numbers` are arrays (scenario, ...)."""
        if not all(np.isfinite(each).all() for each in numbers):
            finite = np.logical_and.reduce([np.isfinite(each).all(axis=1) for each in numbers])
            raise self._no_finite_answer(scenarios[int(finite.argmin())])

    def _no_finite_answer(self, scenario: Scenario) -> NonFiniteError:
        return NonFiniteError(f"{self.name}@{self.version} has no finite answer for {scenario}")


def _joined(parts: Sequence[Array], rows: int) -> Array:
    """Times one after the other, (time,) or (scenario, time): still (time,) where all of them are."""
    if all(part.ndim == 1 for part in parts):
        return np.concatenate(parts)
    return np.concatenate([np.broadcast_to(part, (rows, part.shape[-1])) for part in parts], axis=1)
