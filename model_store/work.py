"""Work files of jobs, `jobs/<job id>/<file>`: state kept between two steps, removed when the job ends."""

from __future__ import annotations

from model_store import layout
from model_store.backend import Backend
from model_store.files import FileEntry, read_verified


class WorkFiles:
    """The part of the store under `jobs`. `ModelStore` documents each method."""

    def __init__(self, backend: Backend) -> None:
        self._backend = backend

    def put(self, job: str, file: str, data: bytes) -> FileEntry:
        """Write or replace a file."""
        self._backend.replace(layout.work_file(job, file), data)
        return FileEntry.of(data)

    def read(self, job: str, file: str, entry: FileEntry) -> bytes:
        """Read a file, verified."""
        return read_verified(self._backend, layout.work_file(job, file), entry)

    def names(self, job: str) -> list[str]:
        """Sorted names of a job's files."""
        return sorted(self._backend.keys(layout.work_prefix(job)))

    def remove(self, job: str, file: str | None = None) -> None:
        """Remove one file or all of a job."""
        for name in self.names(job) if file is None else [file]:
            self._backend.remove(layout.work_file(job, name))

    def jobs(self) -> list[str]:
        """Sorted ids of the jobs that have files."""
        # by their files: a directory keeps empty folders
        found = {key.partition("/")[0] for key in self._backend.keys(layout.WORK_ROOT) if "/" in key}
        return sorted(name for name in found if layout.is_job_id(name))
