"""A folder of Chrono runs becomes a dataset in the store."""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping

from model_store import DatasetDraft, DatasetRecord, ModelStore
from service.datasets import ValidationReport, dataset_id, read_folder, to_parquet
from service.datasets.folder import Progress

RUNS_FILE = "runs.parquet"
PASSPORT_FILE = "passport.json"


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
    progress: Progress | None = None,
) -> tuple[DatasetRecord, ValidationReport]:
    """Read, validate and publish the runs of a folder; the same runs twice are the same dataset.

    Values are rounded to the digits that `service.datasets.columns` states (0.1 micrometre for positions); no sample
    is left out. Raises what `read_folder` and `ModelStore.put_dataset` raise.
    """
    dataset, report = read_folder(folder, sets=sets, strict=strict, column_map=column_map, name=name, progress=progress)
    identity = dataset_id(dataset)
    files = {RUNS_FILE: to_parquet(dataset), PASSPORT_FILE: dataset.passport.canonical_json().encode()}
    draft = DatasetDraft(
        name=name,
        created_by=created_by,
        description=description,
        summary=report.summary.as_json() if report.summary else {},
        source={"files": list(report.accepted), "rejected": list(report.rejected)},
    )
    known = identity in store.dataset_ids()
    return (store.dataset(identity) if known else store.put_dataset(identity, files, draft)), report
