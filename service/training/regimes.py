"""Left-out runs by what their rovers did: one number over all runs hides that errors differ by a factor of a hundred.

A run is in the first regime that fits it. Only what the manifest keeps of each run is looked at, so that versions of
any age are sorted alike.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter

from model_store import Manifest
from service.learning.neighbourhood import MAX_RUNS
from service.training.evidence import Errors, Evidence, RunKey, parsed

DRIVES, LONG, DOWN, SLIDES, SLOW, CLIMBS = REGIMES = (
    "drives (slope, torque or brake change)",
    "longer than 10 s",
    "downhill or motors off",
    "slides back",
    "stalls or crawls, under 0.1 m/s",
    "climbs",
)
_LONG_S = 10.0
_SLOW_M_S, _SLIDES_M_S = 0.1, -0.015


class LeftOutRun(BaseModel):
    """One run that was predicted by a model made without it. Raises ValidationError for numbers that are none."""

    model_config = ConfigDict(frozen=True, allow_inf_nan=False)

    run: str
    slope_deg: float
    mass_kg: float
    torque_nm: float
    horizon_s: Annotated[float, Field(gt=0)]
    final_x_m: float
    varies: bool = False
    model: Errors
    prior: Errors | None = None

    @property
    def regime(self) -> str:
        """Which of `REGIMES` it is in."""
        return regime_of(self.slope_deg, self.torque_nm, self.horizon_s, self.final_x_m, varies=self.varies)


_RUNS = TypeAdapter(Annotated[list[LeftOutRun], Field(max_length=MAX_RUNS)], config=ConfigDict(defer_build=True))


@dataclass(frozen=True, slots=True)
class Spread:
    """Median and 90th percentile over some runs, m."""

    median_m: float
    p90_m: float

    @classmethod
    def of(cls, values: Sequence[float]) -> Spread:
        """That of one value or more."""
        return cls(float(np.median(values)), float(np.quantile(values, 0.9)))


@dataclass(frozen=True, slots=True)
class RegimeErrors:
    """Errors at the end of the runs of one regime: of the model, and of its prior alone where that is known."""

    regime: str
    runs: int
    final: Spread
    rmse: Spread
    prior_final: Spread | None


@dataclass(frozen=True, slots=True)
class RegimePair:
    """Errors of two versions on the same runs of one regime."""

    regime: str
    runs: int
    candidate_final: Spread
    against_final: Spread
    candidate_rmse: Spread
    against_rmse: Spread


def left_out_runs(manifest: Manifest) -> list[LeftOutRun]:
    """Those of a version; without left-out runs its test runs; without both, none.

    Raises CorruptArtefactError when they are not what this program writes.
    """
    for part in ("left_out", "test"):
        found = manifest.metrics.get(part)
        rows = found.get("by_run") if isinstance(found, dict) else None
        if rows:
            return parsed(_RUNS, rows, f"metrics.{part}.by_run of {manifest.name}@{manifest.version}")
    return []


def by_regime(runs: Iterable[LeftOutRun]) -> list[RegimeErrors]:
    """In the order of `REGIMES`, those that have runs."""
    found: dict[str, list[LeftOutRun]] = {}
    for run in runs:
        found.setdefault(run.regime, []).append(run)
    return [_errors(regime, found[regime]) for regime in REGIMES if regime in found]


def pairs(ours: Evidence, theirs: Evidence, varying: frozenset[str]) -> list[RegimePair]:
    """Both versions' errors on the runs that neither has seen, by regime; `varying` are names of drives."""
    found: dict[str, list[RunKey]] = {}
    for key in sorted(ours.errors.keys() & theirs.errors.keys()):
        end_m = key.final_x_um / 1e6
        regime = regime_of(key.slope_deg, key.torque_nm, key.horizon_s, end_m, varies=key.run in varying)
        found.setdefault(regime, []).append(key)
    return [_pair(regime, found[regime], ours, theirs) for regime in REGIMES if regime in found]


def varying_runs(*manifests: Manifest) -> frozenset[str]:
    """Names of the left-out runs whose slope, torque or brake change."""
    return frozenset(each.run for manifest in manifests for each in left_out_runs(manifest) if each.varies)


def regime_of(slope_deg: float, torque_nm: float, horizon_s: float, final_x_m: float, *, varies: bool) -> str:
    """Which of `REGIMES` a run is in."""
    speed = final_x_m / horizon_s
    fits: Mapping[str, bool] = {
        DRIVES: varies,
        LONG: horizon_s > _LONG_S,
        DOWN: slope_deg < 0 or torque_nm == 0,
        SLIDES: speed < _SLIDES_M_S,
        SLOW: speed < _SLOW_M_S,
    }
    return next((regime for regime, holds in fits.items() if holds), CLIMBS)


def _errors(regime: str, runs: Sequence[LeftOutRun]) -> RegimeErrors:
    priors = [each.prior.final_m for each in runs if each.prior is not None]
    return RegimeErrors(
        regime,
        len(runs),
        Spread.of([each.model.final_m for each in runs]),
        Spread.of([each.model.rmse_m for each in runs]),
        Spread.of(priors) if priors else None,
    )


def _pair(regime: str, keys: Sequence[RunKey], ours: Evidence, theirs: Evidence) -> RegimePair:
    def spread(side: Evidence, name: str) -> Spread:
        return Spread.of([getattr(side.errors[key], name) for key in keys])

    return RegimePair(
        regime, len(keys), spread(ours, "final_m"), spread(theirs, "final_m"), spread(ours, "rmse_m"),
        spread(theirs, "rmse_m"),
    )  # fmt: skip
