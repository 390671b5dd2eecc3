"""Which column of a file is which canonical column, when its header does not say so without doubt."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

from service.datasets.columns import BY_NAME, MAX_COLUMNS, REQUIRED, meaning_of
from service.datasets.findings import Code, Finding, UnusableFileError, reject, warn
from service.datasets.units import mapped_in_another_unit, missing_in_another_unit
from service.errors import InvalidValueError


@dataclass(frozen=True, slots=True)
class ColumnMap:
    """Canonical name -> header name, or 0-based index where there is no header.

    `zero_start` moves time and both x columns so that the first row is the origin: demos start at their own
    place in a world frame. `signature` is the exact header by which a preset is recognised.
    """

    sources: Mapping[str, str | int]
    zero_start: bool = False
    signature: tuple[str, ...] = field(default=(), repr=False)

    def __post_init__(self) -> None:
        allowed = f"names among {', '.join(BY_NAME)}"
        for name, source in self.sources.items():
            if name not in BY_NAME:
                raise InvalidValueError("column_map", name, allowed)
            if isinstance(source, bool) or not isinstance(source, str | int):
                raise InvalidValueError(f"column_map.{name}", source, "a header name or a 0-based index")
            if isinstance(source, int) and not 0 <= source < MAX_COLUMNS:
                raise InvalidValueError(f"column_map.{name}", source, f"0..{MAX_COLUMNS - 1}")

    @classmethod
    def of(cls, value: ColumnMap | str | Mapping[str, str | int] | None) -> ColumnMap | None:
        """A map from what users give: a preset's name, a mapping (with "zero_start" if wanted), or nothing."""
        if value is None or isinstance(value, ColumnMap):
            return value
        if isinstance(value, str):
            if value not in PRESETS:
                raise InvalidValueError("column_map", value, f"a mapping or a preset among {', '.join(PRESETS)}")
            return PRESETS[value]
        sources = dict(value)
        return cls(sources, zero_start=bool(sources.pop("zero_start", False)))


_TWELVE = ("vx", "vy", "vz", "ax", "ay", "az", "fx", "fy", "fz", "tx", "ty", "tz")

PRESETS: dict[str, ColumnMap] = {
    # runs of this project: canonical names in the header
    "rover-twin": ColumnMap({name: name for name in REQUIRED}),
    # demo_ROBOT_Viper_WheelSlope_CRM.cpp: z is vertical, y sideways; ax..az really hold *angular velocity*,
    # in a body frame, so they are left out
    "chrono-viper-slope": ColumnMap(
        {"time_s": "time", "rear_x_m": "x", "rear_y_m": "z", "rear_lateral_m": "y", "speed_mps": "vx"},
        zero_start=True,
        signature=("time", "x", "y", "z", *_TWELVE),
    ),
    # demo_ROBOT_Lander_CRM.cpp
    "lander": ColumnMap(
        {"time_s": "time", "rear_x_m": "px", "rear_y_m": "pz", "rear_lateral_m": "py", "speed_mps": "vx"},
        zero_start=True,
        signature=("time", "px", "py", "pz", "vx", "vy", "vz", "wx", "wy", "wz"),
    ),
    # demo_VEH_CRMTerrain_WheeledVehicle.py: rows `time x y z speed` without header
    "vehicle-python": ColumnMap(
        {"time_s": 0, "rear_x_m": 1, "rear_y_m": 3, "rear_lateral_m": 2, "speed_mps": 4}, zero_start=True
    ),
}


@dataclass(frozen=True, slots=True)
class Resolution:
    """Canonical name or label -> 0-based index in the file, and what was noticed on the way."""

    indices: dict[str, int]
    zero_start: bool
    findings: tuple[Finding, ...]


def resolve(
    names: Sequence[str] | None,
    count: int,
    column_map: ColumnMap | None,
    *,
    file: str = "file",
    labels: Collection[str] = (),
) -> Resolution:
    """Find the canonical columns, and those of `labels` that are there, among `names` (None: no header, "": no name)
    of a file with `count` columns.

    An explicit map wins; then the header of a known demo; then names without doubt. Raises UnusableFileError when a
    required column is not found, a mapped one does not exist, or two columns mean the same.
    """
    preset = None if column_map else _preset_of(names)
    chosen = column_map or (PRESETS[preset] if preset else None)
    mapped = {} if chosen is None else {
        name: _locate(source, names, count, name, file) for name, source in chosen.sources.items()
    }  # fmt: skip
    named = {} if chosen is not None and chosen.signature else _by_name(names, labels)
    wrong = mapped_in_another_unit(mapped, names, file)
    clashes = [
        _clash(name, [names[index] for index in several], file)
        for name, several in named.items()
        if names and len(several) > 1 and name not in mapped
    ]
    if clashes or wrong:
        raise UnusableFileError([*clashes, *wrong])
    indices = {name: several[0] for name, several in named.items()} | mapped
    missing = [name for name in REQUIRED if name not in indices]
    if missing:
        there = list(missing_in_another_unit(missing, names, file))
        absent = [name for name in missing if name not in {finding.column for finding in there}]
        raise UnusableFileError([*there, *(_missing(name, names, count, file) for name in absent)])
    findings: list[Finding] = []
    if preset is not None:
        what = ", ".join(f"{name} is {source!r}" for name, source in PRESETS[preset].sources.items())
        message = f"the header is that of the preset {preset}: {what}; time and x are counted from the first row"
        findings.append(warn(file, Code.PRESET, message))
    ignored = [i for i in range(count) if i not in set(indices.values())]
    if ignored:
        listed = ", ".join(repr(names[i]) if names and names[i] else f"#{i}" for i in ignored[:12])
        message = f"not used: {listed}{', ...' if len(ignored) > 12 else ''}"
        findings.append(warn(file, Code.IGNORED_COLUMN, message))
    return Resolution(indices, chosen.zero_start if chosen else False, tuple(findings))


def _preset_of(names: Sequence[str] | None) -> str | None:
    header = tuple(name.lower() for name in names or ())
    return next((key for key, each in PRESETS.items() if each.signature and each.signature == header), None)


def _by_name(names: Sequence[str] | None, labels: Collection[str] = ()) -> dict[str, list[int]]:
    """Which columns have each meaning: two, where a header says a thing twice."""
    found: dict[str, list[int]] = {}
    for index, name in enumerate(names or ()):
        meaning = meaning_of(name)
        if meaning in BY_NAME or meaning in labels:
            found.setdefault(str(meaning), []).append(index)
    return found


def _clash(name: str, headers: Sequence[str], file: str) -> Finding:
    listed = " and ".join(repr(header) for header in headers)
    what = "there are several columns" if len(set(headers)) == 1 else "several columns mean the same:"
    message = f"{what} {listed}; keep one of them, or rename what is something else"
    return reject(file, Code.DUPLICATE_COLUMN, message, column=name)


def _locate(source: str | int, names: Sequence[str] | None, count: int, name: str, file: str) -> int:
    if isinstance(source, int):
        if source < count:
            return source
        raise UnusableFileError(
            [reject(file, Code.MISSING_COLUMN, f"the column map wants index {source}, rows have {count} columns",
                    column=name)]
        )  # fmt: skip
    found = [index for index, each in enumerate(names or ()) if each.lower() == source.strip().lower()]
    if not found and source == name:
        found = _by_name(names).get(name, [])
    if not found:
        raise UnusableFileError([_missing(name, names, count, file, wanted=source)])
    if len(found) > 1 and names:
        raise UnusableFileError([_clash(name, [names[index] for index in found], file)])
    return found[0]


def _missing(name: str, names: Sequence[str] | None, count: int, file: str, wanted: str | None = None) -> Finding:
    if names is None:
        has = f"there is no header over its {count} columns"
        remedy = f'give a column map with 0-based indices, for example {{"{name}": 1}}'
        if count == len(PRESETS["vehicle-python"].sources):
            # two demos write five columns without a header, and only one of them can be learned from
            remedy += (
                ", or the preset vehicle-python if the columns are time x y z speed; time and four wheel torques, as "
                "demo_ROBOT_Viper_SCM writes, have no position: nothing can be learned from them"
            )
    else:
        has = f"the header has {', '.join(repr(each) for each in names[:16])}"
        remedy = f"give a column map, or a preset among {', '.join(PRESETS)}"
    what = f"no column {wanted!r} for {name}" if wanted else f"no column for {name}"
    return reject(file, Code.MISSING_COLUMN, f"{what}: {has}; {remedy}", column=name)
