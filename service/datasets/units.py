"""Units as people write them in headers: a value in another unit is never taken for one in ours."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence

from service.datasets.columns import BY_NAME, COLUMNS, meaning_of
from service.datasets.findings import Code, Finding, reject

_SPELLINGS = {
    "s": "s sec secs second seconds",
    "ms": "ms msec millisecond milliseconds",
    "us": "us \u00b5s \u03bcs microsecond microseconds",
    "min": "min minute minutes",
    "m": "m metre metres meter meters",
    "mm": "mm millimetre millimetres millimeter millimeters",
    "cm": "cm centimetre centimetres centimeter centimeters",
    "km": "km kilometre kilometres",
    "in": "in inch inches",
    "ft": "ft foot feet",
    "m/s": "m/s mps m_s m*s^-1 m.s-1 ms^-1",
    "mm/s": "mm/s mmps mm_s",
    "cm/s": "cm/s cmps cm_s",
    "km/h": "km/h kmh kph km_h",
    "rad": "rad radian radians",
    "deg": "deg \u00b0 degree degrees",
    "rad/s": "rad/s radps rad_s",
    "deg/s": "deg/s degps deg_s \u00b0/s",
    "rpm": "rpm 1/min",
    "kg": "kg kilogram kilograms",
    "g": "g gram grams",
    "N m": "nm n*m n.m n_m n-m n\u00b7m n\u22c5m",
    "N mm": "nmm n*mm n_mm",
    "1": "1",
}
_UNITS = {spelling: unit for unit, spellings in _SPELLINGS.items() for spelling in spellings.split()}
_OF_LABELS = {"mass_kg": "kg", "horizon_s": "s", "step_s": "s"}
# a name may end in "_min" or "_in" and mean something else
_SUFFIXES = {"ms", "us", "mm", "cm", "km", "mmps", "cmps", "kmh", "kph", "deg", "degps", "rpm", "rad", "nmm"}
_BRACKETS = re.compile(r"[\[(]\s*([^\[\]()]*?)\s*[\])]\s*$")


def unit_named(text: str) -> str | None:
    """The unit that a text names ("m/s", "N m", "\u00b0"), or None."""
    return _UNITS.get(re.sub(r"\s+", "_", text.strip().lower())) or _UNITS.get(re.sub(r"\s+", "", text.lower()))


def unit_in(header: str) -> str | None:
    """The unit that a header cell says, in brackets or, if it is not ours, after an underscore."""
    text = header.strip().strip("\"'")
    bracket = _BRACKETS.search(text)
    if bracket is not None:
        return unit_named(bracket[1])
    ending = text.lower().rpartition("_")[2]
    return _UNITS[ending] if ending in _SUFFIXES else None


def unit_of(name: str) -> str | None:
    """The unit in which a canonical column or label is read."""
    return BY_NAME[name].unit if name in BY_NAME else _OF_LABELS.get(name)


def meant_in_another_unit(header: str) -> tuple[str, str] | None:
    """(canonical name or label, unit) where a header cell says it in another unit than ours, else None."""
    unit = unit_in(header)
    if unit is None:
        return None
    text = header.strip().strip("\"'")
    bracket = _BRACKETS.search(text)
    stem = text[: bracket.start()] if bracket is not None else text.rpartition("_")[0]
    for name in (*(column.name for column in COLUMNS), *_OF_LABELS):
        ours = unit_of(name)
        if meaning_of(stem) == name or (ours is not None and meaning_of(f"{stem} {ours}") == name):
            return None if ours == unit else (name, unit)
    return None


def mapped_in_another_unit(mapped: Mapping[str, int], names: Sequence[str] | None, file: str) -> list[Finding]:
    """Rejections of columns that a column map chose, whose own header says another unit than they are read in."""
    wrong = [(name, names[index], unit_in(names[index])) for name, index in mapped.items() if names]
    return [
        reject(file, Code.UNITS, f"{header!r} is in {unit}, expected {unit_of(name)}; convert it", column=name)
        for name, header, unit in wrong
        if unit is not None and unit != unit_of(name)
    ]


def missing_in_another_unit(missing: Sequence[str], names: Sequence[str] | None, file: str) -> Iterator[Finding]:
    """Rejections of columns that are there, but in another unit."""
    for header in names or ():
        meant = meant_in_another_unit(header)
        if meant is not None and meant[0] in missing:
            name, unit = meant
            message = f"{header!r} is in {unit}, expected {unit_of(name)}; convert it, and call it {name}"
            yield reject(file, Code.UNITS, message, column=name)
