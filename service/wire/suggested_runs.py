"""What to simulate next: the models of the answer, and how it is written, as JSON or as a `runs.csv`."""

from __future__ import annotations

import csv
import io
from typing import Annotated, Any

from pydantic import BaseModel, Field

from model_store import Manifest
from service.learning.suggest import MOST_SUGGESTIONS, SuggestedRun
from service.wire.prediction import TableFormatQuery
from service.wire.whole_numbers import PLAIN_INTEGER

COLUMNS = ("file", "set", "slope_deg", "mass_kg", "torque_nm", "horizon_s", "step_s")
_SET = "suggested"
_STEP_S = 0.001  # of the shipped runs over the whole space


class SuggestedRunsQuery(TableFormatQuery):
    """How many scenarios, and how they are written."""

    n: Annotated[
        int,
        Field(ge=1, le=MOST_SUGGESTIONS, description="How many scenarios to suggest.", examples=[8]),
        PLAIN_INTEGER,
    ] = 8


class VersionIdentity(BaseModel):
    """One version of a model."""

    name: str
    version: int


class SuggestionReason(BaseModel):
    """Why a scenario is worth a simulation. Distances are those of the domain verdict."""

    expected_error_m: Annotated[
        float | None,
        Field(description="Error to expect of the final position; null when no run has a left-out error."),
    ]
    distance: Annotated[float, Field(description="Scaled distance to the nearest training run.")]
    nearest_run: str


class SuggestedRunAnswer(BaseModel):
    """One row of a `runs.csv`, and why it is there."""

    file: str
    set: str
    slope_deg: float
    mass_kg: float
    torque_nm: Annotated[float, Field(description="Motor stall torque per wheel.")]
    horizon_s: float
    step_s: Annotated[float, Field(description="Seconds between two rows of the file.")]
    reason: SuggestionReason


class SuggestedRunsAnswer(BaseModel):
    """What to simulate next, the most useful scenario first."""

    model: VersionIdentity
    runs: list[SuggestedRunAnswer]


def runs_as_json(manifest: Manifest, runs: tuple[SuggestedRun, ...]) -> dict[str, Any]:
    """The JSON answer: a `SuggestedRunsAnswer`."""
    return {
        "model": {"name": manifest.name, "version": manifest.version},
        "runs": [
            dict(zip(COLUMNS, _row(run), strict=True))
            | {
                "reason": {
                    "expected_error_m": run.expected_error_m,
                    "distance": run.distance,
                    "nearest_run": run.nearest_run,
                }
            }
            for run in runs
        ],
    }


def runs_as_csv(runs: tuple[SuggestedRun, ...]) -> str:
    """The `runs.csv` that a simulation script reads, and that an import finds beside the files it wrote."""
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(COLUMNS)
    rows.writerows(map(_row, runs))
    return text.getvalue()


def _row(run: SuggestedRun) -> tuple[object, ...]:
    scenario = f"s{run.slope_deg}_m{run.mass_kg}_t{run.torque_nm}_h{run.horizon_s:g}"
    file = f"runs/viper_{scenario}.csv.gz"
    return file, _SET, run.slope_deg, run.mass_kg, run.torque_nm, run.horizon_s, _STEP_S
