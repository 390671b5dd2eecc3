"""A table of texts before it is written: columns with names, cells, and whether they are numbers."""

from __future__ import annotations

import random
import re
from dataclasses import dataclass, field

from tests.datasets.messy.axes import LONG, WITHOUT_NAMES
from tests.datasets.messy.clean import MASS_KG, NAMES, TORQUE_NM, clean_runs

_OTHER = {"time_s": "Time", "speed_mps": "speed_m_s", "torque_nm": "stall_torque_nm", "slope_deg": "slope_degrees"}
_OWN = {"time_s": "Zeit", "rear_x_m": "Weg", "rear_y_m": "Hoehe", "speed_mps": "v"}
_UNITS = {"s": "s", "m": "m", "mps": "m/s", "deg": "deg", "kg": "kg", "nm": "N m", "mm": "mm", "cm": "cm", "ms": "ms",
          "kmh": "km/h"}  # fmt: skip
_SCALES = {"mm": 1000.0, "cm": 100.0, "ms": 1000.0}


@dataclass
class Column:
    """`name` is what it means, `header` what stands above it."""

    name: str
    cells: list[str]
    is_text: bool = False
    header: str = ""
    is_extra: bool = False


@dataclass
class Sheet:
    """Columns of equal length, in the order in which they are written."""

    columns: list[Column]
    mapping: dict[str, str | int] = field(default_factory=dict)

    @property
    def rows(self):
        """The cells of each row."""
        return [list(cells) for cells in zip(*(column.cells for column in self.columns), strict=True)]


def of_run(run, ways):
    """The rows of one run, messed up as `ways` say, as columns."""
    values = {name: list(column) for name, column in run.columns.items()}
    unit, names = ways["units"], {}
    if unit in ("mm by name", "cm by name", "mm without a word"):
        for name in ("rear_x_m", "rear_y_m"):
            values[name] = [value * _SCALES[unit[:2]] for value in values[name]]
            names[name] = name if unit.endswith("word") else name[:-1] + unit[:2]
    elif unit in ("ms by name", "ms without a word"):
        values["time_s"] = [value * 1000.0 for value in values["time_s"]]
        names["time_s"] = "time_s" if unit.endswith("word") else "time_ms"
    elif unit == "km/h by name":
        values["speed_mps"] = [value * 3.6 for value in values["speed_mps"]]
        names["speed_mps"] = "speed_kmh"
    elif unit == "deg by name":
        values["pitch_deg"] = [5.0] * len(values["time_s"])
    spell = _spelling(ways["number"])
    columns = [Column(names.get(name, name), [spell(value) for value in cells]) for name, cells in values.items()]
    _make_hole(columns[1].cells, ways["hole"])
    rows = _ordered(list(range(len(columns[0].cells))), ways["order"])
    return [Column(each.name, [each.cells[row] for row in rows]) for each in columns]


def of_file(ways, runs=None):
    """The whole messy file: one run, or both with their labels."""
    runs = runs or (clean_runs() if ways["carrier"] in LONG else clean_runs()[:1])
    parts = [of_run(run, ways if at == 0 else {**ways, "hole": "none", "order": "usual"})
             for at, run in enumerate(runs)]  # fmt: skip
    columns = parts[0]
    if len(parts) > 1:
        columns = [Column(one.name, one.cells + two.cells) for one, two in zip(*parts, strict=True)]
        spell = _spelling(ways["number"])
        lengths = [len(part[0].cells) for part in parts]
        labels = [("slope_deg", [spell(run.slope_deg) for run in runs]), ("torque_nm", [spell(TORQUE_NM)] * 2),
                  ("mass_kg", [_mass(ways["number"])] * 2)]  # fmt: skip
        columns += [Column(name, _repeated(cells, lengths)) for name, cells in labels]
        if ways["carrier"] != "long, runs not named":
            columns.insert(0, Column("run", _repeated([run.name for run in runs], lengths), is_text=True))
    return _arranged(columns, ways)


def of_run_table(files, ways):
    """runs.csv for these files, written as the messy file is."""
    spell = _spelling(ways["number"])
    columns = [
        Column("file", files, is_text=True),
        Column("set", ["x"] * len(files), is_text=True),
        Column("slope_deg", [spell(run.slope_deg) for run in clean_runs()]),
        Column("mass_kg", [_mass(ways["number"])] * len(files)),
        Column("torque_nm", [spell(TORQUE_NM)] * len(files)),
    ]
    return _named(columns, ways)


def as_run_table(ways):
    """Those of the ways in which a table of two runs can be messy too."""
    header = "usual" if ways["header"] in (*WITHOUT_NAMES, "own names, mapped") else ways["header"]
    encoding = "ASCII" if ways["encoding"] in ("UTF-8", "Windows-1252") else ways["encoding"]
    return {**ways, "header": header, "encoding": encoding, "index": "none", "order": "usual"}


def _arranged(columns, ways):
    turn = {
        "usual": lambda each: each,
        "reversed": lambda each: each[::-1],
        "rotated": lambda each: each[2:] + each[:2],
    }
    columns = turn[ways["columns"]](columns)
    count = len(columns[0].cells)
    place = {"last": len(columns), "first": 0, "middle": 2}[ways["place"]]
    columns[place:place] = [Column(name, [value(at) for at in range(count)], is_text, name, is_extra=True)
                            for name, value, is_text in _extra(ways)]  # fmt: skip
    if ways["encoding"] in ("UTF-8", "Windows-1252", "UTF-16, little", "UTF-16, big", "UTF-16, no mark"):
        columns.insert(1, Column("Neigung_\u00b0", ["\u00e4"] * count, is_text=True, header="Neigung_\u00b0"))
    return _named(columns, ways)


def _named(columns, ways):
    count, header = len(columns[0].cells), ways["header"]
    if ways["index"] != "none":
        first = 1 if ways["index"] in ("no name above", "from one") else 0
        name = {"index": "index", "from one": "No"}.get(ways["index"], "")
        is_text = ways["index"] == "no name above"
        columns.insert(0, Column("", [str(at + first) for at in range(count)], is_text, name))
    for column in columns:
        column.header = column.header or _header(column.name, header)
    mapping = {}
    if header in ("own names, mapped", "none, mapped"):
        for at, column in enumerate(columns):
            name = _canonical(column.name)
            if name and not column.is_extra:
                mapping[name] = column.header if header.startswith("own") else at
    return Sheet(columns, mapping)


def _canonical(name):
    """The column that a map says it is; a map also says that speed in another unit is none."""
    name = re.sub("_(mm|cm)$", "_m", name).replace("time_ms", "time_s")
    return name if name in NAMES else None


def _header(name, style):
    stem, _, unit = name.rpartition("_")
    unit = _UNITS.get(unit)
    if style == "other names":
        return _OTHER.get(name, name)
    if style == "own names, mapped":
        own = _OWN.get(_canonical(name) or "", name)
        return own if name in NAMES or own == name else f"{own} [{unit}]"
    if style == "UPPER":
        return name.upper()
    if unit is None:
        return name
    if style == "Names (unit)":
        return f"{stem.replace('_', ' ').capitalize()} ({unit})"
    if style == "names[unit]":
        return f"{stem}[{unit.replace(' ', '_')}]"
    return name


def unit_of(column):
    """What stands in a row of units."""
    return _UNITS.get(column.name.rpartition("_")[2], "")


def _spelling(style):
    return lambda value: _SPELLINGS[style](float(value))


def _without_letter(value):
    mantissa, exponent = f"{value:.9e}".split("e")
    return f"{mantissa}{int(exponent):+04d}"


_SPELLINGS = {
    "repr": repr,
    "six digits": lambda value: f"{value:.6g}",
    "six decimals": lambda value: f"{value:.6f}",
    "1.0e-03": lambda value: f"{value:.9e}",
    "1.0D-03": lambda value: f"{value:.9E}".replace("E", "D"),
    "1.0-003": _without_letter,
    "+1.0": lambda value: f"{value:+.10f}",
    "padded": lambda value: f"{value:>14.9f}",
    "1,0": lambda value: repr(value).replace(".", ","),
    "1,0 and 1.430": lambda value: repr(value).replace(".", ","),
    "1.0 and 1,430": repr,
}


def _mass(style):
    return {"1,0 and 1.430": "1.430", "1.0 and 1,430": "1,430"}.get(style) or _spelling(style)(MASS_KG)


def _make_hole(cells, hole):
    if hole != "none":
        cells[30] = "" if hole == "empty" else hole


def _ordered(rows, order):
    if order == "reversed":
        return rows[::-1]
    if order == "shuffled":
        random.Random(1).shuffle(rows)
    elif order == "two swapped":
        rows[20], rows[21] = rows[21], rows[20]
    elif order == "a row twice":
        rows.insert(20, 20)
    elif order == "a row missing":
        del rows[20]
    return rows


def _repeated(cells, lengths):
    return [cell for cell, length in zip(cells, lengths, strict=True) for _ in range(length)]


def _extra(ways):
    """(name, cell of a row, whether it is text) of each column that nobody asked for."""
    quote = "'" if ways["quoting"] == "single" else '"'
    return {
        "none": [],
        "text": [("phase", lambda at: "start" if at < 5 else "drive", True)],
        "truth": [("moving", lambda at: str(at > 3), True)],
        "date": [("stamp", lambda at: f"2026-11-28T09:00:{at % 60:02d}Z", True)],
        "half empty": [("load_n", lambda at: "5.0" if at < 20 else "", False)],
        "empty": [("note", lambda _: "", True)],
        "two of one name": [("note", lambda _: "a", True), ("note", lambda _: "b", True)],
        "delimiter in quotes": [("note", lambda _: f"{quote}a, b; c|d{quote}", True)],
        "quotes in quotes": [("note", lambda _: f"{quote}a {quote * 2}b{quote * 2} c{quote}", True)],
        "like comments": [("note", lambda at: "#a" if at % 2 else "%b", True)],
        "several lines": [("note", lambda _: f"{quote}a\nb{quote}", True)],
        "counts": [("step", str, False)],
        "thousands": [("load_n", lambda _: f"{quote}1,234.5{quote}", True)],
        "rear_x_m again": [("rear_x_m", lambda _: "0.5", False)],
    }[ways["extra"]]
