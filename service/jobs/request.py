"""What somebody asks a training job to do, and whether that can work at all."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, field_validator

from model_store import DatasetRecord, ModelStore
from service.datasets.passport import MAX_BYTES as MAX_PASSPORT_BYTES
from service.datasets.passport import PASSPORT_FILE, Passport, parse_passport
from service.errors import DatasetError, InvalidValueError, TrainingError
from service.learning.network.fit_config import FitConfig
from service.learning.split import SLOPE_TOLERANCE_DEG, is_among
from service.training.config import (
    FEWEST_RUNS,
    TAKES_VARYING_RUNS,
    ArchitectureName,
    InputName,
    PriorName,
    TrainingConfig,
    XForm,
)
from service.training.stored_dataset import RUNS_FILE

if TYPE_CHECKING:
    from service.datasets.run_labels import RunLabel

_DEFAULTS = {name: field.default for name, field in TrainingConfig.model_fields.items()}
_FIT = FitConfig()
_MOST_BYTES_LOOKED_AT = 256 << 20
_NAMED = 4
_REPLACED = {"resistance_process": "drive_model"}

Slope = Annotated[float, Field(ge=-90, le=90)]


class _Asked(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class SplitRequest(_Asked):
    """Which runs are kept for testing; none by default."""

    test_slopes_deg: Annotated[tuple[Slope, ...], Field(max_length=64)] = Field(
        (), description="Every run at these slopes is kept for testing."
    )
    test_fraction: float = Field(0.0, ge=0, le=0.9, description="Share of the other runs kept, drawn at random.")


class Budget(_Asked):
    """How much a job may compute. A job that reaches the minutes ends with the best epoch so far."""

    max_epochs: int = Field(_FIT.epochs, ge=1, le=10_000, description="Most epochs of the fit.")
    max_minutes: float = Field(60.0, gt=0, le=1440, description="Most minutes of fitting.")


class TrainingJobRequest(_Asked):
    """A training job as it is asked for."""

    model: Annotated[str, StringConstraints(pattern=r"^[a-z0-9][a-z0-9-]{0,62}$")] = Field(
        description="Name of the model that gets a new version: a-z, 0-9 and -.",
        json_schema_extra={"x-allowed": "a-z, 0-9 and -, starting with a letter or digit, at most 63 characters"},
    )
    datasets: Annotated[
        tuple[Annotated[str, StringConstraints(min_length=1, max_length=64)], ...], Field(min_length=1, max_length=64)
    ] = Field(
        description="Ids, unique starts of ids, or names of stored datasets.",
        json_schema_extra={
            "x-allowed": "a list of 1 to 64 datasets: ids, unique starts of ids (6 digits or more), or names"
        },
    )
    architecture: ArchitectureName = Field("drive_model", description="The learned part; zero is none.")
    prior: PriorName = Field(_DEFAULTS["prior"], description="The closed-form part.")
    inputs: Annotated[tuple[InputName, ...], Field(min_length=1, max_length=16)] = Field(
        tuple(_DEFAULTS["inputs"]),
        description="What a network sees, time_s first and each once.",
        json_schema_extra={
            "x-allowed": "a list of time_s first, then any of slope_deg, mass_kg, torque_nm and torque_ratio, each once"
        },
    )
    x_form: XForm = Field(_DEFAULTS["x_form"], description="What a network's x output is.")
    split: SplitRequest = Field(SplitRequest(), description="Which runs are kept for testing.")
    seed: int = Field(_FIT.seed, ge=0, le=2**31 - 1, description="The same seed gives the same weights.")
    budget: Budget = Field(Budget(), description="How much the job may compute.")
    promote: Literal["never", "if_better"] = Field(
        "never", description="`if_better`: champion moves to the new version when that is better by the margin."
    )
    margin: float = Field(
        0.05,
        ge=0,
        le=0.5,
        description="Share by which the error on unseen runs (test and left-out) must fall to be better.",
    )
    description: Annotated[str, StringConstraints(max_length=1000)] = Field(
        "", description="A sentence for people, kept in the manifest."
    )

    @field_validator("inputs")
    @classmethod
    def _time_first(cls, inputs: tuple[InputName, ...]) -> tuple[InputName, ...]:
        if inputs[0] != "time_s" or len(set(inputs)) < len(inputs):
            raise ValueError(f"inputs is {', '.join(inputs)}, allowed is time_s first and each one once")
        return inputs

    def training_config(self) -> TrainingConfig:
        """The same as the description that CLI and manifest use; what a request leaves open is the default."""
        return TrainingConfig(
            model=self.model,
            datasets=list(self.datasets),
            prior=self.prior,
            architecture=self.architecture,
            inputs=list(self.inputs),
            x_form=self.x_form,
            test_slopes_deg=list(self.split.test_slopes_deg),
            test_fraction=self.split.test_fraction,
            description=self.description,
            fit=FitConfig(seed=self.seed, epochs=self.budget.max_epochs),
        )


def stored_request(content: Mapping[str, Any]) -> TrainingJobRequest:
    """A request that was accepted, perhaps by an earlier release: an architecture that is gone is the one after it."""
    name = content.get("architecture")
    return TrainingJobRequest.model_validate(
        {**content, "architecture": _REPLACED.get(name, name)} if name else content
    )


def check_request(store: ModelStore, request: TrainingJobRequest) -> TrainingJobRequest:
    """The request with whole dataset ids, once nothing is known that would make it fail. Decodes no samples.

    Raises InvalidValueError naming the field for a dataset that is not there, comes twice, shares a run with another,
    whose passport does not fit the others or whose runs the architecture does not take, and for a split that names a
    slope of no run or leaves too few; and what the store raises.
    """
    records = [store.dataset(reference) for reference in request.datasets]
    ids = [record.id for record in records]
    twice = sorted({reference for reference, each in zip(request.datasets, ids, strict=True) if ids.count(each) > 1})
    if twice:
        raise InvalidValueError("datasets", twice, "each dataset once")
    _require_agreement(store, records)
    if request.architecture not in TAKES_VARYING_RUNS:
        _require_constant(records)
    runs = _runs_of(store, records, request)
    if runs is None:
        _require_likely_runs(records, request)
    else:
        _require_distinct(records, runs)
        _require_split([math.nan if run.slope_deg is None else run.slope_deg for run in runs], request)
    return request.model_copy(update={"datasets": tuple(ids)})


def _require_agreement(store: ModelStore, records: Sequence[DatasetRecord]) -> None:
    from service.training.data import require_same_simulation  # noqa: PLC0415 - brings pyarrow, slow to import

    try:
        passports = [(record.name, _passport(store, record)) for record in records]
        require_same_simulation(passports)
    except (DatasetError, TrainingError) as error:
        names = [record.name for record in records]
        raise InvalidValueError("datasets", names, f"datasets of one rover on one regolith: {error}") from error


def _require_constant(records: Sequence[DatasetRecord]) -> None:
    """As the worker will, by what the records' summaries say."""
    for record in records:
        varying = record.summary.get("varying_runs")
        if isinstance(varying, dict) and varying:
            runs = ", ".join(list(varying)[:_NAMED])
            allowed = f"datasets of runs with constant slope and torque; in {record.name} they change (runs {runs})"
            raise InvalidValueError("datasets", record.name, allowed)


def _passport(store: ModelStore, record: DatasetRecord) -> Passport:
    return parse_passport(store.read_dataset_file(record.id, PASSPORT_FILE, limit_bytes=MAX_PASSPORT_BYTES))


def _runs_of(
    store: ModelStore, records: Sequence[DatasetRecord], request: TrainingJobRequest
) -> Sequence[RunLabel] | None:
    """All runs, where they are needed to judge the request; None where not, or where that would take long.

    The worker, which reads the runs in any case, judges again.
    """
    from service.datasets.run_labels import read_run_labels  # noqa: PLC0415 - brings pyarrow

    entries = [record.files.get(RUNS_FILE) for record in records]
    total = sum(entry.size_bytes for entry in entries if entry is not None)
    if (len(records) == 1 and not request.split.test_slopes_deg) or None in entries or total > _MOST_BYTES_LOOKED_AT:
        return None
    try:
        return [label for record in records for label in read_run_labels(store.read_dataset_file(record.id, RUNS_FILE))]
    except DatasetError:
        return None


def _require_distinct(records: Sequence[DatasetRecord], runs: Sequence[RunLabel]) -> None:
    shared = [name for name, times in Counter(run.name for run in runs).items() if times > 1]
    if shared:
        names = [record.name for record in records]
        more = f" and {len(shared) - _NAMED} more" if len(shared) > _NAMED else ""
        allowed = f"datasets that share no run; {', '.join(shared[:_NAMED])}{more} would be there twice"
        raise InvalidValueError("datasets", names, allowed)


def _require_split(slopes: Sequence[float], request: TrainingJobRequest) -> None:
    """As `service.learning.split` will divide the runs; a slope that changes is nan."""
    asked = request.split.test_slopes_deg
    for slope in asked:
        if not is_among(slope, slopes):
            there = sorted(
                {round(each, 6) for each in slopes if math.isfinite(each)}, key=lambda each: abs(each - slope)
            )[:_NAMED]
            nearest = ", ".join(f"{each:g}" for each in sorted(there))
            raise InvalidValueError("split.test_slopes_deg", slope, f"slopes of runs; nearest are {nearest}")
    others = sum(not is_among(each, asked) for each in slopes)
    _require_enough(others - round(request.split.test_fraction * others), len(slopes), request)


def _require_enough(left: int, runs: int, request: TrainingJobRequest) -> None:
    least = FEWEST_RUNS[request.architecture]
    if left < least:
        allowed = f"one that leaves {least} of the {runs} runs to train on"
        raise InvalidValueError("split", request.split.model_dump(mode="json"), allowed)


def _require_likely_runs(records: Sequence[DatasetRecord], request: TrainingJobRequest) -> None:
    """What the records' summaries tell of the split."""
    counts = [_number(record, "runs") for record in records]
    if any(count is None for count in counts):
        return
    runs = int(sum(count for count in counts if count is not None))
    for slope in request.split.test_slopes_deg:
        if not any(_has_slope(record, slope) for record in records):
            raise InvalidValueError("split.test_slopes_deg", slope, "slopes within the range of the datasets' runs")
    only = request.split.test_slopes_deg and all(_all_at(record, request.split.test_slopes_deg) for record in records)
    _require_enough(0 if only else runs - round(request.split.test_fraction * runs), runs, request)


def _number(record: DatasetRecord, field: str) -> float | None:
    value = record.summary.get(field)
    return float(value) if isinstance(value, int | float) else None


def _slopes(record: DatasetRecord) -> tuple[float, float]:
    span = record.summary.get("slope_deg")
    lowest = span.get("lowest") if isinstance(span, dict) else None
    highest = span.get("highest") if isinstance(span, dict) else None
    if not isinstance(lowest, int | float) or not isinstance(highest, int | float):
        return -math.inf, math.inf
    return float(lowest), float(highest)


def _has_slope(record: DatasetRecord, slope: float) -> bool:
    lowest, highest = _slopes(record)
    return lowest - SLOPE_TOLERANCE_DEG <= slope <= highest + SLOPE_TOLERANCE_DEG


def _all_at(record: DatasetRecord, slopes: Sequence[float]) -> bool:
    lowest, highest = _slopes(record)
    return highest - lowest <= SLOPE_TOLERANCE_DEG and is_among(lowest, slopes)
