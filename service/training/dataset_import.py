"""A folder of Chrono runs, or an uploaded file, becomes a dataset in the store."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path

from model_store import DatasetDraft, DatasetNameTakenError, DatasetRecord, ModelStore
from service.datasets import Dataset, ValidationReport, dataset_id, read_folder, read_parquet, summarise, to_parquet
from service.datasets.alignment import NOTHING_SAID, Alignment
from service.datasets.intake import Progress
from service.datasets.passport import PASSPORT_FILE
from service.datasets.thinning import thinned
from service.datasets.uploads.upload import read_upload
from service.datasets.uploads.upload_form import UploadForm, UploadLimits
from service.errors import DatasetError
from service.training.stored_dataset import RUNS_FILE, UploadResult

_LONGEST_NAME, _DIGITS = 63, 12
_LISTED = 1000  # a record is a small document: names of at most so many files


def import_folder(
    store: ModelStore,
    folder: str | os.PathLike[str],
    *,
    name: str,
    created_by: str,
    description: str = "",
    sets: Collection[str] | None = None,
    strict: bool = False,
    column_map: str | Mapping[str, str | int] | None = None,
    said: Alignment = NOTHING_SAID,
    step_s: float | None = None,
    progress: Progress | None = None,
) -> tuple[DatasetRecord, ValidationReport]:
    """Read, validate and publish the runs of a folder; the same runs twice are the same dataset.

    Values are rounded to the digits that `service.datasets.columns` states (0.1 micrometre for positions); no sample
    is rejected. `said` tells how the runs were recorded. With `step_s` at most one row per so many seconds is kept,
    once all of them are checked (see `service.datasets.thinning`). Raises what `read_folder`, `thinned`,
    `ModelStore.put_dataset` and `require_dataset_name` raise.
    """
    dataset, report = read_folder(
        folder, sets=sets, strict=strict, column_map=column_map, said=said, name=name, progress=progress
    )
    if step_s is not None:
        dataset = thinned(dataset, step_s)
        report = replace(report, summary=summarise(dataset))
    store.require_dataset_name(dataset_id(dataset), name)
    record, _ = _publish(store, dataset, report, created_by, description)
    store.name_dataset(record.id, name, created_by=created_by)
    return record, report


def import_upload(
    store: ModelStore,
    path: Path,
    *,
    filename: str,
    form: UploadForm,
    created_by: str,
    dry_run: bool = False,
    limits: UploadLimits | None = None,
    workspace: Path | None = None,
    progress: Progress | None = None,
) -> UploadResult:
    """Read, validate and publish an uploaded file; with `dry_run` only say what would be.

    The same content is the same dataset whatever its file format and name: put again under another name it is stored
    once and has both names. A name that finds another dataset is refused. `filename` is what the sender calls it,
    for messages only. Whatever is unpacked goes to a folder of its own below `workspace` (the system's temporary
    folder, if not given) and is removed on return. Raises RejectedDatasetError with the report, InvalidValueError for
    a column map that is not allowed, and what `ModelStore.put_dataset` raises.
    """
    with tempfile.TemporaryDirectory(prefix="upload-", dir=workspace) as unpacked:
        dataset, report = read_upload(
            path,
            filename=filename,
            workspace=Path(unpacked),
            form=form,
            limits=limits or UploadLimits(),
            progress=progress,
        )
    identity = dataset_id(dataset)
    if form.name is not None:
        store.require_dataset_name(identity, form.name)
    else:
        dataset = replace(dataset, name=_free_name(store, identity, dataset.name))
    if dry_run:
        known = _known(store, identity)
        names = tuple(store.dataset_names(known)) if known else ()
        return UploadResult(identity, False, known, report, names, known.name if known else None)
    record, created = _publish(store, dataset, report, created_by, form.description)
    names = () if created else tuple(store.dataset_names(record))
    if form.name is not None:  # one that is made of the file's name is no wish
        store.name_dataset(record.id, form.name, created_by=created_by)
    return UploadResult(record.id, created, record, report, names, form.name or record.name)


def _free_name(store: ModelStore, identity: str, name: str) -> str:
    """A name that was made of the file's name, told apart from that of another dataset by the id."""
    try:
        store.require_dataset_name(identity, name)
    except DatasetNameTakenError:
        return f"{name[: _LONGEST_NAME - 1 - _DIGITS]}-{identity[:_DIGITS]}"
    return name


def _known(store: ModelStore, identity: str) -> DatasetRecord | None:
    return store.dataset(identity) if identity in store.dataset_ids() else None


def _publish(
    store: ModelStore, dataset: Dataset, report: ValidationReport, created_by: str, description: str
) -> tuple[DatasetRecord, bool]:
    """The record, and whether it is new."""
    identity = dataset_id(dataset)
    draft = DatasetDraft(
        name=dataset.name,
        created_by=created_by,
        description=description,
        summary=report.summary.as_json() if report.summary else {},
        source={"files": list(report.accepted[:_LISTED]), "rejected": list(report.rejected[:_LISTED])},
    )
    if (known := _known(store, identity)) is not None:
        return known, False
    files = {RUNS_FILE: _runs_file(dataset, identity), PASSPORT_FILE: dataset.passport.canonical_json().encode()}
    return store.offer_dataset(identity, files, draft)


def _runs_file(dataset: Dataset, identity: str) -> bytes:
    """The same bytes for the same content: no name, and runs in order of theirs.

    So two who import the same runs under different names, one of them perhaps killed half way, do not meet each
    other's bytes. What was written is read back before anybody relies on it.
    """
    ordered = replace(dataset, name=identity[:12], runs=tuple(sorted(dataset.runs, key=lambda run: run.name)))
    data = to_parquet(ordered)
    if dataset_id(read_parquet(data)) != identity:
        raise DatasetError(f"the runs of dataset {identity} do not read back the same; nothing is stored")
    return data
