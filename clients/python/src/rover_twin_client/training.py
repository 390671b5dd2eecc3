"""What the service answers about datasets, training jobs and aliases, as values. Times are aware, in UTC.

Members that the service keeps as free JSON (ranges, metrics, passports) stay plain mappings here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Literal, TypeAlias

JobState: TypeAlias = Literal["queued", "running", "succeeded", "failed", "cancelled"]
Promotion: TypeAlias = Literal["never", "if_better"]
PreviewFormat: TypeAlias = Literal["svg", "png"]

ENDED = frozenset({"succeeded", "failed", "cancelled"})


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing found in an upload. `severity` is `reject` (its run is kept out) or `warn`; rows count from 1."""

    file: str
    row: int | None
    column: str | None
    code: str
    severity: str
    message: str


@dataclass(frozen=True, slots=True)
class UploadReport:
    """What was accepted and what was not. `findings` may be the first 1000 of `findings_count`, rejections first.

    `summary` has runs, rows, ranges, sampling and columns of what was accepted; None when nothing was.
    """

    accepted: tuple[str, ...]
    rejected: tuple[str, ...]
    findings: tuple[Finding, ...]
    findings_count: int
    summary: Mapping[str, Any] | None


@dataclass(frozen=True, slots=True)
class Upload:
    """What became of an upload. The same runs have the same `id`, however they came.

    `created`: this upload stored it. `stored`: the store has it, by this upload or an earlier one.
    """

    id: str
    name: str | None
    created: bool
    stored: bool
    dry_run: bool
    report: UploadReport


@dataclass(frozen=True, slots=True)
class DatasetInfo:
    """A dataset in a list. `unreadable` says why a damaged one shows nothing more, and is None when all is well."""

    id: str
    name: str
    description: str
    created_at: datetime | None
    created_by: str
    summary: Mapping[str, Any]
    unreadable: str | None


@dataclass(frozen=True, slots=True)
class Dataset(DatasetInfo):
    """Everything about one dataset: `passport` (what was simulated), `source` (the files it was made from).

    `versions` and `jobs` name what keeps it from being deleted; `jobs` is None when the service cannot tell now.
    """

    passport: Mapping[str, Any]
    source: Mapping[str, Any]
    versions: tuple[str, ...]
    jobs: tuple[str, ...] | None


@dataclass(frozen=True, slots=True)
class JobProgress:
    """Where a running job stands. `fraction` is 0 to 1; errors are rms distances in metres, None where unknown."""

    phase: str
    fraction: float
    epoch: int | None
    epochs: int | None
    train_error_m: float | None
    validation_error_m: float | None
    eta_s: float | None


@dataclass(frozen=True, slots=True)
class JobResult:
    """The version that a job made. `comparison` is how it compares with the champion it met (see its `sentence`).

    `promoted` says whether champion moved to it; `moves` lists every alias that moved.
    """

    model: str
    version: int
    promoted: bool
    metrics: Mapping[str, Any]
    comparison: Mapping[str, Any] | None
    moves: tuple[Mapping[str, Any], ...]


@dataclass(frozen=True, slots=True)
class JobFailure:
    """Why a job failed, and what to do about it."""

    type: str
    message: str
    remedy: str


@dataclass(frozen=True, slots=True)
class TrainingJob:
    """One training job. `request` is what was asked, defaults filled in; `attempts` counts workers that took it up."""

    id: str
    state: JobState
    request: Mapping[str, Any]
    actor: str
    created_at: datetime
    started_at: datetime | None
    finished_at: datetime | None
    attempts: int
    progress: JobProgress | None
    result: JobResult | None
    failure: JobFailure | None

    @property
    def ended(self) -> bool:
        """Whether it succeeded, failed or was cancelled: nothing changes any more."""
        return self.state in ENDED


@dataclass(frozen=True, slots=True)
class JobEvent:
    """One thing that happened to a job; numbers rise and never change. `kind` is state, progress or log.

    `data` of a state has `state` and, at the end, `result` or `failure`; of a log `message`; of a progress the
    fields of JobProgress.
    """

    number: int
    kind: str
    time: datetime
    data: Mapping[str, Any]

    @property
    def is_last(self) -> bool:
        """Whether nothing comes after it."""
        return self.kind == "state" and self.data.get("state") in ENDED


@dataclass(frozen=True, slots=True)
class Alias:
    """Where an alias points, and the record of how it got there."""

    version: int
    seq: int
    time: datetime
    actor: str
    reason: str

    @property
    def etag(self) -> str:
        """The tag of this record: what `move_alias` and `rollback_alias` take as `expected`."""
        return f'"{self.seq}"'
