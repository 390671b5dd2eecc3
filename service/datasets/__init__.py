"""Chrono output as it really is, read into arrays with reasons for what is not usable, and kept compactly.

    dataset, report = read_folder("my-runs")        # passport.json, runs.csv, text files of Chrono
    data = to_parquet(dataset)                      # bytes of runs.parquet
    dataset = read_parquet(data, sets=["paper"])

Arrays out, reasons out. Knows no network, no store and no learning.

What reads and writes files is imported on its first use: it needs pyarrow, which a service that only predicts does not.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from service.datasets.columns import COLUMNS, Column
from service.datasets.digest import dataset_id
from service.datasets.findings import Code, Finding, Severity, UnusableFileError
from service.datasets.passport import Passport, parse_passport
from service.datasets.readers.column_map import PRESETS, ColumnMap
from service.datasets.report import RejectedDatasetError, ValidationReport
from service.datasets.run import Dataset, Run
from service.datasets.summary import DatasetSummary, summarise

if TYPE_CHECKING:
    from service.datasets.parquet import read_parquet, to_parquet, write_parquet
    from service.datasets.readers.folder import read_folder, validate_folder

_FILES = {
    "read_folder": "readers.folder",
    "read_parquet": "parquet",
    "to_parquet": "parquet",
    "validate_folder": "readers.folder",
    "write_parquet": "parquet",
}

__all__ = [
    "COLUMNS",
    "PRESETS",
    "Code",
    "Column",
    "ColumnMap",
    "Dataset",
    "DatasetSummary",
    "Finding",
    "Passport",
    "RejectedDatasetError",
    "Run",
    "Severity",
    "UnusableFileError",
    "ValidationReport",
    "dataset_id",
    "parse_passport",
    "read_folder",
    "read_parquet",
    "summarise",
    "to_parquet",
    "validate_folder",
    "write_parquet",
]


def __getattr__(name: str) -> Any:  # noqa: ANN401 - PEP 562
    if name not in _FILES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_FILES[name]}"), name)
