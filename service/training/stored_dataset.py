"""A dataset in the store from outside: its files, and what became of an upload. Needs no library that reads them."""

from __future__ import annotations

from dataclasses import dataclass

from model_store import DatasetRecord
from service.datasets import ValidationReport

RUNS_FILE = "runs.parquet"


@dataclass(frozen=True, slots=True)
class UploadResult:
    """What became of an upload. `created` is False when the store had the dataset, and when nothing was to be stored;
    `record` is None when the store does not have it. `already_known_as` are its names before, none where it is new;
    `name` is the one that was asked for, if it has it now, else its first one.
    """

    dataset_id: str
    created: bool
    record: DatasetRecord | None
    report: ValidationReport
    already_known_as: tuple[str, ...] = ()
    name: str | None = None
