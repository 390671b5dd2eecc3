"""`rover-twin datasets upload`: options become the form that the service takes, its rejections an exit code."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from model_store import ModelStore
from service.cli.actions.dataset_findings import tell_findings
from service.cli.failures import RefusedError, UsageError
from service.cli.views.file_progress import Report
from service.datasets import RejectedDatasetError
from service.datasets.passport import MAX_BYTES, passport_text
from service.datasets.uploads.upload_form import UploadForm
from service.training.dataset_import import import_upload
from service.training.stored_dataset import UploadResult


@dataclass(frozen=True, slots=True)
class Upload:
    """What was asked: a file, the fields of the form as options (None: not given), and whether to store."""

    file: Path
    fields: Mapping[str, Any]
    dry_run: bool


def upload(asked: Upload, store: ModelStore, actor: str, progress: Report) -> UploadResult:
    """Import the file. Raises RefusedError when it is rejected, UsageError for options that cannot be."""
    form = form_of(asked.fields)
    if not asked.file.is_file():
        raise UsageError(f"{asked.file} is no file; a folder is imported by `rover-twin datasets import`")
    try:
        return import_upload(
            store,
            asked.file,
            filename=asked.file.name,
            form=form,
            created_by=actor,
            dry_run=asked.dry_run,
            progress=progress,
        )
    except RejectedDatasetError as error:
        tell_findings(error.report.findings)
        raise RefusedError(str(error)) from error


def form_of(fields: Mapping[str, Any]) -> UploadForm:
    """Options as the form of an upload. Raises UsageError for a passport that is none."""
    given = {name: value for name, value in fields.items() if value is not None}
    if "passport" in given:
        given["passport"] = _passport(given["passport"])
    return UploadForm(**given)


def _passport(path: Path) -> dict[str, Any]:
    if path.stat().st_size > MAX_BYTES:
        raise UsageError(f"--passport {path} has {path.stat().st_size} bytes, allowed are at most {MAX_BYTES}")
    try:
        content = json.loads(passport_text(path.read_bytes()))
    except ValueError as error:
        raise UsageError(f"--passport {path} is not JSON: {error}") from error
    if not isinstance(content, dict):
        raise UsageError(f"--passport {path} is not a JSON object")
    return content
