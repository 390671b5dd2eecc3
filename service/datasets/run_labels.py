"""Which runs a Parquet file of ours holds, told by its footer alone: no sample is decoded."""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import Any

import pyarrow as pa
from pyarrow import parquet as pq

from service.errors import DatasetError


@dataclass(frozen=True, slots=True)
class RunLabel:
    """One run of a dataset; `slope_deg` is None where the slope changes within the run."""

    name: str
    slope_deg: float | None


def read_run_labels(data: bytes) -> tuple[RunLabel, ...]:
    """Every run in the order of the file. A row group is a run (see `parquet`), so its statistics name it.

    Raises DatasetError for what is no such file.
    """
    try:
        meta = pq.ParquetFile(io.BytesIO(data)).metadata
        names = meta.schema.names
        run, slope = names.index("run"), names.index("slope_deg")
        groups = [meta.row_group(index) for index in range(meta.num_row_groups)]
        return tuple(RunLabel(str(_only(group, run)), _slope(group, slope)) for group in groups)
    except (pa.ArrowException, OSError, ValueError) as error:
        raise DatasetError(f"not a readable Parquet file of runs: {error}") from error


def _slope(group: pq.RowGroupMetaData, column: int) -> float | None:
    found = group.column(column).statistics
    if found is not None and found.has_min_max and found.min != found.max:
        return None
    return float(_only(group, column)) + 0.0  # the statistics of a zero are minus zero


def _only(group: pq.RowGroupMetaData, column: int) -> Any:  # noqa: ANN401 - a text or a number
    """The one value of a column that is constant in this row group."""
    found = group.column(column).statistics
    if found is None or not found.has_min_max or found.min != found.max:
        raise DatasetError(f"the footer does not tell the one {group.column(column).path_in_schema} of a row group")
    return found.min
