"""The errors of the client. `except RoverTwinError` catches them all.

    RoverTwinError
    ├── ConnectionFailedError     no connection, or it broke (also ConnectionError)
    ├── TimedOutError             connecting or reading took longer than allowed (also TimeoutError)
    ├── UnexpectedAnswerError     this client cannot read the answer: another service, or a newer one
    ├── RefusedError              4xx: the same request would be refused again
    │   ├── InvalidInputError     422: a value is out of range or of the wrong kind (also ValueError)
    │   │   ├── OutsideDomainError    the model was not validated there, and strict=True
    │   │   └── DatasetRejectedError  an upload was refused: `report` says why
    │   ├── NotAllowedError       401, 403: the token is missing, wrong, or may only read (PermissionError)
    │   ├── NotFoundError         404: no such model, version, alias, dataset, job or address (also LookupError)
    │   │                         410: the version was deleted
    │   ├── ConflictError         409, 412, 428: the resource is in use, archived, has ended, or has moved
    │   └── QueueFullError        429: too many jobs wait (`retry_after_s`)
    ├── ServerError               5xx: the service failed
    │   └── NotReadyError         503: try again later (`retry_after_s` when the service says how long)
    └── TrainingFailedError       `wait_for_job`: the job failed or was cancelled; `job` says why

Every error has `problem`: the service's own RFC 9457 answer, or None when there was no answer.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from rover_twin_client.training import TrainingJob, UploadReport

PROBLEM_PREFIX = "urn:rover-twin:problem:"


@dataclass(frozen=True, slots=True)
class FieldFault:
    """What is wrong with one input: its name, its value, what is allowed, and a message for people."""

    field: str
    value: object
    allowed: str | None
    message: str


@dataclass(frozen=True, slots=True)
class Problem:
    """An RFC 9457 problem. `members` is the whole document, including members that this client does not know."""

    type: str
    title: str
    status: int
    detail: str
    instance: str | None = None
    faults: tuple[FieldFault, ...] = ()
    members: Mapping[str, Any] = field(default_factory=dict)

    @property
    def slug(self) -> str:
        """The stable short name, such as `model-not-found`; the whole `type` for a problem of another service."""
        return self.type.removeprefix(PROBLEM_PREFIX)


class RoverTwinError(Exception):
    """The base class of every error of this client."""

    def __init__(self, message: str, problem: Problem | None = None) -> None:
        self.problem = problem
        super().__init__(message)


class ConnectionFailedError(RoverTwinError, ConnectionError):
    """No connection could be made, or it broke before the answer was complete."""


class TimedOutError(RoverTwinError, TimeoutError):
    """Connecting, sending or reading took longer than the timeout allows."""


class UnexpectedAnswerError(RoverTwinError):
    """The answer is not one of this API: it is not JSON, lacks a member, or has arrays of different lengths."""


class RefusedError(RoverTwinError):
    """The service refused the request (4xx). The same request would be refused again."""


class InvalidInputError(RefusedError, ValueError):
    """One or more inputs are out of range or of the wrong kind. `faults` names each argument, its value and range.

    `problem` has the same in the service's names. It is None when the client itself refused the input, such as a mass
    of "heavy".
    """

    def __init__(self, message: str, problem: Problem | None = None, faults: tuple[FieldFault, ...] = ()) -> None:
        self.faults = faults if faults or problem is None else problem.faults
        super().__init__(message, problem)


class OutsideDomainError(InvalidInputError):
    """The scenario is outside the region where the model was validated, and the call had strict=True."""


class DatasetRejectedError(InvalidInputError):
    """No run of an upload can be used, or one run cannot and the call had strict=True.

    `report` lists the findings by file, row and column. It is None when the answer has no readable report.
    """

    def __init__(self, message: str, problem: Problem | None = None, report: UploadReport | None = None) -> None:
        self.report = report
        super().__init__(message, problem)


class NotAllowedError(RefusedError, PermissionError):
    """The token is missing or wrong, may only read, or the service was started without any.

    Wrong ones that keep coming are told to wait (429); the right one never has to.
    """


class NotFoundError(RefusedError, LookupError):
    """No such model, version, alias, dataset, job or address, or the version was deleted."""


class ConflictError(RefusedError):
    """The state of the resource does not allow this: a dataset is in use, a job has ended, an alias has moved."""


class QueueFullError(RefusedError):
    """Too many training jobs wait. `retry_after_s` is the time until the next try in seconds, or None."""

    def __init__(self, message: str, problem: Problem | None = None, retry_after_s: float | None = None) -> None:
        self.retry_after_s = retry_after_s
        super().__init__(message, problem)


class ServerError(RoverTwinError):
    """The service failed (5xx). The request itself may be correct."""


class NotReadyError(ServerError):
    """The service cannot answer now (503). `retry_after_s` is its estimate of the wait in seconds, or None."""

    def __init__(self, message: str, problem: Problem | None = None, retry_after_s: float | None = None) -> None:
        self.retry_after_s = retry_after_s
        super().__init__(message, problem)


class TrainingFailedError(RoverTwinError):
    """The job that `wait_for_job` waited for made no version: `job.state` is failed or cancelled."""

    def __init__(self, message: str, job: TrainingJob) -> None:
        self.job = job
        super().__init__(message)
