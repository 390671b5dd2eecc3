"""runs.csv: which file is which run, with its scenario, in borders' units."""

from __future__ import annotations

import csv
import io
import math
import re
from dataclasses import dataclass
from pathlib import PurePosixPath

from service.datasets.findings import Code, Finding, reject
from service.datasets.run import MAX_RUNS
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
_REQUIRED = ("file", "mass_kg")


@dataclass(frozen=True, slots=True)
class RunEntry:
    """One line of runs.csv. What the table does not have is None; slope and torque may stand in the run's own rows."""

    file: str
    set_name: str
    slope_deg: float | None
    mass_kg: float
    torque_nm: float | None
    horizon_s: float | None
    step_s: float | None
    line: int


def parse_run_table(data: bytes) -> tuple[list[RunEntry], list[Finding]]:
    """Entries that are usable, and findings about lines that are not.

    Raises DatasetError when the table as a whole cannot be used (no header, missing columns, no lines).
    """
    if len(data) > MAX_BYTES:
        raise DatasetError(f"{FILE} has {len(data)} bytes, allowed are at most {MAX_BYTES}")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise DatasetError(f"{FILE} is not UTF-8 text: {error}") from error
    header, lines = _split(text)
    entries: list[RunEntry] = []
    findings: list[Finding] = []
    for line, cells in lines:
        entry, problems = _entry(dict(zip(header, cells, strict=False)), line)
        findings += problems
        if entry is not None:
            entries.append(entry)
    return entries, findings


def _split(text: str) -> tuple[list[str], list[tuple[int, list[str]]]]:
    first = next((line for line in text.splitlines() if line.strip() and not line.startswith("#")), "")
    delimiter = next((mark for mark in (";", "\t") if mark in first), ",")
    reader = csv.reader(io.StringIO(text), delimiter=delimiter, strict=True)
    try:
        rows = [(reader.line_num, [cell.strip() for cell in row]) for row in reader]
    except csv.Error as error:
        raise DatasetError(f"{FILE} line {reader.line_num} cannot be read: {error}") from error
    rows = [(line, row) for line, row in rows if any(row) and not row[0].startswith("#")]
    header = [cell.lower() for cell in rows[0][1]] if rows else []
    missing = [name for name in _REQUIRED if name not in header]
    if missing:
        raise DatasetError(
            f"{FILE} has no column {', '.join(missing)}; its header is {header}, "
            "expected file,set,slope_deg,mass_kg,torque_nm,horizon_s (slope_deg and torque_nm not where each row has "
            "them)"
        )
    if not 1 <= len(rows) - 1 <= MAX_RUNS:
        raise DatasetError(f"{FILE} lists {len(rows) - 1} runs, allowed are 1..{MAX_RUNS}")
    return header, rows[1:]


def _entry(cells: dict[str, str], line: int) -> tuple[RunEntry | None, list[Finding]]:
    findings: list[Finding] = []
    numbers: dict[str, float | None] = {}
    for name in (*SCENARIO_LIMITS, "step_s"):
        numbers[name], problem = _cell(cells.get(name, ""), name, line)
        findings += [problem] if problem else []
    file = cells.get("file", "")
    if unsafe_path(file):
        message = f"{file!r} is not a relative path inside the dataset's folder"
        findings.append(reject(FILE, Code.UNSAFE_PATH, message, row=line, column="file"))
    slope, mass, torque = numbers["slope_deg"], numbers["mass_kg"], numbers["torque_nm"]
    if findings or mass is None:
        return None, findings
    set_name = cells.get("set") or "default"
    return RunEntry(file, set_name, slope, mass, torque, numbers["horizon_s"], numbers["step_s"], line), []


def _cell(text: str, name: str, line: int) -> tuple[float | None, Finding | None]:
    def no(code: Code, message: str) -> tuple[None, Finding]:
        return None, reject(FILE, code, message, row=line, column=name)

    if not text:
        return no(Code.SCENARIO_MISSING, "no value; write the run's own") if name in _REQUIRED else (None, None)
    try:
        value = float(text)
    except ValueError:
        return no(Code.NOT_A_NUMBER, f"{text[:40]!r} is not a number")
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
