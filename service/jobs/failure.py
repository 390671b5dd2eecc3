"""Why a job failed, for people: each kind of error with what to do about it."""

from __future__ import annotations

from service.jobs.job import JobFailure

_REMEDIES = {
    "TrainingError": "Change the request as the message says, then start a new job.",
    "ValueError": "Change the datasets, the split or the architecture as the message says, then start a new job.",
    "DatasetError": "Look at the dataset's report; upload it anew if it is damaged.",
    "DatasetNotFoundError": "The dataset was deleted while the job waited: upload it again, then start a new job.",
    "CorruptArtefactError": "Restore the file that is named from a backup, or upload the dataset again.",
    "StoreUnavailableError": "The model store did not answer for a while: see that it does, then start a new job.",
    "ConflictError": "Somebody else moved the alias all the time: move it by hand.",
    "VersionArchivedError": "The version was archived before an alias could name it: restore it, then move the alias "
    "by hand.",
    "VersionDeletedError": "The version was deleted before an alias could name it: start a new job.",
    "MemoryError": "The worker ran out of memory: train on fewer runs, or give the worker more.",
    "WorkerLost": "Look into the workers' logs and memory limits, then start the job anew, with less data or another "
    "budget.",
}
_REPORT_IT = "Read the job's log and the worker's; if they do not say why, report this message."
MAX_MESSAGE = 2000


def remedy_of(kind: str) -> str:
    """What to do about an error of this class."""
    return _REMEDIES.get(kind, _REPORT_IT)


class JobFailedError(Exception):
    """How a job that failed ends its workflow: dbos keeps the class, the message and `data`."""

    def __init__(self, failure: JobFailure) -> None:
        super().__init__(failure.message)
        self.data = failure.model_dump(mode="json")


def failure_of(error: Exception) -> JobFailure:
    """The failure that an error is; those of failed jobs, of retried steps and of replayed ones carry the real one."""
    data = getattr(error, "data", None)
    if isinstance(data, dict) and data.keys() == JobFailure.model_fields.keys():
        return JobFailure.model_validate(data)
    causes = getattr(error, "errors", None)
    if isinstance(causes, list) and causes and isinstance(causes[-1], Exception):
        error = causes[-1]
    kind = str(getattr(error, "name", None) or type(error).__name__)
    return JobFailure(type=kind, message=(str(error) or kind)[:MAX_MESSAGE], remedy=remedy_of(kind))


def worker_lost(times: int) -> JobFailure:
    """A job under which worker after worker died."""
    message = f"{times} workers were killed while they ran this job, at the same place, so it is not tried again."
    return JobFailure(type="WorkerLost", message=message, remedy=remedy_of("WorkerLost"))
