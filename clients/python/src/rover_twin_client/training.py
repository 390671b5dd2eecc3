"""The values that the service answers about datasets, training jobs and aliases. Times are in UTC, with their zone.

Members that are free JSON in the service (ranges, metrics, passports) are plain mappings here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Literal, TypeAlias, get_args

EndedState: TypeAlias = Literal["succeeded", "failed", "cancelled"]
JobState: TypeAlias = Literal["queued", "running", EndedState]
VersionStateName: TypeAlias = Literal["published", "archived", "deleted"]
Promotion: TypeAlias = Literal["never", "if_better"]
PreviewFormat: TypeAlias = Literal["svg", "png"]

ENDED = frozenset(get_args(EndedState))


@dataclass(frozen=True, slots=True)
class Finding:
    """One finding about an upload. `severity` is `reject` (the run is not stored) or `warn`. Rows count from 1."""

    file: str
    row: int | None
    column: str | None
    code: str
    severity: str
    message: str


@dataclass(frozen=True, slots=True)
class UploadReport:
    """Which runs of an upload were accepted, and which were not.

    `findings` lists rejections first, and at most 1000 of all `findings_count`. `summary` has the runs, rows, ranges,
    sampling and columns of the accepted runs. It is None when no run was accepted.
    """

    accepted: tuple[str, ...]
    rejected: tuple[str, ...]
    findings: tuple[Finding, ...]
    findings_count: int
    summary: Mapping[str, Any] | None


@dataclass(frozen=True, slots=True)
class Upload:
    """The result of an upload. The same runs always have the same `id`, in any file format.

    `created` means that this upload stored the dataset. `stored` means that the store has it, from this upload or from
    an earlier one. `already_known_as` are the names it had before; the `name` of this upload finds it too.
    """

    id: str
    name: str | None
    created: bool
    stored: bool
    dry_run: bool
    report: UploadReport
    already_known_as: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class DatasetInfo:
    """A dataset in a list. `unreadable` is None, or the reason why the service cannot describe a damaged dataset."""

    id: str
    name: str
    description: str
    created_at: datetime | None
    created_by: str
    summary: Mapping[str, Any]
    unreadable: str | None


@dataclass(frozen=True, slots=True)
class Dataset(DatasetInfo):
    """One dataset. `passport` says what was simulated, `source` which files it was made from.

    The dataset cannot be deleted while `versions` or `jobs` name a user. `jobs` is None when the service cannot tell
    now.
    """

    passport: Mapping[str, Any]
    source: Mapping[str, Any]
    versions: tuple[str, ...]
    jobs: tuple[str, ...] | None


@dataclass(frozen=True, slots=True)
class JobProgress:
    """The progress of a running job. `fraction` is 0 to 1. Errors are rms distances in metres, or None when unknown."""

    phase: str
    fraction: float
    epoch: int | None
    epochs: int | None
    train_error_m: float | None
    validation_error_m: float | None
    eta_s: float | None


@dataclass(frozen=True, slots=True)
class JobResult:
    """The version that a job made. `comparison` compares it with the champion; its `sentence` is for people.

    `promoted` says whether the alias champion moved to this version. `moves` lists every alias that moved.
    `same_weights_as` is another version with the very same weights, such as `viper-lunar@5`, or None.
    """

    model: str
    version: int
    promoted: bool
    metrics: Mapping[str, Any]
    comparison: Mapping[str, Any] | None
    moves: tuple[Mapping[str, Any], ...]
    same_weights_as: str | None = None


@dataclass(frozen=True, slots=True)
class JobFailure:
    """Why a job failed, and what to do about it."""

    type: str
    message: str
    remedy: str


@dataclass(frozen=True, slots=True)
class TrainingJob:
    """One training job. `request` is what the caller asked for, with the defaults of the service.

    `attempts` counts how often a worker started the job.
    """

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
        """Whether the job succeeded, failed or was cancelled. It does not change any more."""
        return self.state in ENDED


@dataclass(frozen=True, slots=True)
class JobEvent:
    """One event of a job. `number` rises from event to event and never changes. `kind` is state, progress or log.

    A state has `state` in its `data`, and the last one also `result` or `failure`. A log has `message`. A progress has
    the fields of JobProgress.
    """

    number: int
    kind: str
    time: datetime
    data: Mapping[str, Any]

    @property
    def is_last(self) -> bool:
        """Whether this is the last event of the job."""
        return self.kind == "state" and self.data.get("state") in ENDED


@dataclass(frozen=True, slots=True)
class Alias:
    """The version that an alias points to, and who moved it there, when and why. `seq` counts its moves."""

    version: int
    seq: int
    time: datetime
    actor: str
    reason: str

    @property
    def etag(self) -> str:
        """The tag of this move; `move_alias` and `rollback_alias` accept it as `expected`."""
        return f'"{self.seq}"'


@dataclass(frozen=True, slots=True)
class VersionState:
    """Whether a version can be used. `since`, `actor` and `reason` are None for one that is published."""

    name: str
    version: int
    state: VersionStateName
    since: datetime | None
    actor: str | None
    reason: str | None
