"""The domain of a version: where its training runs lie, input by input and jointly, and the verdict on a scenario."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from service.learning.neighbourhood import NearestRun, Neighbourhood
from service.learning.observed import ObservedRun
from service.physics.parameters import RegolithParameters, RoverParameters
from service.physics.scenario import Array
from service.physics.similarity import torque_ratio_of

# Judged in this order. torque_ratio is torque/(mass g wheel radius): a mass inside and a torque inside can still be
# a pair that no run was near (DESIGN section 4).
FIELDS = ("slope_deg", "mass_kg", "torque_nm", "torque_ratio", "horizon_s")
# What is outside when every input is inside alone, and yet no run was near the combination of them.
JOINT = "joint"
_UNITS = {"slope_deg": "deg", "mass_kg": "kg", "torque_nm": "N m", "torque_ratio": "", "horizon_s": "s", JOINT: ""}


@dataclass(frozen=True, slots=True)
class DomainReason:
    """One input that is outside: its value and the range the training runs cover.

    For `joint` the value is the distance to the nearest run, `highest` what lies between neighbouring runs.
    """

    field: str
    value: float
    lowest: float
    highest: float

    @property
    def detail(self) -> str:
        """The reason as a sentence."""
        if self.field == JOINT:
            return (
                f"joint: no training run is near this combination of slope, torque_ratio and mass; the nearest is at "
                f"a scaled distance of {_plain(self.value, 3)}, {_plain(self.value - self.highest, 3)} above what "
                f"separates neighbouring runs ({_plain(self.highest, 3)})"
            )
        bound, side = (self.lowest, "below") if self.value < self.lowest else (self.highest, "above")
        unit = f" {_UNITS[self.field]}" if _UNITS[self.field] else ""
        return (
            f"{self.field} {_plain(self.value, 6)}{unit} is {_plain(abs(self.value - bound), 3)}{unit} {side} "
            f"the training runs ({_plain(self.lowest, 6)} to {_plain(self.highest, 6)}{unit})"
        )


@dataclass(unsafe_hash=True, slots=True)
class DomainVerdict:
    """Whether a scenario lies among the training runs, input by input and jointly. Nobody changes one.

    `distance` is the scaled distance to the nearest of them; None, and no nearest runs, for a version without them.
    """

    inside: bool
    reasons: tuple[DomainReason, ...]
    distance: float | None = None
    nearest_runs: tuple[NearestRun, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class DomainVerdicts:
    """The verdicts on many scenarios; `verdicts[row]` is one of them in full.

    `inside` has shape (scenario,), `within` and `values` (scenario, field) say the same and what was judged for each of
    `FIELDS`, `nearest` has the indices of the nearest runs and their distances, (scenario, up to 3), if runs are known.
    """

    domain: Domain
    inside: npt.NDArray[np.bool_]
    within: npt.NDArray[np.bool_]
    values: Array
    nearest: tuple[npt.NDArray[np.intp], Array] | None

    def __len__(self) -> int:
        return len(self.inside)

    def outside_of(self) -> list[list[str]]:
        """Of each scenario the fields that are outside, as the `reasons` of its verdict name them."""
        known = self.domain.neighbourhood
        fits = self.within
        if self.nearest is not None and known is not None:
            fits = np.column_stack([fits, self.nearest[1][:, 0] <= known.limit])
        found: list[list[str]] = [[] for _ in range(len(self))]
        for row, at in np.argwhere(~fits).tolist():
            found[row].append((*FIELDS, JOINT)[at])
        return found

    def only(self, rows: npt.NDArray[np.intp]) -> DomainVerdicts:
        """Those on some of the scenarios."""
        nearest = None if self.nearest is None else (self.nearest[0][rows], self.nearest[1][rows])
        return DomainVerdicts(self.domain, self.inside[rows], self.within[rows], self.values[rows], nearest)

    def __getitem__(self, row: int) -> DomainVerdict:
        reasons = self.domain._reasons(self.values[row].tolist())
        known = self.domain.neighbourhood
        if self.nearest is None or known is None:
            return DomainVerdict(not reasons, reasons)
        return _with_nearest(reasons, known.nearest_runs(*(each[row] for each in self.nearest)), known.limit)


@dataclass(frozen=True, slots=True)
class Domain:
    """Lowest and highest value of each field in `FIELDS` among the training runs, and those runs.

    Versions published before the runs were kept have no `neighbourhood`; they are judged input by input only.
    """

    spans: Mapping[str, tuple[float, float]]
    rover: RoverParameters
    regolith: RegolithParameters
    neighbourhood: Neighbourhood | None = None
    _bounds: Array = field(init=False, repr=False, compare=False)
    _spans: tuple[tuple[str, float, float], ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        for name in FIELDS:
            if name not in self.spans:
                raise ValueError(f"the domain lacks {name}")
            lowest, highest = self.spans[name]
            if not (np.isfinite(lowest) and np.isfinite(highest) and lowest <= highest):
                raise ValueError(f"the domain's {name} is {lowest} to {highest}")
        object.__setattr__(self, "_spans", tuple((name, *self.spans[name]) for name in FIELDS))
        object.__setattr__(self, "_bounds", np.array([self.spans[name] for name in FIELDS], dtype=np.float64).T)

    @classmethod
    def of_runs(
        cls,
        runs: Sequence[ObservedRun],
        rover: RoverParameters,
        regolith: RegolithParameters,
        left_out_errors_m: Mapping[str, float] | None = None,
    ) -> Self:
        """The ranges that the runs cover; every horizon from zero to the longest run is inside.

        A run whose slope or torque changes covers all it went through; the neighbourhood has only runs that are one
        scenario each. `left_out_errors_m` maps runs to their final error when they were left out; what it lacks is not
        known.
        """
        each = [_spans_of(run, rover, regolith) for run in runs]
        spans = {name: (min(of[name][0] for of in each), max(of[name][1] for of in each)) for name in FIELDS}
        spans["horizon_s"] = (0.0, spans["horizon_s"][1])
        constant = [run for run in runs if not run.varies]
        known = Neighbourhood.of_runs(constant, rover, regolith, left_out_errors_m) if constant else None
        return cls(spans, rover, regolith, known)

    def judge(self, slope_deg: float, mass_kg: float, torque_nm: float, horizon_s: float) -> DomainVerdict:
        """The verdict on one scenario: that of `judge_many`, in plain numbers, which for one are faster than arrays."""
        ratio = torque_ratio_of(self.rover, self.regolith, mass_kg, torque_nm)
        reasons = self._reasons((slope_deg, mass_kg, torque_nm, ratio, horizon_s))
        known = self.neighbourhood
        if known is None:
            return DomainVerdict(not reasons, reasons)
        return _with_nearest(reasons, known.nearest_to(known.place_at(slope_deg, mass_kg, ratio)), known.limit)

    def holds_run(self, run: ObservedRun) -> bool:
        """Whether a run is inside: as `judge` has it, or, where it varies, by what it goes through alone."""
        if not run.varies:
            return self.judge(run.slope_deg, run.mass_kg, run.torque_nm, run.horizon_s).inside
        went = _spans_of(run, self.rover, self.regolith)
        return all(self.spans[name][0] <= went[name][0] <= went[name][1] <= self.spans[name][1] for name in FIELDS)

    def _reasons(self, values: Sequence[float]) -> tuple[DomainReason, ...]:
        """What is outside by itself; `values` are in the order of FIELDS."""
        found: tuple[DomainReason, ...] = ()
        for (name, lowest, highest), value in zip(self._spans, values, strict=True):
            if not lowest <= value <= highest:
                found += (DomainReason(name, value, lowest, highest),)
        return found

    def judge_many(self, slope_deg: Array, mass_kg: Array, torque_nm: Array, horizon_s: Array) -> DomainVerdicts:
        """The verdicts on many, whose columns have shape (scenario,)."""
        values, within = self._within(slope_deg, mass_kg, torque_nm, horizon_s)
        inside = np.asarray(within.all(axis=1))
        if self.neighbourhood is None:
            return DomainVerdicts(self, inside, within, values, None)
        places = self.neighbourhood.places_of(slope_deg, mass_kg, torque_nm)
        order, distances = self.neighbourhood.nearest_many(places)
        inside &= ~(distances[:, 0] > self.neighbourhood.limit)
        return DomainVerdicts(self, inside, within, values, (order, distances))

    def inside_many(
        self, slope_deg: Array, mass_kg: Array, torque_nm: Array, horizon_s: Array
    ) -> npt.NDArray[np.bool_]:
        """Whether each is inside, as `judge_many` says it: sooner, as nothing is said of why."""
        inside = np.asarray(self._within(slope_deg, mass_kg, torque_nm, horizon_s)[1].all(axis=1))
        if self.neighbourhood is not None and (rows := np.flatnonzero(inside)).size:
            places = self.neighbourhood.places_of(slope_deg[rows], mass_kg[rows], torque_nm[rows])
            inside[rows] = ~(self.neighbourhood.nearest_many(places, 1)[1][:, 0] > self.neighbourhood.limit)
        return inside

    def _within(
        self, slope_deg: Array, mass_kg: Array, torque_nm: Array, horizon_s: Array
    ) -> tuple[Array, npt.NDArray[np.bool_]]:
        """Values (scenario, field) in the order of FIELDS, and whether each is within its range."""
        ratio = torque_ratio_of(self.rover, self.regolith, mass_kg, torque_nm)
        values = np.array([slope_deg, mass_kg, torque_nm, ratio, horizon_s], dtype=np.float64).T
        lowest, highest = self._bounds
        return values, (lowest <= values) & (values <= highest)

    def describe(self) -> dict[str, Any]:
        """Ranges and runs as JSON values."""
        spans: dict[str, Any] = {field: list(self.spans[field]) for field in FIELDS}
        return spans if self.neighbourhood is None else spans | self.neighbourhood.describe()

    @classmethod
    def restore(cls, description: Mapping[str, Any], rover: RoverParameters, regolith: RegolithParameters) -> Self:
        """Inverse of `describe`. Raises ValueError, KeyError or TypeError for a description that does not fit."""
        spans = {field: (float(description[field][0]), float(description[field][1])) for field in FIELDS}
        known = Neighbourhood.restore(description, rover, regolith) if "runs" in description else None
        return cls(spans, rover, regolith, known)


def _plain(value: float, digits: int) -> str:
    """A number with so many digits that say something, and no exponent."""
    return np.format_float_positional(float(f"{value:.{digits}g}"), trim="-")


def _spans_of(run: ObservedRun, rover: RoverParameters, regolith: RegolithParameters) -> dict[str, tuple[float, float]]:
    """Lowest and highest value of each field over one run. Braked wheels are driven by no torque: they do not count."""
    slopes = np.round(np.degrees(run.slope_angle_rad), 6).tolist()
    torques = run.torques_nm[~run.brakes] if run.varies else np.array([run.torque_nm])
    torques = torques if len(torques) else np.array([run.torque_nm])
    return {
        "slope_deg": (min(slopes), max(slopes)),
        "mass_kg": (run.mass_kg, run.mass_kg),
        "torque_nm": (float(torques.min()), float(torques.max())),
        "torque_ratio": (
            torque_ratio_of(rover, regolith, run.mass_kg, float(torques.min())),
            torque_ratio_of(rover, regolith, run.mass_kg, float(torques.max())),
        ),
        "horizon_s": (run.horizon_s, run.horizon_s),
    }


def _with_nearest(reasons: tuple[DomainReason, ...], runs: tuple[NearestRun, ...], limit: float) -> DomainVerdict:
    """The verdict by the inputs alone, and by the nearest runs, nearest first."""
    distance = runs[0].distance
    if distance > limit:
        reasons += (DomainReason(JOINT, distance, 0.0, limit),)
    return DomainVerdict(not reasons, reasons, distance, runs)
