"""A stored dataset as a folder of text files that `datasets import` reads back to the same dataset."""

from __future__ import annotations

import csv
import gzip
import io
import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import pyarrow as pa
from pyarrow import csv as arrow_csv

from model_store import ModelStore
from service.cli.failures import UsageError
from service.cli.views.file_progress import Report
from service.datasets import Dataset, Run, dataset_id, read_folder, read_parquet
from service.datasets.file_names import folded, name_fault, run_name, shown
from service.datasets.passport import PASSPORT_FILE
from service.datasets.readers.folder import names_of_files
from service.datasets.run_table import as_listed
from service.errors import DatasetError
from service.training.stored_dataset import RUNS_FILE

# Our files have canonical headers, whatever the files looked like that a passport's own column map describes.
_OUR_COLUMNS = "rover-twin"
_COMPRESSION = 6


@dataclass(frozen=True, slots=True)
class Exported:
    """How many runs were written, and the column map that the import needs, if any."""

    runs: int
    column_map: str | None


def export_folder(store: ModelStore, identity: str, folder: Path, progress: Report) -> Exported:
    """Write dataset `identity` to a new `folder`, which appears only once it has been read back to the same id.

    Raises UsageError when the folder exists, DatasetError when the runs cannot be told in this form, and what the
    store raises.
    """
    if folder.exists():
        raise UsageError(f"{folder} exists already; name a folder that does not")
    dataset = read_parquet(store.read_dataset_file(identity, RUNS_FILE))
    files = _files_of(dataset)
    folder.parent.mkdir(parents=True, exist_ok=True)
    beside = Path(tempfile.mkdtemp(prefix=f".{folder.name}.", dir=folder.parent))
    try:
        (beside / PASSPORT_FILE).write_bytes(store.read_dataset_file(identity, PASSPORT_FILE))
        _write_runs(dataset, files, beside, progress)
        column_map = _OUR_COLUMNS if dataset.passport.column_map is not None else None
        back, _ = read_folder(beside, column_map=column_map, strict=True)
        if dataset_id(back) != identity:
            raise DatasetError(
                f"the runs of dataset {identity} do not read back the same from text; nothing is exported"
            )
        beside.chmod(0o755)
        beside.rename(folder)
    finally:
        shutil.rmtree(beside, ignore_errors=True)
    return Exported(len(dataset.runs), column_map)


def _write_runs(dataset: Dataset, files: Sequence[str], folder: Path, progress: Report) -> None:
    (folder / "runs").mkdir()
    (folder / "runs.csv").write_text(_run_table(dataset.runs, files), encoding="utf-8")
    for done, (run, file) in enumerate(zip(dataset.runs, files, strict=True)):
        progress(done, len(files), file)
        path = folder / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(gzip.compress(_text(run), _COMPRESSION, mtime=0))


def _files_of(dataset: Dataset) -> list[str]:
    """A file within the folder for each run: called as the run, where the import then finds that name, else counted.

    Raises DatasetError for a name that no import takes.
    """
    names = [run.name for run in dataset.runs]
    files = [_file_of(run) for run in dataset.runs]
    alike = len(set(map(folded, files))) < len(files)
    if not alike and all(map(_is_plain, files)) and list(names_of_files(files).values()) == names:
        return files
    for name in names:
        kept, unsafe = run_name(name)
        if unsafe is not None or kept != name:
            why = unsafe or f"would be read back as {shown(kept)!r}"
            raise DatasetError(f"the name of run {shown(name)!r} {why}; nothing is exported")
    return [f"runs/{count:05d}.csv.gz" for count in range(1, len(names) + 1)]


def _is_plain(file: str) -> bool:
    """Whether the file lies where its name says, on every system, and is listed by this very name."""
    plain = as_listed(PurePosixPath(file.strip()).as_posix()) == file and file.isprintable()
    return plain and name_fault(file, path_length=512, depth=16) is None


def _file_of(run: Run) -> str:
    """The import names a run after its file without .gz, .csv, .txt and .dat: a name that ends so needs one more."""
    ending = ".dat" if run.name.endswith((".txt", ".dat")) else ".csv.gz"
    return f"runs/{run.name}{ending}"


def _run_table(runs: Sequence[Run], files: Sequence[str]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    # the import calls a run after its file, unless there is a column run
    named = files != [_file_of(run) for run in runs]
    writer.writerow(["file", *(["run"] if named else []), "set", "slope_deg", "mass_kg", "torque_nm", "horizon_s"])
    for run, file in zip(runs, files, strict=True):
        writer.writerow([file, *([run.name] if named else []), run.set_name, *map(repr, run.scenario)])
    return text.getvalue()


def _text(run: Run) -> bytes:
    """CSV with canonical headers; numbers are the shortest decimals that read back as the same float64."""
    sink = io.BytesIO(",".join(run.columns).encode() + b"\n")
    sink.seek(0, io.SEEK_END)
    arrow_csv.write_csv(pa.table(dict(run.columns)), sink, arrow_csv.WriteOptions(include_header=False))
    return sink.getvalue()
