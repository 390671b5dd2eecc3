"""Many runs in one table: one row per sample, with the scenario beside it.

Columns `slope_deg`, `mass_kg`, `torque_nm` and, if wanted, `run`, `set`, `horizon_s` label the rows; the others are
those of a run. Rows of one run need not be neighbours. Slope and torque may change within a run, and are then columns
of its rows. Without a column `run`, `runs_in_table` tells the runs apart.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from service.datasets.checks.candidate import Array
from service.datasets.checks.validate import check_entries
from service.datasets.columns import canonical_name
from service.datasets.file_names import shown
from service.datasets.findings import Code, Finding, UnusableFileError, reject
from service.datasets.intake import Intake
from service.datasets.readers.chrono_text import TextTable
from service.datasets.readers.runs_in_table import Rows, groups_of, runs_in_table
from service.datasets.run import MAX_RUNS
from service.datasets.run_table import SCENARIO_LIMITS, RunEntry, scenario_fault

TEXT_LABELS = ("run", "set")
NUMBER_LABELS = tuple(SCENARIO_LIMITS)
REQUIRED_LABELS = ("slope_deg", "mass_kg", "torque_nm")
MAY_CHANGE = ("slope_deg", "torque_nm")


@dataclass(frozen=True, slots=True, eq=False)
class Texts:
    """A column of texts: `codes` (row,) are indices into `values`."""

    codes: npt.NDArray[np.int64]
    values: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class LongTable:
    """`table` holds the columns that are no labels; `numbers` (row,) and `texts` are labels by name."""

    table: TextTable
    numbers: Mapping[str, Array]
    texts: Mapping[str, Texts]


def label_of(header: str) -> str | None:
    """The label that a header cell names ("Slope (deg)", "run"), or None for a column of the runs."""
    text = re.sub(r"[^a-z0-9]+", "_", header.strip().strip("\"'").lower()).strip("_").replace("n_m", "nm")
    name = canonical_name(text) if canonical_name(text) in MAY_CHANGE else text
    return name if name in (*TEXT_LABELS, *NUMBER_LABELS) else None


def is_long(names: Sequence[str] | None) -> bool:
    """Whether a table with this header says by itself which scenario its rows belong to."""
    return any(label_of(name) in REQUIRED_LABELS for name in names or ())


def take_runs(
    intake: Intake,
    long: LongTable,
    time_s: Array,
    *,
    file: str,
    given: Mapping[str, float],
    set_name: str,
    zero_start: bool = False,
) -> list[str]:
    """Hand every run of the table to `intake`; `time_s` (row,) is its time column, `given` and `set_name` stand for
    labels that it does not have. With `zero_start` runs may begin at any time.

    Returns what each run is called in findings, `file#run`. Raises UnusableFileError when a scenario is not told at
    all or there are too many runs.
    """
    missing = [name for name in REQUIRED_LABELS if name not in long.numbers and name not in given]
    if missing:
        message = "no such column, and no such field in the form; give one of them"
        raise UnusableFileError([reject(file, Code.SCENARIO_MISSING, message, column=name) for name in missing])
    groups = _by_run(long.texts["run"]) if "run" in long.texts else _by_scenario(long, time_s, zero_start)
    if len(groups) > MAX_RUNS:
        message = f"{len(groups)} runs, allowed are 1..{MAX_RUNS}: does the scenario change within a run?"
        raise UnusableFileError([reject(file, Code.TOO_MANY_FILES, message)])
    entries: list[tuple[RunEntry, str, Rows]] = []
    offered: dict[str, None] = {}
    for name, rows in groups:
        entry, faults = _entry(long, name, rows, file, given, set_name, offered)
        offered[entry.file] = None
        intake.findings += faults
        if not faults:
            entries.append((entry, entry.file.removeprefix(f"{file}#"), rows))
    between = [replace(finding, file=file) for finding in check_entries([entry for entry, _, _ in entries])]
    intake.findings += between
    if not any(finding.rejects for finding in between):
        for entry, name, rows in entries:
            # what does not change is told by the entry
            inputs = {label: long.numbers[label][rows] for label in MAY_CHANGE if getattr(entry, label) is None}
            intake.take(entry, name, partial(_rows_of, long.table, rows), inputs)
    return list(offered)


def _by_run(run: Texts) -> list[tuple[str, Rows]]:
    groups = groups_of(run.codes)
    return [(run.values[run.codes[rows[0]]], rows) for rows in groups]


def _by_scenario(long: LongTable, time_s: Array, zero_start: bool) -> list[tuple[str, Rows]]:
    changing = [column for label, column in long.numbers.items() if label in MAY_CHANGE]
    labels = (column for label, column in long.numbers.items() if label not in MAY_CHANGE)
    fixed: list[npt.NDArray[Any]] = [*labels, *(texts.codes for texts in long.texts.values())]
    return [("", rows) for rows in runs_in_table(time_s, fixed, changing, may_change=not zero_start)]


def _entry(
    long: LongTable,
    name: str,
    rows: Rows,
    file: str,
    given: Mapping[str, float],
    set_name: str,
    taken: Collection[str],
) -> tuple[RunEntry, list[Finding]]:
    """The scenario of one run, and what is wrong with it."""
    first = int(rows[0])
    scenario = {**given, **{label: float(column[first]) for label, column in long.numbers.items()}}
    texts = long.texts.get("set")
    set_name = (texts.values[texts.codes[first]] if texts else "") or set_name
    slope, mass, torque = (scenario[label] for label in REQUIRED_LABELS)
    told = {label: None if _changes(long, label, rows) else scenario[label] for label in MAY_CHANGE}
    wanted = shown(name.strip()) or f"s{slope:g}_m{mass:g}_t{torque:g}"
    alternatives = (wanted if count == 1 else f"{wanted}_{count}" for count in itertools.count(1))
    label = next(f"{file}#{each}" for each in alternatives if f"{file}#{each}" not in taken)
    line = int(long.table.lines[first])
    faults = list(_faults(long, rows, label))
    horizon = scenario.get("horizon_s")
    entry = RunEntry(label, shown(set_name.strip()), told["slope_deg"], mass, told["torque_nm"], horizon, None, line)
    return entry, faults


def _changes(long: LongTable, label: str, rows: Rows) -> bool:
    values = long.numbers[label][rows] if label in long.numbers else np.zeros(1)
    return bool((values != values[0]).any())


def _faults(long: LongTable, rows: Rows, label: str) -> Iterator[Finding]:
    """Labels that are no scenario, or not the same in all rows of the run, but for slope and torque."""
    line = int(long.table.lines[rows[0]])
    columns: dict[str, npt.NDArray[Any]] = dict(long.numbers)
    if "set" in long.texts:
        columns["set"] = long.texts["set"].codes
    for name, column in columns.items():
        values = column[rows]
        if name in MAY_CHANGE and _changes(long, name, rows):
            continue
        fault = scenario_fault(name, float(values[0])) if name in SCENARIO_LIMITS else None
        if fault is not None:
            yield reject(label, *fault, row=line, column=name)
        elif (values != values[0]).any():
            at = int(rows[np.flatnonzero(values != values[0])[0]])
            message = f"is another than in the run's first row; within a run only {' and '.join(MAY_CHANGE)} may change"
            yield reject(label, Code.SCENARIO_VARIES, message, row=int(long.table.lines[at]), column=name)


def _rows_of(table: TextTable, rows: Rows) -> TextTable:
    together = len(rows) == rows[-1] - rows[0] + 1
    chosen: slice | Rows = slice(int(rows[0]), int(rows[-1]) + 1) if together else rows
    return TextTable(table.names, tuple(column[chosen] for column in table.columns), table.lines[chosen])
