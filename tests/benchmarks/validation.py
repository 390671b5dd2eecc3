"""Time and memory of validating a folder of long runs: `python -m tests.benchmarks.validation [runs]`.

`rover-twin datasets validate` reads runs of 20,001 rows and seven columns as Chrono would write them. They are the runs
of the shipped set `paper`, each stretched by another half per mille, so that no two are the same: made for their size,
not to learn from.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from pathlib import Path

import pyarrow as pa
from pyarrow import csv

from model_store import ModelStore
from service.datasets import Run, read_parquet
from service.training.stored_dataset import RUNS_FILE
from tests.benchmarks.report import table

_BATCHES = (10, 100)  # smaller folders before the whole one: memory is to stay as it is
_STRETCH = 0.0005


def write_folder(folder: Path, count: int) -> int:
    """passport.json, runs.csv and `count` files; returns their bytes."""
    store = ModelStore.open("model_store", create=False)
    dataset = read_parquet(store.read_dataset_file(store.dataset("paper").id, RUNS_FILE))
    (folder / "passport.json").write_text(dataset.passport.model_dump_json())
    lines = ["file,slope_deg,mass_kg,torque_nm,horizon_s"]
    for index in range(count):
        run = dataset.runs[index % len(dataset.runs)]
        _write(folder / f"{index:05}.csv", run, 1.0 - _STRETCH * (index // len(dataset.runs)))
        slope = run.slope_deg + 0.001 * (index // len(dataset.runs))
        lines.append(f"{index:05}.csv,{slope:.3f},{run.mass_kg:g},{run.torque_nm:g},{run.horizon_s:g}")
    (folder / "runs.csv").write_text("\n".join(lines) + "\n")
    return sum(each.stat().st_size for each in folder.iterdir())


def _write(file: Path, run: Run, factor: float) -> None:
    moved = ("rear_x_m", "front_x_m", "speed_mps")
    columns = {name: column * factor if name in moved else column for name, column in run.columns.items()}
    if "front_x_m" in columns:
        columns["front_x_m"] += run.columns["front_x_m"][0] * (1.0 - factor)
    csv.write_csv(pa.table({name: column.round(7) for name, column in columns.items()}), file)


def validate(folder: Path) -> tuple[float, float, float, str]:
    """Seconds, processor seconds, most resident memory in MiB, and the last line, of the command."""
    program = Path(sys.executable).with_name("rover-twin")
    read, write = os.pipe()
    began = time.monotonic()
    process = os.posix_spawn(
        program,
        [str(program), "datasets", "validate", str(folder)],
        os.environ,
        file_actions=[(os.POSIX_SPAWN_DUP2, write, 1), (os.POSIX_SPAWN_CLOSE, read)],
    )
    os.close(write)
    with os.fdopen(read) as output:
        said = output.read().splitlines()
    _, status, used = os.wait4(process, 0)
    if os.waitstatus_to_exitcode(status):
        raise SystemExit("\n".join(said[-5:]))
    return time.monotonic() - began, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024, said[-1]


def main() -> None:
    """Prints a table."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    rows = []
    for runs in (*(each for each in _BATCHES if each < count), count):
        with tempfile.TemporaryDirectory() as folder:
            size = write_folder(Path(folder), runs)
            seconds, processor_s, memory_mib, said = validate(Path(folder))
        rows.append([f"{runs}", f"{size / 1e6:.0f}", f"{seconds:.1f}", f"{processor_s:.1f}", f"{memory_mib:.0f}", said])
    sys.stdout.write(table(["runs", "MB", "s", "processor s", "memory, MiB", "said"], rows) + "\n")


if __name__ == "__main__":
    main()
