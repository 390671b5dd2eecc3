"""Which column of a file is which canonical column, when its header does not say so without doubt."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from service.datasets.columns import BY_NAME, MAX_COLUMNS, REQUIRED, canonical_name
from service.datasets.findings import Code, Finding, UnusableFileError, reject, warn
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
    """Canonical name -> 0-based index in the file, and what was noticed on the way."""

    indices: dict[str, int]
    zero_start: bool
    findings: tuple[Finding, ...]


def resolve(names: Sequence[str] | None, count: int, column_map: ColumnMap | None, *, file: str = "file") -> Resolution:
    """Find the canonical columns among `names` (None: no header) of a file with `count` columns.

    An explicit map wins; then the header of a known demo; then names without doubt. Raises
    UnusableFileError when a required column is not found or a mapped one does not exist.
    """
    chosen = column_map or _preset_of(names)
    indices = _by_name(names) if chosen is None else {}
    if chosen is not None:
        indices = _by_name(names) if not chosen.signature and names else {}
        for name, source in chosen.sources.items():
            indices[name] = _locate(source, names, count, name, file)
    missing = [name for name in REQUIRED if name not in indices]
    if missing:
        raise UnusableFileError([_missing(name, names, count, file) for name in missing])
    ignored = [i for i in range(count) if i not in set(indices.values())]
    findings: tuple[Finding, ...] = ()
    if ignored:
        listed = ", ".join(repr(names[i]) if names else f"#{i}" for i in ignored[:12])
        findings = (warn(file, Code.IGNORED_COLUMN, f"not used: {listed}{', ...' if len(ignored) > 12 else ''}"),)
    return Resolution(indices, chosen.zero_start if chosen else False, findings)


def _preset_of(names: Sequence[str] | None) -> ColumnMap | None:
    header = tuple(name.lower() for name in names or ())
    return next((p for p in PRESETS.values() if p.signature and p.signature == header), None)


def _by_name(names: Sequence[str] | None) -> dict[str, int]:
    found: dict[str, int] = {}
    for index, name in enumerate(names or ()):
        canonical = canonical_name(name)
        if canonical is not None:
            found.setdefault(canonical, index)
    return found


def _locate(source: str | int, names: Sequence[str] | None, count: int, name: str, file: str) -> int:
    if isinstance(source, int):
        if source < count:
            return source
        raise UnusableFileError(
            [reject(file, Code.MISSING_COLUMN, f"the column map wants index {source}, rows have {count} columns",
                    column=name)]
        )  # fmt: skip
    lowered = [each.lower() for each in names or ()]
    if source.lower() in lowered:
        return lowered.index(source.lower())
    by_meaning = _by_name(names).get(name) if source == name else None
    if by_meaning is not None:
        return by_meaning
    raise UnusableFileError([_missing(name, names, count, file, wanted=source)])


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
