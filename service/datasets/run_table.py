"""runs.csv: which file is which run, with its scenario, in borders' units."""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import PurePosixPath

from service.datasets.columns import meaning_of
from service.datasets.file_names import quoted, run_name
from service.datasets.findings import Code, Finding, UnusableFileError, reject, warn
from service.datasets.given import Given
from service.datasets.readers.decimal_comma import Commas, commas_in, told
from service.datasets.readers.numbers import AROUND, NO_VALUE, number
from service.datasets.readers.text_header import header_above
from service.datasets.readers.text_lines import split_text
from service.datasets.run import MAX_RUNS
from service.datasets.units import said_in_another_unit
from service.errors import DatasetError

FILE = "runs.csv"
MAX_BYTES = 16 * 1024 * 1024

# field: lowest, highest (the service's own limits), and the wrong unit to suspect with units per right unit
SCENARIO_LIMITS: dict[str, tuple[float, float, str, float]] = {
    "slope_deg": (-45.0, 45.0, "percent or another angle unit", math.nan),
    "mass_kg": (1.0, 10_000.0, "grams", 1000.0),
    "torque_nm": (0.0, 10_000.0, "newton millimetres", 1000.0),
    "horizon_s": (1e-3, 600.0, "milliseconds", 1000.0),
}
_TEXTS = ("file", "run", "set")
_REQUIRED = ("file", "mass_kg")
_KNOWN = ("file", "run", "set", *SCENARIO_LIMITS, "step_s")


@dataclass(frozen=True, slots=True)
class RunEntry:
    """One line of runs.csv. What the table does not have is None; slope and torque may stand in the run's own rows.

    `name` is "" where the run is called after its file.
    """

    file: str
    set_name: str
    slope_deg: float | None
    mass_kg: float
    torque_nm: float | None
    horizon_s: float | None
    step_s: float | None
    line: int
    name: str = ""


def parse_run_table(data: bytes, given: Given | None = None) -> tuple[list[RunEntry], list[Finding]]:
    """Entries that are usable, and findings about lines that are not, or that were skipped.

    Mass, horizon and set that a line does not say are those of `given`.

    Raises DatasetError when the table as a whole cannot be used (no header, missing columns, a column twice, no lines).
    """
    if len(data) > MAX_BYTES:
        raise DatasetError(f"{FILE} has {len(data)} bytes, allowed are at most {MAX_BYTES}")
    try:
        text = split_text(data, file=FILE, max_rows=2 * MAX_RUNS)
    except UnusableFileError as error:
        if error.findings[0].code is not Code.EMPTY_FILE:
            raise
        raise DatasetError(f"{FILE} lists 0 runs, allowed are 1..{MAX_RUNS}; it needs a header above them") from error
    if len(text.lines) > MAX_RUNS:
        raise DatasetError(f"{FILE} lists {len(text.lines)} runs, allowed are 1..{MAX_RUNS}")
    names, findings = header_above(text, file=FILE)
    given = given or Given()
    columns, ignored = _columns(names, [name for name in _REQUIRED if name not in given.values])
    findings += ignored
    entries: list[RunEntry] = []
    rows = [[cell.strip() for cell in cells] for cells in text.rows()]
    findings += _with_points(rows, [index for name, index in columns.items() if name not in _TEXTS])
    for line, cells in zip(text.lines.tolist(), rows, strict=True):
        if len(cells) < len(names) or any(cells[len(names) :]):
            message = f"{len(cells)} values, the header names {len(names)} columns"
            findings.append(reject(FILE, Code.RAGGED_ROW, message, row=line))
            continue
        entry, problems = _entry({name: cells[index] for name, index in columns.items()}, line, given)
        findings += problems
        if entry is not None:
            entries.append(entry)
    return _named(entries, findings)


def _named(entries: list[RunEntry], findings: list[Finding]) -> tuple[list[RunEntry], list[Finding]]:
    """Runs are called as the column `run` says, where it calls every run by a name of its own; else after files."""
    names = [entry.name for entry in entries]
    if not any(names) or (len(set(names)) == len(names) and all(run_name(name) == (name, None) for name in names)):
        return entries, findings
    message = "not used: it does not give every run a plain name of its own; runs are called after their files"
    told = warn(FILE, Code.IGNORED_COLUMN, message, column="run")
    return [replace(entry, name="") for entry in entries], [*findings, told]


def _with_points(rows: list[list[str]], indices: Sequence[int]) -> list[Finding]:
    """Decimal commas in these columns become points, beyond doubt only; a word about it."""
    numbers = [row[index].strip(AROUND) for row in rows for index in indices if index < len(row)]
    if commas_in(lambda pattern: any(re.search(pattern, cell) for cell in numbers)) is not Commas.DECIMAL:
        return []
    for row in rows:
        for index in indices:
            row[index : index + 1] = [cell.replace(",", ".") for cell in row[index : index + 1]]
    return [told(FILE, next(cell for cell in numbers if "," in cell))]


def _columns(names: Sequence[str], required: Sequence[str]) -> tuple[dict[str, int], list[Finding]]:
    """Which column is which, and what is not used. Raises DatasetError."""
    wrong = said_in_another_unit(names, FILE, ("step_s",))
    if wrong:
        raise UnusableFileError(wrong)
    found: dict[str, int] = {}
    ignored: list[str] = []
    for index, name in enumerate(names):
        meaning = meaning_of(name)
        if meaning not in _KNOWN:
            ignored += [quoted(name)] if name else []
        elif meaning in found:
            raise DatasetError(
                f"{FILE} has several columns for {meaning}: {quoted(names[found[meaning]])} and {quoted(name)}; keep "
                "one of them"
            )
        else:
            found[meaning] = index
    missing = [name for name in required if name not in found]
    if missing:
        there = ", ".join(quoted(each) for each in names[:16])
        raise DatasetError(
            f"{FILE} has no column {', '.join(missing)}; its header is {there}; "
            "expected file,set,slope_deg,mass_kg,torque_nm,horizon_s (slope_deg and torque_nm not where each row has "
            "them)"
        )
    message = f"not used: {', '.join(ignored[:12])}{', ...' if len(ignored) > 12 else ''}"
    return found, [warn(FILE, Code.IGNORED_COLUMN, message)] if ignored else []


def _entry(cells: dict[str, str], line: int, given: Given) -> tuple[RunEntry | None, list[Finding]]:
    findings: list[Finding] = []
    numbers: dict[str, float | None] = {}
    for name in (*SCENARIO_LIMITS, "step_s"):
        text = cells.get(name, "")
        fallback = given.value(name) if text in NO_VALUE and name in ("mass_kg", "horizon_s") else None
        numbers[name], problem = (fallback, None) if fallback is not None else _cell(text, name, line)
        findings += [problem] if problem else []
    file = as_listed(cells.get("file", ""))
    if unsafe_path(file):
        message = f"{file!r} is not a relative path inside the dataset's folder"
        findings.append(reject(FILE, Code.UNSAFE_PATH, message, row=line, column="file"))
    slope, mass, torque = numbers["slope_deg"], numbers["mass_kg"], numbers["torque_nm"]
    if any(finding.rejects for finding in findings) or mass is None:
        return None, findings
    if "\\" in cells["file"]:
        message = f"{cells['file']!r} is read as {file!r}: \\ is what separates folders elsewhere"
        findings.append(warn(FILE, Code.RENAMED, message, row=line, column="file"))
    set_name = cells.get("set") or given.name_of_set()
    horizon, step = numbers["horizon_s"], numbers["step_s"]
    return RunEntry(file, set_name, slope, mass, torque, horizon, step, line, cells.get("run", "")), findings


def as_listed(file: str) -> str:
    """A file's name as runs.csv and archives are compared: composed letters (NFC), folders separated by /."""
    return unicodedata.normalize("NFC", file.replace("\\", "/"))


def _cell(text: str, name: str, line: int) -> tuple[float | None, Finding | None]:
    def no(code: Code, message: str) -> tuple[None, Finding]:
        return None, reject(FILE, code, message, row=line, column=name)

    if text in NO_VALUE:
        return no(Code.SCENARIO_MISSING, "no value; write the run's own") if name in _REQUIRED else (None, None)
    try:
        value = number(text)
    except ValueError:
        doubtful = Commas.DOUBTFUL if "," in text else ""
        return no(Code.NOT_A_NUMBER, f"{text[:40]!r} is not a number{doubtful}")
    if not math.isfinite(value):
        return no(Code.NON_FINITE, f"{text[:40]!r} is not finite")
    problem = scenario_fault(name, value, text) if name in SCENARIO_LIMITS else None
    return no(*problem) if problem else (value, None)


def scenario_fault(name: str, value: float, text: str | None = None) -> tuple[Code, str] | None:
    """Why a scenario value cannot be, or None. `text` is how it was written."""
    lowest, highest, wrong_unit, factor = SCENARIO_LIMITS[name]
    text = f"{value:g}" if text is None else text
    if not math.isfinite(value):
        return Code.NON_FINITE, f"{text[:40]!r} is not finite"
    if value > highest and lowest <= value / factor <= highest:
        return Code.UNITS, f"is {text}, which looks like {wrong_unit}; allowed is {lowest:g}..{highest:g}"
    if not lowest <= value <= highest:
        return Code.SCENARIO_RANGE, f"is {text}, allowed is {lowest:g}..{highest:g}"
    return None


def unsafe_path(file: str) -> bool:
    """Whether a name leaves the folder, is absolute (also as another system writes it) or is no name at all."""
    path = PurePosixPath(file)
    return (
        not file.strip()
        or len(file) > 512
        or path.is_absolute()
        or ".." in path.parts
        or re.search(r"[\\\x00-\x1f]|^[A-Za-z]:", file) is not None
    )


def radians_suspected(slopes_deg: list[float]) -> Code | None:
    """UNITS when slopes must be radians, SCENARIO_RANGE when they may be, None when there is no sign of it.

    Several different slopes that all lie within 45 degrees *if read as radians* are suspect: real datasets
    span degrees. When none of them is a multiple of 0.05 (as people choose degrees) they cannot be degrees:
    20, 21, 22 degrees are 0.349, 0.367, 0.384 radians.
    """
    distinct = {abs(slope) for slope in slopes_deg if slope != 0}
    if len(distinct) < 2 or max(distinct) > math.pi / 4:
        return None
    round_ones = [slope for slope in distinct if math.isclose(slope / 0.05, round(slope / 0.05), abs_tol=1e-6)]
    return Code.SCENARIO_RANGE if round_ones else Code.UNITS
