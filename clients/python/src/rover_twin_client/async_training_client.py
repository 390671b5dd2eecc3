"""The operator's words of the asynchronous client: those of `training_client`, awaited."""

from __future__ import annotations

import os
import uuid
from collections.abc import AsyncIterator, Iterable, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import BinaryIO

from rover_twin_client import training_calls as calls
from rover_twin_client.async_connection import AsyncConnection
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


class AsyncTrainingClient(AsyncConnection):
    """Datasets, training jobs and aliases. Every call but reading an alias needs `token`.

    Without it, or with a wrong one, they raise NotAllowedError.
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
        passport: Mapping[str, object] | None = None,
        strict: bool = False,
        dry_run: bool = False,
        filename: str | None = None,
    ) -> Upload:
        """Sends Chrono runs: a zip or tar with `runs.csv` and `passport.json`, a long CSV, Parquet, or one plain run.

        Arguments, units and errors are those of `RoverTwin.upload_dataset`.
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
            return await self._answer(calls.upload(fields, retried=stream.seekable()), {"file": (sent_as, stream)})

    async def datasets(self) -> list[DatasetInfo]:
        """Every dataset, in the order of the ids."""
        found: list[DatasetInfo] = []
        more = True
        while more:
            page, more = await self._answer(calls.datasets(found[-1].id if found else None))
            found += page
            more = more and bool(page)
        return found

    async def dataset(self, reference: str) -> Dataset:
        """One dataset by its id, a unique start of it (6 digits or more) or its name; raises NotFoundError."""
        return await self._answer(calls.dataset(reference))

    async def preview_dataset(self, reference: str, form: PreviewFormat = "svg") -> bytes:
        """A figure of its runs and scenarios, as SVG or PNG; raises NotFoundError."""
        return await self._answer(calls.preview(reference, form))

    async def download_dataset(self, reference: str, path: str | os.PathLike[str]) -> Path:
        """Writes its runs to the file `path` as Parquet, one row per sample; raises NotFoundError.

        Arguments, units and errors are those of `RoverTwin.download_dataset`.
        """
        return await self._save(calls.download(reference), Path(path))

    async def delete_dataset(self, identity: str) -> None:
        """Deletes a dataset by its whole id; raises ConflictError while a version or a job names it."""
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
        """Queues the training of a new version of `model` on stored datasets (ids or names). Never queued twice.

        Arguments, units and errors are those of `RoverTwin.start_training_job`.
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
        """Where a job stands, and what came out of it; raises NotFoundError."""
        return await self._answer(calls.job(job_id))

    async def training_jobs(
        self,
        *,
        state: JobState | None = None,
        model: str | None = None,
        limit: int = 50,
        before: str | None = None,
    ) -> list[TrainingJob]:
        """Jobs, newest first: `limit` (1 to 500) of those older than the job with the id `before`."""
        return await self._answer(calls.jobs(state=state, model=model, limit=limit, before=before))

    async def cancel_training_job(self, job_id: str) -> TrainingJob:
        """Cancels a job that waits or runs; it stops within seconds. Raises ConflictError when it has ended."""
        return await self._answer(calls.cancel(job_id))

    def job_events(self, job_id: str, after: int | None = None) -> AsyncIterator[JobEvent]:
        """The job's events as they come, from the first one or after the one of number `after`, to its last.

        Arguments, units and errors are those of `RoverTwin.job_events`.
        """
        return self._follow(calls.events_path(job_id), Following(after, self._retries))

    async def wait_for_job(self, job_id: str, timeout_s: float = 3600.0) -> TrainingJob:
        """Waits until the job has succeeded, and bears a service that restarts meanwhile.

        Arguments, units and errors are those of `RoverTwin.wait_for_job`.
        """
        return succeeded(await Waiting(timeout_s).async_looking()(self.training_job, job_id))

    async def alias(self, name: str, alias: str = "champion") -> Alias:
        """Where an alias points, with the `etag` that a move wants; raises NotFoundError. Needs no token."""
        return await self._answer(calls.alias(name, alias))

    async def alias_history(self, name: str, alias: str = "champion") -> list[Alias]:
        """Every move of an alias, newest first; raises NotFoundError. Needs no token."""
        return await self._answer(calls.alias_history(name, alias))

    async def move_alias(
        self, name: str, alias: str, version: int, reason: str, *, expected: Alias | str | None = None
    ) -> Alias:
        """Points an alias to a published version; predictions follow within two seconds.

        Arguments, units and errors are those of `RoverTwin.move_alias`.
        """
        return await self._answer(calls.move_alias(name, alias, version, reason, expected))

    async def rollback_alias(
        self, name: str, alias: str = "champion", reason: str = "", *, expected: Alias | str | None = None
    ) -> Alias:
        """Takes the last move of an alias back; a second rollback goes one version further back.

        Arguments, units and errors are those of `RoverTwin.rollback_alias`.
        """
        return await self._answer(calls.rollback_alias(name, alias, reason, expected))
