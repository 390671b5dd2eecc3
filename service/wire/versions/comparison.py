"""Two versions side by side: the gate's verdict, errors by regime on the runs that neither has seen, their domains, and
what both say on chosen slopes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field
from pydantic.json_schema import SkipJsonSchema

from model_store import CorruptArtefactError, Manifest, ModelStore, NotFoundError, UnsupportedFormatError
from service.allowed import Words
from service.learning.domain import FIELDS
from service.settings import LIMITS
from service.training.evidence import read_evidence
from service.training.gate import DEFAULT_MARGIN, MAX_MARGIN, Comparison, compare_versions
from service.training.regimes import RegimePair, pairs, varying_runs
from service.twin import Frame, Scenario
from service.twin.twin import Twin
from service.wire.commas import split_commas
from service.wire.forms import PictureFormat
from service.wire.prediction import FORMAT, REFERENCE, PredictionInputs
from service.wire.versions.card import SpreadAnswer, spread_answer

MOST_SLOPES = 12
_TIMES = 101
_PREDICTION = PredictionInputs.model_fields


class ComparisonInputs(BaseModel):
    """What the verdict asks for, and the scenarios whose curves are compared."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    margin: Annotated[
        float,
        Field(ge=0, le=MAX_MARGIN, description="How much smaller the errors must be, as a share.", examples=[0.05]),
    ] = DEFAULT_MARGIN
    slopes_deg: Annotated[
        list[Annotated[float, Field(ge=-LIMITS.slope_deg, le=LIMITS.slope_deg)]],
        BeforeValidator(split_commas),
        Field(
            min_length=1,
            max_length=MOST_SLOPES,
            description="Slopes in degrees on which both are asked, with commas between them.",
            examples=[[0, 10, 20, 25, 30]],
            json_schema_extra={
                "x-allowed": f"1 to {MOST_SLOPES} numbers from {-LIMITS.slope_deg:g} to {LIMITS.slope_deg:g}"
            },
        ),
    ] = [0.0, 10.0, 20.0, 25.0, 30.0]
    mass_kg: Annotated[float, _PREDICTION["mass_kg"]] = 430.0
    torque_nm: Annotated[float, _PREDICTION["torque_nm"]] = 60.0
    horizon_s: Annotated[float, _PREDICTION["horizon_s"]]


class ComparisonQuery(ComparisonInputs):
    """A comparison asked for in the query of a GET."""

    against: Annotated[
        str,
        Field(
            pattern=REFERENCE,
            description="What the version is compared with: `name`, `name@3` or `name@champion`. Without it, the "
            "champion of its own model.",
            examples=["viper-lunar@champion"],
            default_factory=str,
            json_schema_extra={"x-allowed": "name, name@version or name@alias, with a-z, 0-9 and - in names"},
        ),
    ]
    format: Annotated[PictureFormat | SkipJsonSchema[None], FORMAT] = None


ALLOWED = Words.of(ComparisonQuery)


class PairAnswer(BaseModel):
    """Errors of both on the same runs, unseen by both: at the end and over time."""

    regime: str
    runs: int
    candidate_final: SpreadAnswer
    against_final: SpreadAnswer
    candidate_rmse: SpreadAnswer
    against_rmse: SpreadAnswer


class RangeAnswer(BaseModel):
    """Lowest and highest value of a field among the training runs of both; null where one says nothing."""

    field: str
    candidate: list[float] | None
    against: list[float] | None


class CurveAnswer(BaseModel):
    """What both say on one slope."""

    slope_deg: float
    candidate_x_m: list[float]
    against_x_m: list[float]
    candidate_outcome: str
    against_outcome: str
    candidate_inside_domain: bool
    against_inside_domain: bool
    final_difference_m: Annotated[float, Field(description="Candidate's last position less the other's.")]


class CurvesAnswer(BaseModel):
    """Positions along the slope over time."""

    mass_kg: float
    torque_nm: float
    time_s: list[float]
    slopes: list[CurveAnswer]


class ComparisonAnswer(BaseModel):
    """Two versions side by side. `verdict` and what follows it is the promotion gate's, as training jobs pass it."""

    candidate: str
    against: str | None
    verdict: Annotated[str, Field(description="`first`, `better`, `not_better` or `not_comparable`.")]
    promote: bool
    sentence: str
    margin: float
    common_runs: int
    ratio: float | None
    p90: dict[str, dict[str, float]]
    seen_by_candidate: int
    seen_by_against: int
    regimes: list[PairAnswer]
    domain: list[RangeAnswer]
    curves: Annotated[CurvesAnswer | None, Field(description="null where one of them cannot predict here.")]
    curves_missing: Annotated[str | None, Field(description="Why there are no curves.")]


@dataclass(frozen=True, slots=True, eq=False)
class Two:
    """Both manifests, and both twins, or why there are none."""

    candidate: Manifest
    against: Manifest
    twins: tuple[Twin, Twin] | None
    missing: str | None = None


def compared(store: ModelStore, two: Two, asked: ComparisonInputs) -> ComparisonAnswer:
    """The answer. Raises what `compare_versions` raises, and InvalidValueError for scenarios that cannot be."""
    ours, theirs = ((each.name, each.version) for each in (two.candidate, two.against))
    verdict = compare_versions(store, ours, theirs, margin=asked.margin)
    return ComparisonAnswer.model_validate(
        {
            **verdict.describe(),
            "regimes": [_pair(each) for each in _pairs(store, two, verdict)],
            "domain": [_range(field, two) for field in FIELDS],
            "curves": None if two.twins is None else _curves(two.twins, asked),
            "curves_missing": two.missing,
        }
    )


def _pairs(store: ModelStore, two: Two, verdict: Comparison) -> list[RegimePair]:
    """None where the gate could not read what they are judged by: its reason says so."""
    if not verdict.common_runs:
        return []
    try:
        ours, theirs = (read_evidence(store, each) for each in (two.candidate, two.against))
        return pairs(ours, theirs, varying_runs(two.candidate, two.against))
    except (CorruptArtefactError, UnsupportedFormatError, NotFoundError):
        return []


def _pair(each: RegimePair) -> PairAnswer:
    return PairAnswer(
        regime=each.regime,
        runs=each.runs,
        candidate_final=spread_answer(each.candidate_final),
        against_final=spread_answer(each.against_final),
        candidate_rmse=spread_answer(each.candidate_rmse),
        against_rmse=spread_answer(each.against_rmse),
    )


def _range(field: str, two: Two) -> RangeAnswer:
    def of(manifest: Manifest) -> Any:  # noqa: ANN401 - JSON
        span = manifest.domain.get(field)
        return span if isinstance(span, list) and len(span) == 2 else None

    return RangeAnswer(field=field, candidate=of(two.candidate), against=of(two.against))


def _curves(twins: tuple[Twin, Twin], asked: ComparisonInputs) -> CurvesAnswer:
    times = np.linspace(0.0, asked.horizon_s, _TIMES)
    slopes = []
    for slope in asked.slopes_deg:
        scenario = Scenario(slope, asked.mass_kg, asked.torque_nm, asked.horizon_s)
        ours, theirs = (twin.predict(scenario, times, Frame.SLOPE) for twin in twins)
        slopes.append(
            CurveAnswer(
                slope_deg=slope,
                candidate_x_m=ours.trajectory["x_m"].tolist(),
                against_x_m=theirs.trajectory["x_m"].tolist(),
                candidate_outcome=ours.summary.outcome.value,
                against_outcome=theirs.summary.outcome.value,
                candidate_inside_domain=ours.domain.inside,
                against_inside_domain=theirs.domain.inside,
                final_difference_m=float(ours.trajectory["x_m"][-1] - theirs.trajectory["x_m"][-1]),
            )
        )
    return CurvesAnswer(mass_kg=asked.mass_kg, torque_nm=asked.torque_nm, time_s=times.tolist(), slopes=slopes)
