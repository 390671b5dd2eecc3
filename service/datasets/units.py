"""Units as people write them in headers: a value in another unit is never taken for one in ours."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from service.datasets.columns import BY_NAME, COLUMNS, LONGEST_NAME, is_plain, meaning_of, unquoted
from service.datasets.file_names import quoted
from service.datasets.findings import Code, Finding, reject

_SPELLINGS = {
    "s": "s sec secs second seconds",
    "ms": "ms msec millisecond milliseconds",
    "us": "us \u00b5s microsecond microseconds",
    "ns": "ns nanosecond nanoseconds",
    "min": "min minute minutes",
    "h": "hr hour hours",
    "m": "m metre metres meter meters",
    "mm": "mm millimetre millimetres millimeter millimeters",
    "cm": "cm centimetre centimetres centimeter centimeters",
    "dm": "dm decimetre decimetres decimeter decimeters",
    "um": "um \u00b5m micrometre micrometres micrometer micrometers",
    "km": "km kilometre kilometres",
    "in": "in inch inches",
    "ft": "ft foot feet",
    "m/s": "m/s mps m_s m*s^-1 m.s-1 ms^-1",
    "mm/s": "mm/s mmps mm_s",
    "cm/s": "cm/s cmps cm_s",
    "km/h": "km/h kmh kph km_h",
    "rad": "rad radian radians",
    "mrad": "mrad milliradian milliradians",
    "deg": "deg \u00b0 \u00ba degree degrees",
    "mdeg": "mdeg millidegree millidegrees",
    "gon": "gon grad gradian gradians",
    "percent": "% percent pct",
    "rad/s": "rad/s radps rad_s",
    "deg/s": "deg/s degps deg_s \u00b0/s",
    "rpm": "rpm 1/min",
    "kg": "kg kilogram kilograms",
    "g": "g gram grams",
    "t": "ton tons tonne tonnes",
    "lb": "lb lbs pound pounds",
    "N m": "nm n*m n.m n_m n-m n\u00b7m n\u22c5m",
    "N mm": "nmm n*mm n_mm n\u00b7mm n\u22c5mm",
    "N cm": "ncm n*cm n_cm n\u00b7cm n\u22c5cm",
    "kN m": "knm kn*m kn.m kn_m kn-m kn\u00b7m kn\u22c5m",
    "1": "1",
}
_UNITS = {spelling: unit for unit, spellings in _SPELLINGS.items() for spelling in spellings.split()}
_OF_LABELS = {"mass_kg": "kg", "horizon_s": "s", "step_s": "s"}
# what acted on the rover is never taken from somewhere else where a file says it in another unit
_OF_SCENARIO = ("slope_deg", "mass_kg", "torque_nm", "horizon_s")
# a name may end in "_min" or "_in" and mean something else
_SUFFIXES = {"ms", "us", "mm", "cm", "km", "mmps", "cmps", "kmh", "kph", "deg", "degps", "rpm", "rad", "nmm"}
_NO_SUFFIXES = {"1", "in", "min", "s", "m"}
_CLOSING = {"]": "[", ")": "(", "}": "{"}
_BEFORE_UNIT = "_ ,/\t"
_MOST_SPLITS = 3


def unit_named(text: str) -> str | None:
    """The unit that a text names ("m/s", "N m", "\u00b0"), or None."""
    text = text[: LONGEST_NAME + 1].strip().lower().replace("\u03bc", "\u00b5").replace("\u2219", "\u00b7")
    words = text.split()
    return _UNITS.get("_".join(words)) or _UNITS.get("".join(words))


def _in_brackets(text: str) -> tuple[str, str] | None:
    """What stands before the brackets that end a text, and in them; None where none do."""
    at = text.rfind(_CLOSING[text[-1]]) if text and text[-1] in _CLOSING else -1
    return (text[:at].strip(), text[at + 1 : -1].strip()) if at >= 0 else None


def unit_in(header: str) -> str | None:
    """The unit that a header cell says, in brackets or, if it is not ours, after an underscore."""
    text = unquoted(header)
    bracket = _in_brackets(text)
    if bracket is not None:
        return unit_named(bracket[1])
    ending = text.lower().rpartition("_")[2]
    return _UNITS[ending] if ending in _SUFFIXES else None


def _stems(text: str) -> Iterator[tuple[str, str]]:
    """Each way to take a header apart into a name and a unit: a known one, or one in other letters or in brackets."""
    bracket = _in_brackets(text)
    if bracket is not None:
        if bracket[1]:
            yield bracket
        return
    places = [at for at, each in enumerate(text) if each in _BEFORE_UNIT]
    for at in places[: -_MOST_SPLITS - 1 : -1]:
        stem, ending = text[:at].strip(), text[at + 1 :].strip().lower()
        known = unit_named(ending) is not None and ending not in _NO_SUFFIXES
        if known or (ending and not is_plain(ending)):
            yield stem, ending


def unit_of(name: str) -> str | None:
    """The unit in which a canonical column or label is read."""
    return BY_NAME[name].unit if name in BY_NAME else _OF_LABELS.get(name)


def meant_in_another_unit(header: str) -> tuple[str, str] | None:
    """(canonical name or label, unit) where a header cell says it in another unit than ours, else None.

    A unit that is not known is shown as it is written.
    """
    if meaning_of(header) is not None:
        return None
    for stem, written in _stems(unquoted(header)):
        unit = unit_named(written)
        for name in (*(column.name for column in COLUMNS), *_OF_LABELS):
            ours = unit_of(name)
            if meaning_of(stem) == name or (ours is not None and meaning_of(f"{stem} {ours}") == name):
                return None if ours == unit else (name, unit or f"{quoted(written)}, a unit that is not known")
    return None


def mapped_in_another_unit(mapped: Mapping[str, int], names: Sequence[str] | None, file: str) -> list[Finding]:
    """Rejections of columns that a column map chose, whose own header says another unit than they are read in."""
    wrong = [(name, names[index], unit_in(names[index])) for name, index in mapped.items() if names]
    return [
        reject(file, Code.UNITS, f"{quoted(header)} is in {unit}, expected {unit_of(name)}; convert it", column=name)
        for name, header, unit in wrong
        if unit is not None and unit != unit_of(name)
    ]


def said_in_another_unit(names: Sequence[str] | None, file: str, wanted: Sequence[str]) -> list[Finding]:
    """Rejections of the columns among `wanted`, and of labels, that are there in another unit only."""
    there = {meaning_of(header) for header in names or ()}
    lacking = {*wanted, *_OF_SCENARIO} - there
    found: dict[str, Finding] = {}
    for header in names or ():
        meant = meant_in_another_unit(header)
        if meant is not None and meant[0] in lacking:
            name, unit = meant
            message = f"{quoted(header)} is in {unit}, expected {unit_of(name)}; convert it, and call it {name}"
            found.setdefault(name, reject(file, Code.UNITS, message, column=name))
    return list(found.values())
