"""`rover-twin datasets validate`: the report of a folder, or of one file as an upload's dry run gives it."""

from __future__ import annotations

import tempfile
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from service.cli.actions.dataset_upload import form_of
from service.cli.failures import UsageError
from service.cli.views.file_progress import Report
from service.datasets import RejectedDatasetError, ValidationReport, validate_folder
from service.datasets.given import Given
from service.datasets.uploads.upload import read_upload


def validate(path: Path, fields: Mapping[str, Any], sets: Collection[str] | None, progress: Report) -> ValidationReport:
    """What can be used of a folder or a file, and why the rest cannot. `fields` are those of an upload's form.

    Raises UsageError for options that this kind of path does not have, DatasetError for a folder that is none of runs.
    """
    if not path.exists():
        raise UsageError(f"{path} does not exist; name a folder, or a file as it would be uploaded")
    if not path.is_dir() and not path.is_file():
        raise UsageError(f"{path} is no plain file (a pipe or a device); write it to a file first")
    form = form_of(fields)
    try:
        if path.is_dir():
            if form.passport is not None:
                raise UsageError(f"--passport goes with a file; the passport of {path} lies in it")
            given = Given(form.scenario(), form.set_name)
            said, mapping = form.said(), form.column_map
            return validate_folder(path, sets=sets, column_map=mapping, said=said, given=given, progress=progress)
        if sets is not None:
            raise UsageError("--set goes with a folder: it chooses among the sets of its runs.csv")
        with tempfile.TemporaryDirectory(prefix="validate-") as workspace:
            return read_upload(path, filename=path.name, workspace=Path(workspace), form=form, progress=progress)[1]
    except RejectedDatasetError as error:
        return error.report
