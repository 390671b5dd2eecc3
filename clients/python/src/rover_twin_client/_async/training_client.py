"""The operator's calls: datasets, training jobs, aliases and versions."""

from __future__ import annotations

import os
import uuid
from collections.abc import AsyncIterator, Iterable, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import BinaryIO

from tenacity import AsyncRetrying

from rover_twin_client import training_calls as calls
from rover_twin_client._async.connection import AsyncConnection
from rover_twin_client.following import Following, Waiting, succeeded
from rover_twin_client.progress import Progress, reporting
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
    VersionState,
)


class AsyncTrainingClient(AsyncConnection):
    """Datasets, training jobs, aliases and versions. Every call needs `token`, of scope admin where it changes things.

    Those that read an alias or the state of a version need none.

    A call without the token, or with a wrong one, raises NotAllowedError.
    """

    async def upload_dataset(
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
        frame: str | None = None,
        reference: str | None = None,
        start: str | float | None = None,
        passport: Mapping[str, object] | None = None,
        strict: bool = False,
        dry_run: bool = False,
        filename: str | None = None,
    ) -> Upload:
        """Uploads Chrono runs: a zip or tar with `runs.csv` and `passport.json`, a long CSV, Parquet, or one plain run.

        `file` is a path or an open binary file. An open file is sent from its beginning. The client never holds a
        whole file in memory. `slope_deg`, `mass_kg`, `torque_nm` (motor stall torque per wheel) and `horizon_s` fill in
        what the files do not say. `column_map` is the name of a preset, or a mapping that says which column is which.
        `frame` (slope, world, slope-downhill, world-downhill), `reference` (rear-wheel, front-wheel, chassis) and
        `start` (first-row, or a time in seconds) say how the runs were recorded. `dry_run` checks the file and stores
        nothing. `strict` refuses the whole upload when one run is unusable. The same content is always the same
        dataset, so an upload may be repeated.

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
            frame=frame,
            reference=reference,
            start=start,
            passport=passport,
            strict=strict,
            dry_run=dry_run,
        )
        with ExitStack() as opened:
            stream = opened.enter_context(Path(file).open("rb")) if isinstance(file, str | os.PathLike) else file
            sent_as = filename or Path(str(getattr(stream, "name", "upload"))).name
            # a stream that cannot be rewound can be sent only once
            return await self._answer(calls.upload(fields, retried=stream.seekable()), {"file": (sent_as, stream)})

    async def datasets(self) -> list[DatasetInfo]:
        """Lists every dataset, in the order of the ids."""
        found: list[DatasetInfo] = []
        more = True
        while more:
            page, more = await self._answer(calls.datasets(found[-1].id if found else None))
            found += page
            more = more and bool(page)
        return found

    async def dataset(self, reference: str) -> Dataset:
        """Describes a dataset. `reference` is its name, its id, or a unique start of the id (6 digits or more).

        Raises NotFoundError.
        """
        return await self._answer(calls.dataset(reference))

    async def preview_dataset(self, reference: str, form: PreviewFormat = "svg") -> bytes:
        """Returns a figure of the runs and scenarios of a dataset, as SVG or PNG; raises NotFoundError."""
        return await self._answer(calls.preview(reference, form))

    async def download_dataset(self, reference: str, path: str | os.PathLike[str]) -> Path:
        """Writes the runs of a dataset to the file `path` as Parquet, one row per sample; raises NotFoundError.

        The file appears only when it is complete and has the digest that the service sent. It replaces an older file.
        """
        return await self._save(calls.download(reference), Path(path))

    async def delete_dataset(self, identity: str) -> None:
        """Deletes a dataset by its whole id; raises ConflictError while a version or a job uses it."""
        await self._answer(calls.delete_dataset(identity))

    async def start_training_job(
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
        """Queues a job that trains a new version of `model` on stored datasets (ids or names).

        All runs at `test_slopes_deg` are kept for testing, and the share `test_fraction` of the other runs. The
        service has a default for every argument that is None. `promote="if_better"` moves the alias champion to the new
        version when the error on unseen runs falls by the share `margin`.

        A job is never queued twice. Each call has its own key, and the client repeats the call under this key when the
        connection breaks. Give an `idempotency_key` when another process must be able to repeat the call.

        Raises InvalidInputError when the job cannot work, QueueFullError when too many jobs wait.
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
        return await self._answer(calls.start(request, idempotency_key or str(uuid.uuid4())))

    async def training_job(self, job_id: str) -> TrainingJob:
        """Returns the state of a job, and its result when it has one; raises NotFoundError."""
        return await self._answer(calls.job(job_id))

    async def training_jobs(
        self,
        *,
        state: JobState | None = None,
        model: str | None = None,
        limit: int = 50,
        before: str | None = None,
    ) -> list[TrainingJob]:
        """Lists at most `limit` (1 to 500) jobs, newest first.

        With `before`, only those older than the job of that id are listed.
        """
        return await self._answer(calls.jobs(state=state, model=model, limit=limit, before=before))

    async def cancel_training_job(self, job_id: str) -> TrainingJob:
        """Cancels a job that waits or runs. It stops within seconds. Raises ConflictError when it has ended."""
        return await self._answer(calls.cancel(job_id))

    def job_events(self, job_id: str, after: int | None = None) -> AsyncIterator[JobEvent]:
        """Yields the events of a job as they happen, each one once, until the job has ended.

        It starts with the first event, or with the one that follows the number `after`. When the connection breaks,
        the client connects again and continues from there. It gives up after a minute without success. Raises
        NotFoundError.
        """
        return self._follow(calls.events_path(job_id), Following(after, self._retries))

    async def wait_for_job(self, job_id: str, timeout_s: float = 3600.0, *, progress: Progress = False) -> TrainingJob:
        """Waits until a job has succeeded, and returns it. The service may restart meanwhile.

        `progress` is that of `predict_batch`: it counts percents.

        Raises TrainingFailedError when the job failed or was cancelled, TimedOutError when it has not ended in time.
        """
        with reporting(progress, 100, "percent") as report:
            waiting = Waiting(timeout_s, report)
            ended: TrainingJob = await waiting.looking(AsyncRetrying)(self.training_job, job_id)
        return succeeded(ended)

    async def alias(self, name: str, alias: str = "champion") -> Alias:
        """Returns where an alias points, and its `etag` for `move_alias`; raises NotFoundError. Needs no token."""
        return await self._answer(calls.alias(name, alias))

    async def alias_history(self, name: str, alias: str = "champion") -> list[Alias]:
        """Lists every move of an alias, newest first; raises NotFoundError. Needs no token."""
        return await self._answer(calls.alias_history(name, alias))

    async def move_alias(
        self, name: str, alias: str, version: int, reason: str, *, expected: Alias | str | None = None
    ) -> Alias:
        """Points an alias to a published version; predictions follow within two seconds.

        `expected` is the alias as the caller last read it, or its `etag`. `"*"` moves the alias from wherever it is.
        Only a new alias needs no `expected`. Raises ConflictError when the alias has moved since, or when `expected` is
        missing.
        """
        return await self._answer(calls.move_alias(name, alias, version, reason, expected))

    async def rollback_alias(
        self, name: str, alias: str = "champion", reason: str = "", *, expected: Alias | str | None = None
    ) -> Alias:
        """Undoes the last move of an alias; a second rollback goes one version further back.

        `expected` is as for `move_alias`: the alias as the caller last read it, its `etag`, or `"*"`. Raises
        ConflictError when there is no version to go back to, when the alias is not what was `expected`, and without it.
        """
        return await self._answer(calls.rollback_alias(name, alias, reason, expected))

    async def version_state(self, name: str, version: int) -> VersionState:
        """Returns whether a version is published, archived or deleted; raises NotFoundError. Needs no token."""
        return await self._answer(calls.version_state(name, version))

    async def archive_version(self, name: str, version: int, reason: str = "") -> VersionState:
        """Takes a version out of use; everything of it is kept. Archiving it again changes nothing.

        Raises ConflictError while an alias names it, NotFoundError for one that was deleted.
        """
        return await self._answer(calls.change_version(name, version, "archive", reason))

    async def restore_version(self, name: str, version: int, reason: str = "") -> VersionState:
        """Brings an archived version back into use; raises NotFoundError for one that was deleted."""
        return await self._answer(calls.change_version(name, version, "restore", reason))

    async def delete_version(self, name: str, version: int, reason: str = "") -> VersionState:
        """Removes the weights of a version for good; its manifest stays. Its number is never used again.

        Raises ConflictError while an alias names it.
        """
        return await self._answer(calls.delete_version(name, version, reason))
