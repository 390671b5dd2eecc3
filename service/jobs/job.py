"""A training job as everybody sees it, and the names that queue and worker share. Knows nothing of dbos."""

from __future__ import annotations

from datetime import datetime
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, JsonValue

from service.jobs.request import TrainingJobRequest

JobState = Literal["queued", "running", "succeeded", "failed", "cancelled"]
EventKind = Literal["state", "progress", "log"]

ALLOWED_MOVES: dict[JobState, frozenset[JobState]] = {
    "queued": frozenset({"running", "cancelled"}),
    # back to queued: its worker was killed, or was told to end and handed it back
    "running": frozenset({"succeeded", "failed", "cancelled", "queued"}),
    "succeeded": frozenset(),
    "failed": frozenset(),
    "cancelled": frozenset(),
}
ENDED: frozenset[JobState] = frozenset(state for state, moves in ALLOWED_MOVES.items() if not moves)

# What queue (client) and worker must agree on. A job that waits keeps its format, so these stay for good.
APPLICATION = "rover-twin"
APPLICATION_VERSION = "1"
QUEUE = "training"
WORKFLOW = "train"
EVENTS = "events"
STATUS = "status"


class _Frozen(BaseModel):
    model_config = ConfigDict(frozen=True, extra="ignore")


class JobProgress(_Frozen):
    """Progress of a running job. Errors are rms distances in metres, null where they do not apply."""

    phase: str
    fraction: float = Field(ge=0, le=1)
    epoch: int | None = None
    epochs: int | None = None
    train_error_m: float | None = None
    validation_error_m: float | None = None
    eta_s: float | None = None


class JobResult(_Frozen):
    """What a job that succeeded made. `moves` lists the aliases it moved, {alias, version, seq, reason} each.

    `same_weights_as` is another version that has the very same weights, as name@2; null when there is none.
    """

    model: str
    version: int
    metrics: dict[str, JsonValue] = Field(default_factory=dict)
    comparison: dict[str, JsonValue] | None = None
    same_weights_as: str | None = None
    promoted: bool = False
    moves: tuple[dict[str, JsonValue], ...] = ()


class JobFailure(_Frozen):
    """Why a job failed, and what to do about it."""

    type: str
    message: str
    remedy: str


class TrainingJob(_Frozen):
    """One training job; times are UTC. `attempts` counts the workers that took it up."""

    id: str
    state: JobState
    request: TrainingJobRequest
    actor: str
    created_at: datetime
    started_at: datetime | None = None
    finished_at: datetime | None = None
    attempts: int = 0
    progress: JobProgress | None = None
    result: JobResult | None = None
    failure: JobFailure | None = None


class JobEvent(_Frozen):
    """One thing that happened. Numbers count up from 0 without gaps and never change.

    `data` of a state is {state} and its result or failure, of a progress the fields of JobProgress, of a log
    {message}.
    """

    number: int
    kind: EventKind
    time: datetime
    data: dict[str, Any]
