"""Every error of the client. One `except RoverTwinError` catches all; each class also says what to do next.

    RoverTwinError
    ├── ConnectionFailedError     no connection, or it broke (also ConnectionError)
    ├── TimedOutError             connecting or reading took longer than allowed (also TimeoutError)
    ├── UnexpectedAnswerError     an answer came that this client cannot read: another service, or a newer one
    ├── RefusedError              4xx: the same question would be refused again
    │   ├── InvalidInputError     422: a value is out of range or of the wrong kind (also ValueError)
    │   │   ├── OutsideDomainError    strict=True and the model was never validated there
    │   │   └── DatasetRejectedError  nothing of an upload can be used: `report` says why
    │   ├── NotAllowedError       401, 403: no token, a wrong one, or the service has none (also PermissionError)
    │   ├── NotFoundError         404: no such model, version, alias, dataset, job or address (also LookupError)
    │   ├── ConflictError         409, 412, 428: not in the present state: in use, ended, or moved meanwhile
    │   └── QueueFullError        429: too many jobs wait (`retry_after_s`)
    ├── ServerError               5xx: the question was fine, the service failed
    │   └── NotReadyError         503: try again later (`retry_after_s` when the service says how long)
    └── TrainingFailedError       a job that was waited for failed or was cancelled: `job` says why

Every class carries `problem`, the service's own RFC 9457 answer, or None where no answer came.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from rover_twin_client.training import TrainingJob, UploadReport

PROBLEM_PREFIX = "urn:rover-twin:problem:"


@dataclass(frozen=True, slots=True)
class FieldFault:
    """What is wrong with one input: its name, the value that was sent, what is allowed, and a sentence."""

    field: str
    value: object
    allowed: str | None
    message: str


@dataclass(frozen=True, slots=True)
class Problem:
    """An RFC 9457 problem. `members` is the whole document, with members this client does not know."""

    type: str
    title: str
    status: int
    detail: str
    instance: str | None = None
    faults: tuple[FieldFault, ...] = ()
    members: Mapping[str, Any] = field(default_factory=dict)

    @property
    def slug(self) -> str:
        """The stable short name, such as `model-not-found`; the whole `type` for problems of other services."""
        return self.type.removeprefix(PROBLEM_PREFIX)


class RoverTwinError(Exception):
    """Root of the client's errors."""

    def __init__(self, message: str, problem: Problem | None = None) -> None:
        self.problem = problem
        super().__init__(message)


class ConnectionFailedError(RoverTwinError, ConnectionError):
    """No connection could be made, or it broke before the answer was complete."""


class TimedOutError(RoverTwinError, TimeoutError):
    """Connecting, sending or reading took longer than the timeout allows."""


class UnexpectedAnswerError(RoverTwinError):
    """The answer is not one of this service's API: not JSON, a missing member, or arrays that do not fit."""


class RefusedError(RoverTwinError):
    """The service refused the question (4xx); asking it again changes nothing."""


class InvalidInputError(RefusedError, ValueError):
    """One or more inputs are out of range or of the wrong kind: `faults` names each field, value and range.

    `problem` is None when the input could not even be sent (a mass of "heavy").
    """

    def __init__(self, message: str, problem: Problem | None = None, faults: tuple[FieldFault, ...] = ()) -> None:
        self.faults = faults if problem is None else problem.faults
        super().__init__(message, problem)


class OutsideDomainError(InvalidInputError):
    """Asked with strict=True, outside the region where the model was validated."""


class DatasetRejectedError(InvalidInputError):
    """Nothing of an upload can be used, or `strict` was asked for and a run is unusable.

    `report` says what was found, by file, row and column; None when the answer has none that can be read.
    """

    def __init__(self, message: str, problem: Problem | None = None, report: UploadReport | None = None) -> None:
        self.report = report
        super().__init__(message, problem)


class NotAllowedError(RefusedError, PermissionError):
    """The token is missing or wrong, or the service was started without one."""


class NotFoundError(RefusedError, LookupError):
    """No such model, version, alias, dataset, job or address."""


class ConflictError(RefusedError):
    """Not in the present state: a dataset in use, a job that has ended, an alias that moved. Look, decide again."""


class QueueFullError(RefusedError):
    """As many training jobs wait as may wait; `retry_after_s` is when to try again, in seconds, or None."""

    def __init__(self, message: str, problem: Problem | None = None, retry_after_s: float | None = None) -> None:
        self.retry_after_s = retry_after_s
        super().__init__(message, problem)


class ServerError(RoverTwinError):
    """The service failed (5xx); the question may be fine."""


class NotReadyError(ServerError):
    """The service cannot answer now (503). `retry_after_s` is its own estimate in seconds, or None."""

    def __init__(self, message: str, problem: Problem | None = None, retry_after_s: float | None = None) -> None:
        self.retry_after_s = retry_after_s
        super().__init__(message, problem)


class TrainingFailedError(RoverTwinError):
    """A training job that was waited for ended without a version: `job.state` is failed or cancelled."""

    def __init__(self, message: str, job: TrainingJob) -> None:
        self.job = job
        super().__init__(message)
