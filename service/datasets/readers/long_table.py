"""Many runs in one table: one row per sample, with the scenario beside it.

Columns `slope_deg`, `mass_kg`, `torque_nm` and, if wanted, `run`, `set`, `horizon_s` label the rows; the others are
those of a run. Rows of one run need not be neighbours. Slope and torque may change within a run, and are then columns
of its rows. Without a column `run`, `runs_in_table` tells the runs apart.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from service.datasets.alignment import FIRST_ROW, NOTHING_SAID, Alignment
from service.datasets.checks.labels import check_labels
from service.datasets.checks.times import MIN_ROWS
from service.datasets.checks.validate import check_entries
from service.datasets.columns import meaning_of
from service.datasets.file_names import run_name, shown
from service.datasets.findings import Code, Finding, UnusableFileError, reject, told_too, warn
from service.datasets.intake import Intake
from service.datasets.readers.column_map import ColumnMap, resolve
from service.datasets.readers.runs_in_table import Rows, groups_of, runs_in_table
from service.datasets.readers.table import Lines, Numbers, Samples, Table, Texts, gaps_in, numbers_if_any, samples_of
from service.datasets.run import MAX_RUNS
from service.datasets.run_table import SCENARIO_LIMITS, RunEntry, scenario_fault

TEXT_LABELS = ("run", "set")
NUMBER_LABELS = tuple(SCENARIO_LIMITS)
REQUIRED_LABELS = ("slope_deg", "mass_kg", "torque_nm")
MAY_CHANGE = ("slope_deg", "torque_nm")


@dataclass(frozen=True, slots=True, eq=False)
class LongTable:
    """`columns` are those of the runs, by canonical name; `numbers` and `texts` are labels by name. All are (row,).

    `checked` are columns of the demo `preset` that are to be compared with each other.
    """

    file: str
    columns: Mapping[str, Numbers]
    numbers: Mapping[str, Numbers]
    texts: Mapping[str, Texts]
    lines: Lines
    zero_start: bool
    noticed: tuple[Finding, ...]
    preset: str | None = None
    checked: Mapping[str | int, Numbers] = field(default_factory=dict)


def is_long(names: Sequence[str] | None) -> bool:
    """Whether a table with this header says by itself which run or scenario its rows belong to."""
    return any(meaning_of(name) in (*REQUIRED_LABELS, "run") for name in names or ())


def read_long(table: Table, column_map: ColumnMap | None, said: Alignment = NOTHING_SAID) -> LongTable:
    """Labels and the columns that runs have. A label without any value is as if absent, with a warning.

    Raises UnusableFileError for columns that are missing, twice there or hold something else, and for cells without a
    value in time or in `run`.
    """
    noticed = list[Finding]()
    try:
        return _read(table, column_map, said, noticed)
    except UnusableFileError as error:
        raise told_too(error, (*table.noticed, *noticed)) from error


def _read(table: Table, column_map: ColumnMap | None, said: Alignment, noticed: list[Finding]) -> LongTable:
    """`read_long`; adds to `noticed` what it sees before it fails."""
    file = table.file
    every = (*TEXT_LABELS, *NUMBER_LABELS)
    found = resolve(table.names, table.width, column_map, file=file, labels=every, front=said.is_of_front)
    noticed += found.findings
    named = {name: index for name, index in found.indices.items() if name not in TEXT_LABELS}
    columns = dict(zip(named, table.numbers(list(named.values()), flags=found.flags), strict=True))
    numbers = {name: columns.pop(name) for name in NUMBER_LABELS if name in columns}
    texts = {name: table.texts(found.indices[name]) for name in TEXT_LABELS if name in found.indices}
    empty = [name for name, label in (numbers | texts).items() if label.is_absent]
    message = "has no values, so it is as if absent"
    noticed += [warn(file, Code.EMPTY_COLUMN, message, column=name) for name in empty]
    texts = {name: label for name, label in texts.items() if name not in empty}
    gaps = list(gaps_in(columns["time_s"].blank, table.lines, file=file, column="time_s"))
    if "run" in texts:
        unnamed = np.array([not value.strip() for value in texts["run"].values])
        gaps += gaps_in(unnamed[texts["run"].codes], table.lines, file=file, column="run")
    if gaps:
        raise UnusableFileError(gaps)
    numbers = {name: label for name, label in numbers.items() if name not in empty}
    told = (*table.noticed, *noticed)
    zero_start = said.start == FIRST_ROW or (said.start is None and found.zero_start)
    checked = numbers_if_any(table, found.checked)
    return LongTable(file, columns, numbers, texts, table.lines, zero_start, told, found.preset, checked)


def take_runs(intake: Intake, long: LongTable, *, given: Mapping[str, float], set_name: str) -> list[str]:
    """Hand every run of the table to `intake`; `given` and `set_name` stand for labels that it does not have.

    With a column map that starts at zero runs may begin at any time. Returns what each run is called in findings,
    `file#run`. Raises UnusableFileError when a scenario is not told at all or there are too many runs.
    """
    file = long.file
    missing = [name for name in REQUIRED_LABELS if name not in long.numbers and name not in given]
    if missing:
        message = "no such column, and no such field in the form; give one of them"
        raise UnusableFileError([reject(file, Code.SCENARIO_MISSING, message, column=name) for name in missing])
    groups = _by_run(long.texts["run"]) if "run" in long.texts else _by_scenario(long)
    if len(groups) > MAX_RUNS:
        message = f"{len(groups)} runs, allowed are 1..{MAX_RUNS}: does the scenario change within a run?"
        raise UnusableFileError([reject(file, Code.TOO_MANY_FILES, message)])
    _require_order(long, [rows for _, rows in groups])
    called = Counter(run_name(name)[0] for name, _ in groups)
    entries: list[tuple[RunEntry, str, Rows]] = []
    offered: dict[str, None] = {}
    for name, rows in groups:
        label, entry, found = _entry(long, name, rows, given, set_name, offered)
        offered[label] = None
        about = (
            name_findings(name, label, row=int(long.lines[rows[0]]), times=called[run_name(name)[0]]) if name else []
        )
        intake.findings += [*found, *about]
        if entry is not None and not any(finding.rejects for finding in about):
            entries.append((entry, label.removeprefix(f"{file}#"), rows))
    between = [replace(finding, file=file) for finding in check_entries([entry for entry, _, _ in entries])]
    intake.findings += between
    if not any(finding.rejects for finding in between):
        for entry, name, rows in entries:
            intake.take(entry, name, partial(_samples, long, entry, rows))
    return list(offered)


def name_findings(name: str, label: str, *, row: int | None, times: int) -> list[Finding]:
    """What is to be said of a run's name that `times` runs of its file have; `label` is the run in findings."""
    kept, unsafe = run_name(name)
    if unsafe is not None:
        return [reject(label, Code.UNSAFE_PATH, f"the run's name {shown(name)!r} {unsafe}", row=row, column="run")]
    if times > 1:
        message = (
            f"{times} runs are called {shown(kept)!r}, once letters, spaces and \\ are written in one way; rename them"
        )
        return [reject(label, Code.DUPLICATE_NAME, message, row=row, column="run")]
    if kept != name:
        message = f"the run's name {shown(name)!r} is read as {shown(kept)!r}"
        return [warn(label, Code.RENAMED, message, row=row, column="run")]
    return []


def _require_order(long: LongTable, groups: Sequence[Rows]) -> None:
    """Without run names a new run begins where time goes back. Raises UnusableFileError where that cannot be meant."""
    short = [rows for rows in groups if len(rows) < MIN_ROWS]
    if "run" in long.texts or len(short) * 2 < len(groups) or len(short) < 2:
        return
    time_s = long.columns["time_s"].values
    back = np.flatnonzero(np.diff(time_s) < 0) + 1
    if len(back):
        at = int(back[0])
        message = (
            f"{time_s[at]:.9g} is earlier than the row before ({time_s[at - 1]:.9g}); {len(back)} such rows: without "
            "a column run, rows of one scenario must be in the order of time"
        )
        raise UnusableFileError(
            [reject(long.file, Code.TIME_BACKWARD, message, row=int(long.lines[at]), column="time_s")]
        )


def _samples(long: LongTable, entry: RunEntry, rows: Rows) -> Samples:
    """The rows of one run; slope and torque are columns of it where they change, else its entry tells them."""
    together = len(rows) == rows[-1] - rows[0] + 1
    chosen: slice | Rows = slice(int(rows[0]), int(rows[-1]) + 1) if together else rows
    columns = {name: column[chosen] for name, column in long.columns.items()}
    columns |= {label: long.numbers[label][chosen] for label in MAY_CHANGE if getattr(entry, label) is None}
    samples = samples_of(columns, long.lines[chosen], file=entry.file, zero_start=long.zero_start)
    checked = {name: column.values[chosen] for name, column in long.checked.items()}
    lies = check_labels(long.preset, columns["time_s"].values, checked, file=entry.file)
    return replace(samples, findings=(*lies, *samples.findings))


def _by_run(run: Texts) -> list[tuple[str, Rows]]:
    groups = groups_of(run.codes)
    return [(run.values[run.codes[rows[0]]], rows) for rows in groups]


def _by_scenario(long: LongTable) -> list[tuple[str, Rows]]:
    # nan differs from itself; cells without a value do not
    every = {label: np.nan_to_num(column.values, nan=1e300) for label, column in long.numbers.items()}
    changing = [column for label, column in every.items() if label in MAY_CHANGE]
    labels = (column for label, column in every.items() if label not in MAY_CHANGE)
    fixed: list[npt.NDArray[Any]] = [*labels, *(texts.codes for texts in long.texts.values())]
    time_s = long.columns["time_s"].values
    return [("", rows) for rows in runs_in_table(time_s, fixed, changing, may_change=not long.zero_start)]


def _entry(
    long: LongTable, name: str, rows: Rows, given: Mapping[str, float], set_name: str, taken: Collection[str]
) -> tuple[str, RunEntry | None, list[Finding]]:
    """What one run is called, its scenario (None where something is wrong with it), and what is wrong."""
    first = int(rows[0])
    labels = {label: column[rows] for label, column in long.numbers.items()}
    labels = {label: column for label, column in labels.items() if not column.is_absent}
    scenario = {**given, **{label: float(column.values[0]) for label, column in labels.items()}}
    texts = long.texts.get("set")
    set_name = (texts.values[texts.codes[first]] if texts else "") or set_name
    known = all(label in scenario for label in REQUIRED_LABELS)
    told = "s{slope_deg:g}_m{mass_kg:g}_t{torque_nm:g}".format(**scenario) if known else "unnamed"
    kept, unsafe = run_name(name) if name else (told, None)
    wanted = kept if unsafe is None else shown(name)
    alternatives = (wanted if count == 1 else f"{wanted}_{count}" for count in itertools.count(1))
    label = next(f"{long.file}#{each}" for each in alternatives if f"{long.file}#{each}" not in taken)
    faults = list(_faults(long, labels, rows, label))
    missing = [each for each in REQUIRED_LABELS if each not in scenario]
    message = "has no value in this run, and there is no such field in the form; give one of them"
    faults += [reject(label, Code.SCENARIO_MISSING, message, row=int(long.lines[first]), column=each)
               for each in missing]  # fmt: skip
    if faults:
        return label, None, faults
    slope, torque = (None if _changes(labels, each) else scenario[each] for each in MAY_CHANGE)
    line = int(long.lines[first])
    horizon = scenario.get("horizon_s")
    return label, RunEntry(label, shown(set_name.strip()), slope, scenario["mass_kg"], torque, horizon, None, line), []


def _changes(labels: Mapping[str, Numbers], label: str) -> bool:
    values = labels[label].values if label in labels else np.zeros(1)
    return bool((values != values[0]).any())


def _faults(long: LongTable, labels: Mapping[str, Numbers], rows: Rows, label: str) -> Iterator[Finding]:
    """Labels that are no scenario, or not the same in all rows of the run, but for slope and torque."""
    lines = long.lines[rows]
    columns: dict[str, npt.NDArray[Any]] = {name: column.values for name, column in labels.items()}
    if "set" in long.texts:
        columns["set"] = long.texts["set"].codes[rows]
    for name, values in columns.items():
        gaps = list(gaps_in(labels[name].blank, lines, file=label, column=name)) if name in labels else []
        yield from gaps
        if gaps or (name in MAY_CHANGE and _changes(labels, name)):
            continue
        fault = scenario_fault(name, float(values[0])) if name in SCENARIO_LIMITS else None
        if fault is not None:
            yield reject(label, *fault, row=int(lines[0]), column=name)
        elif (values != values[0]).any():
            at = int(np.flatnonzero(values != values[0])[0])
            message = f"is another than in the run's first row; within a run only {' and '.join(MAY_CHANGE)} may change"
            yield reject(label, Code.SCENARIO_VARIES, message, row=int(lines[at]), column=name)
