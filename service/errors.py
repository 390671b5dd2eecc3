"""Every error that our own code raises on purpose. No status codes here: `api/http/errors.py` maps them.

    RoverTwinError
    ├── InvalidValueError     a value outside its allowed range (also ValueError); names field, value, allowed
    ├── DatasetError          a dataset or one of its files cannot be used
    ├── DatasetInUseError     a dataset cannot be deleted; names the versions and jobs that need it
    ├── CheckpointError       a stored version cannot become a twin
    ├── StorageFullError      no room is left for what was to be written
    ├── TrainingError         a training run could not start or finish
    ├── MissingPartError      a library that this installation does without is needed
    └── JobError              a training job or their queue
        ├── JobNotFoundError      no job has this id (also LookupError)
        ├── JobStateError         the job's state does not allow it
        ├── QueueFullError        as many jobs wait as may; names when to come back
        ├── IdempotencyKeyError   the key was used for another request (also ValueError)
        └── JobsUnavailableError  the jobs' database does not answer
            └── JobsDatabaseGoneError  its file was deleted or replaced while it was in use

The store keeps its own tree (`model_store/errors.py`), since it imports nothing of ours.
"""

from __future__ import annotations

import errno
from collections.abc import Sequence


class RoverTwinError(Exception):
    """Root of the errors that our own code raises on purpose."""


class InvalidValueError(RoverTwinError, ValueError):
    """A value is outside what is allowed. `field`, `value` and `allowed` say which, what and why."""

    def __init__(self, field: str, value: object, allowed: str) -> None:
        self.field, self.value, self.allowed = field, value, allowed
        super().__init__(f"{field} is {value!r}, allowed is {allowed}")


class DatasetError(RoverTwinError):
    """A dataset, or a file of it, cannot be used as it is."""


class DatasetInUseError(RoverTwinError):
    """A dataset cannot be deleted: `versions` (name@number) and unfinished `jobs` (ids) name it."""

    def __init__(self, dataset: str, versions: Sequence[str], jobs: Sequence[str]) -> None:
        self.versions, self.jobs = list(versions), list(jobs)
        users = [f"version {each}" for each in versions[:5]] + [f"training job {each}" for each in jobs[:5]]
        more = len(self.versions) + len(self.jobs) - len(users)
        super().__init__(f"dataset {dataset} is named by {', '.join(users)}" + (f" and {more} more" if more else ""))


class CheckpointError(RoverTwinError):
    """A stored version cannot be turned into a twin: the message says what does not fit."""


class StorageFullError(RoverTwinError):
    """No room is left on this machine for what was to be written; nothing of it was kept."""


NO_ROOM = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG})
"""Numbers of the system's errors that mean this."""


class TrainingError(RoverTwinError):
    """A training run could not start or finish."""


class MissingPartError(RoverTwinError):
    """A library is needed that this installation does without; the message says which, for what, and where it is."""


class JobError(RoverTwinError):
    """Root of what can go wrong with training jobs as such; why one failed is in the job itself."""


class JobNotFoundError(JobError, LookupError):
    """No training job has this id."""


class JobStateError(JobError):
    """The state of the job does not allow what was asked."""


class QueueFullError(JobError):
    """As many jobs wait as may; `retry_after_s` is when to ask again."""

    def __init__(self, waiting: int, retry_after_s: int) -> None:
        self.waiting, self.retry_after_s = waiting, retry_after_s
        super().__init__(f"{waiting} training jobs wait, which is all that may; ask again in {retry_after_s} s")


class IdempotencyKeyError(JobError, ValueError):
    """The idempotency key belongs to a job with another request."""


class JobsUnavailableError(JobError):
    """The jobs' database does not answer; nothing was changed, or an acknowledgement got lost."""


class JobsDatabaseGoneError(JobsUnavailableError):
    """The file of the jobs' database was deleted or replaced while it was in use; a new process uses what is there."""


class AuditUnavailableError(RoverTwinError):
    """The audit log does not answer: what it would have to show is not done."""
