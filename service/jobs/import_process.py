"""Importing an upload in a process of its own, with bounds on memory and time and with low priority.

Uploads are made by strangers and read by large libraries: what goes wrong in there ends a small process and not the
service, and what is slow in there yields to predictions. Only plain JSON crosses the border, in both directions.

`main` is that process: a request on stdin, an answer on stdout.
"""

from __future__ import annotations

import shutil
import signal
import sys
import tempfile
from pathlib import Path
from typing import Literal

import anyio
from pydantic import BaseModel, ConfigDict, ValidationError

import model_store
from model_store import ModelStore, StoreError
from service import child
from service.datasets import RejectedDatasetError, ValidationReport
from service.datasets.uploads.upload_form import UploadForm, UploadLimits
from service.errors import NO_ROOM, DatasetError, InvalidValueError, StorageFullError
from service.training.stored_dataset import UploadResult

_MAIN = "service.jobs.import_process:main"


class ImportLimits(BaseModel):
    """What one import may use. `memory_bytes` is address space beyond what the libraries take when loaded."""

    model_config = ConfigDict(frozen=True)

    memory_bytes: int = 4 << 30
    cpu_s: int = 600
    wall_s: int = 1800
    upload: UploadLimits = UploadLimits()


class _Request(BaseModel):
    store_url: str
    path: Path
    filename: str
    form: UploadForm
    created_by: str
    dry_run: bool
    workspace: Path
    limits: ImportLimits


class _Answer(BaseModel):
    """One of: a result; the reasons of a rejection; an error of ours by its name."""

    result: UploadResult | None = None
    report: ValidationReport | None = None
    error: Literal["rejected", "value", "dataset", "store", "memory", "full"] | None = None
    name: str = ""
    message: str = ""
    field: str = ""
    value: str = ""
    allowed: str = ""


async def import_in_process(
    store_url: str,
    path: Path,
    *,
    filename: str,
    form: UploadForm,
    created_by: str,
    dry_run: bool = False,
    workspace: Path | None = None,
    limits: ImportLimits | None = None,
) -> UploadResult:
    """`import_upload` in its own process. When the awaiting task is cancelled, the process is killed.

    Raises what `import_upload` raises, and DatasetError when the process ran out of memory or time or died. Whatever
    it unpacked below `workspace` is gone on every path.
    """
    bounds = limits or ImportLimits()
    try:
        folder = Path(tempfile.mkdtemp(prefix="import-", dir=workspace))
    except OSError as error:
        if error.errno not in NO_ROOM:
            raise
        raise StorageFullError(f"{filename} cannot be unpacked: {error.strerror}") from error
    request = _Request(
        store_url=store_url,
        path=path.absolute(),
        filename=filename,
        form=form,
        created_by=created_by,
        dry_run=dry_run,
        workspace=folder,
        limits=bounds,
    )
    try:
        done = await child.ask(_MAIN, request.model_dump_json().encode(), within_s=bounds.wall_s)
    except TimeoutError as error:
        raise DatasetError(f"reading {filename} took longer than {bounds.wall_s} s; {_SMALLER}") from error
    finally:
        with anyio.CancelScope(shield=True):
            await anyio.to_thread.run_sync(lambda: shutil.rmtree(folder, ignore_errors=True))
    return _unwrap(done.returncode, done.stdout, filename, bounds)


_SMALLER = "divide the runs over several uploads"


def _unwrap(code: int, output: bytes, filename: str, bounds: ImportLimits) -> UploadResult:
    """The answer as a result, or as the error that it tells of."""
    if code == -signal.SIGXCPU:
        raise DatasetError(f"reading {filename} took more than {bounds.cpu_s} s of processor time; {_SMALLER}")
    try:
        answer = _Answer.model_validate_json(output) if code == 0 else None
    except ValidationError:
        answer = None
    if answer is None:
        why = f"signal {-code}" if code < 0 else f"exit code {code}"
        raise DatasetError(f"reading {filename} ended its process ({why}): not a file that can be read safely")
    if answer.result is not None:
        return answer.result
    raise _error(answer, filename, bounds)


def _error(answer: _Answer, filename: str, bounds: ImportLimits) -> Exception:
    if answer.error == "rejected" and answer.report is not None:
        return RejectedDatasetError(answer.report, answer.message)
    if answer.error == "value":
        return InvalidValueError(answer.field, answer.value, answer.allowed)
    if answer.error == "store":
        return _store_error(answer)
    if answer.error == "memory":
        return DatasetError(f"reading {filename} needs more than {bounds.memory_bytes} bytes of memory; {_SMALLER}")
    if answer.error == "full":
        return StorageFullError(answer.message)
    return DatasetError(answer.message)


def _store_error(answer: _Answer) -> StoreError:
    found = getattr(model_store, answer.name, StoreError)
    kind = found if isinstance(found, type) and issubclass(found, StoreError) else StoreError
    return kind(answer.message)


# ---- the other side


def _serve(data: bytes) -> _Answer:
    # here, for the parent has no need of its libraries; and before the bounds, which count from what is loaded
    from service.training.dataset_import import import_upload  # noqa: PLC0415

    request = _Request.model_validate_json(data)
    child.restrain(cpu_s=request.limits.cpu_s, wall_s=request.limits.wall_s, memory_bytes=request.limits.memory_bytes)
    try:
        result = import_upload(
            ModelStore.open(request.store_url),
            request.path,
            filename=request.filename,
            form=request.form,
            created_by=request.created_by,
            dry_run=request.dry_run,
            limits=request.limits.upload,
            workspace=request.workspace,
        )
    except RejectedDatasetError as error:
        return _Answer(error="rejected", report=error.report, message=error.what)
    except InvalidValueError as error:
        return _Answer(error="value", field=error.field, value=str(error.value), allowed=error.allowed)
    except DatasetError as error:
        return _Answer(error="dataset", message=str(error))
    except StorageFullError as error:
        return _Answer(error="full", message=str(error))
    except OSError as error:
        if error.errno not in NO_ROOM:
            raise
        return _Answer(error="full", message=str(error.strerror))
    except StoreError as error:
        return _Answer(error="store", name=type(error).__name__, message=str(error))
    except MemoryError:
        return _Answer(error="memory")
    return _Answer(result=result)


def main() -> None:
    """Read one request, write one answer."""
    answer = _serve(child.given_task())
    sys.stdout.buffer.write(answer.model_dump_json().encode())
