"""The operator's words of the synchronous client: datasets, training jobs and aliases. They need the token."""

from __future__ import annotations

import os
import uuid
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import BinaryIO

from rover_twin_client import training_calls as calls
from rover_twin_client.connection import Connection
from rover_twin_client.following import Following, Waiting, succeeded
from rover_twin_client.training import (
    Alias,
    Dataset,
    DatasetInfo,
    JobEvent,
    JobState,
    PreviewFormat,
    Promotion,
    TrainingJob,
    Upload,
)


class TrainingClient(Connection):
    """Datasets, training jobs and aliases. Every call but reading an alias needs `token`.

    Without it, or with a wrong one, they raise NotAllowedError.
    """

    def upload_dataset(
        self,
        file: str | os.PathLike[str] | BinaryIO,
        *,
        name: str | None = None,
        description: str | None = None,
        slope_deg: float | None = None,
        mass_kg: float | None = None,
        torque_nm: float | None = None,
        horizon_s: float | None = None,
        set_name: str | None = None,
        column_map: str | Mapping[str, object] | None = None,
        passport: Mapping[str, object] | None = None,
        strict: bool = False,
        dry_run: bool = False,
        filename: str | None = None,
    ) -> Upload:
        """Sends Chrono runs: a zip or tar with `runs.csv` and `passport.json`, a long CSV, Parquet, or one plain run.

        `file` is a path, or a file opened in binary mode, which is sent from its beginning; it is never held in
        memory. The scenario (degrees, kg, N m of stall torque per wheel, s) stands for what the files do not say.
        `column_map` names a preset or says which column is which. `dry_run` stores nothing. `strict` refuses
        everything when one run is unusable. The same content again is the same dataset, so it is safe to repeat.

        Raises DatasetRejectedError with a report, InvalidInputError for a field, and what every call raises.
        """
        fields = calls.upload_fields(
            name=name,
            description=description,
            slope_deg=slope_deg,
            mass_kg=mass_kg,
            torque_nm=torque_nm,
            horizon_s=horizon_s,
            set_name=set_name,
            column_map=column_map,
            passport=passport,
            strict=strict,
            dry_run=dry_run,
        )
        with ExitStack() as opened:
            stream = opened.enter_context(Path(file).open("rb")) if isinstance(file, str | os.PathLike) else file
            sent_as = filename or Path(str(getattr(stream, "name", "upload"))).name
            # what cannot be rewound can be sent once only
            return self._answer(calls.upload(fields, retried=stream.seekable()), {"file": (sent_as, stream)})

    def datasets(self) -> list[DatasetInfo]:
        """Every dataset, in the order of the ids."""
        found: list[DatasetInfo] = []
        more = True
        while more:
            page, more = self._answer(calls.datasets(found[-1].id if found else None))
            found += page
            more = more and bool(page)
        return found

    def dataset(self, reference: str) -> Dataset:
        """One dataset by its id, a unique start of it (6 digits or more) or its name; raises NotFoundError."""
        return self._answer(calls.dataset(reference))

    def preview_dataset(self, reference: str, form: PreviewFormat = "svg") -> bytes:
        """A figure of its runs and scenarios, as SVG or PNG; raises NotFoundError."""
        return self._answer(calls.preview(reference, form))

    def download_dataset(self, reference: str, path: str | os.PathLike[str]) -> Path:
        """Writes its runs to the file `path` as Parquet, one row per sample; raises NotFoundError.

        The file appears when it is whole and has the digest that the service tells; one that is there is replaced.
        """
        return self._save(calls.download(reference), Path(path))

    def delete_dataset(self, identity: str) -> None:
        """Deletes a dataset by its whole id; raises ConflictError while a version or a job names it."""
        self._answer(calls.delete_dataset(identity))

    def start_training_job(
        self,
        model: str,
        datasets: Iterable[str],
        *,
        architecture: str | None = None,
        prior: str | None = None,
        inputs: Iterable[str] | None = None,
        x_form: str | None = None,
        test_slopes_deg: Iterable[float] = (),
        test_fraction: float | None = None,
        seed: int | None = None,
        max_epochs: int | None = None,
        max_minutes: float | None = None,
        promote: Promotion | None = None,
        margin: float | None = None,
        description: str | None = None,
        idempotency_key: str | None = None,
    ) -> TrainingJob:
        """Queues the training of a new version of `model` on stored datasets (ids or names). Never queued twice.

        Every runs at one of `test_slopes_deg`, and a share `test_fraction` of the others, is kept for testing. What is
        None has the service's default. `promote="if_better"` moves champion when the error on unseen runs falls by the
        share `margin`. Each call makes a key of its own, under which it is repeated when the connection breaks; with an
        `idempotency_key` of yours even another process can repeat it.

        Raises InvalidInputError for what cannot work, QueueFullError when too many jobs wait.
        """
        request = calls.job_request(
            model,
            datasets,
            architecture=architecture,
            prior=prior,
            inputs=inputs,
            x_form=x_form,
            test_slopes_deg=test_slopes_deg,
            test_fraction=test_fraction,
            seed=seed,
            max_epochs=max_epochs,
            max_minutes=max_minutes,
            promote=promote,
            margin=margin,
            description=description,
        )
        return self._answer(calls.start(request, idempotency_key or str(uuid.uuid4())))

    def training_job(self, job_id: str) -> TrainingJob:
        """Where a job stands, and what came out of it; raises NotFoundError."""
        return self._answer(calls.job(job_id))

    def training_jobs(
        self,
        *,
        state: JobState | None = None,
        model: str | None = None,
        limit: int = 50,
        before: str | None = None,
    ) -> list[TrainingJob]:
        """Jobs, newest first: `limit` (1 to 500) of those older than the job with the id `before`."""
        return self._answer(calls.jobs(state=state, model=model, limit=limit, before=before))

    def cancel_training_job(self, job_id: str) -> TrainingJob:
        """Cancels a job that waits or runs; it stops within seconds. Raises ConflictError when it has ended."""
        return self._answer(calls.cancel(job_id))

    def job_events(self, job_id: str, after: int | None = None) -> Iterator[JobEvent]:
        """The job's events as they come, from the first one or after the one of number `after`, to its last.

        A connection that breaks is made again, for a minute without success, and goes on where it was: each event
        comes once. Raises NotFoundError.
        """
        return self._follow(calls.events_path(job_id), Following(after, self._retries))

    def wait_for_job(self, job_id: str, timeout_s: float = 3600.0) -> TrainingJob:
        """Waits until the job has succeeded, and bears a service that restarts meanwhile.

        Raises TrainingFailedError when it failed or was cancelled, TimedOutError when it has not ended in time.
        """
        ended: TrainingJob = Waiting(timeout_s).looking()(self.training_job, job_id)
        return succeeded(ended)

    def alias(self, name: str, alias: str = "champion") -> Alias:
        """Where an alias points, with the `etag` that a move wants; raises NotFoundError. Needs no token."""
        return self._answer(calls.alias(name, alias))

    def alias_history(self, name: str, alias: str = "champion") -> list[Alias]:
        """Every move of an alias, newest first; raises NotFoundError. Needs no token."""
        return self._answer(calls.alias_history(name, alias))

    def move_alias(
        self, name: str, alias: str, version: int, reason: str, *, expected: Alias | str | None = None
    ) -> Alias:
        """Points an alias to a published version; predictions follow within two seconds.

        `expected` is the alias as it was read, or its `etag`: needed unless the alias is new; `"*"` moves it from
        wherever it is. Raises ConflictError when it has moved since, or when `expected` is missing.
        """
        return self._answer(calls.move_alias(name, alias, version, reason, expected))

    def rollback_alias(
        self, name: str, alias: str = "champion", reason: str = "", *, expected: Alias | str | None = None
    ) -> Alias:
        """Takes the last move of an alias back; a second rollback goes one version further back.

        Raises ConflictError when there is nothing to go back to, or when it is not what was `expected`.
        """
        return self._answer(calls.rollback_alias(name, alias, reason, expected))
