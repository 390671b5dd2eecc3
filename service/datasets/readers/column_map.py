"""Which column of a file is which canonical column, when its header does not say so without doubt."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

from service.datasets.columns import BY_NAME, MAX_COLUMNS, REQUIRED, meaning_of
from service.datasets.file_names import quoted
from service.datasets.findings import Code, Finding, UnusableFileError, reject, warn
from service.datasets.readers.presets import DEMOS, Demo
from service.datasets.readers.recognise import places, preset_of, told_by_header
from service.datasets.units import mapped_in_another_unit, said_in_another_unit
from service.errors import InvalidValueError

_EXAMPLE = '{"time_s": 0, "rear_x_m": 1, "rear_y_m": 2}'


@dataclass(frozen=True, slots=True)
class ColumnMap:
    """Canonical name -> header name, or 0-based index where there is no header.

    `zero_start` moves time and both x columns so that the first row is the origin: demos start at their own
    place in a world frame. `preset` is the key of `DEMOS` that this map stands for.
    """

    sources: Mapping[str, str | int]
    zero_start: bool = False
    preset: str | None = field(default=None, repr=False)

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


_OF_FRONT = ("front_x_m", "front_y_m")

PRESETS: dict[str, ColumnMap] = {
    # runs of this project: canonical names in the header
    "rover-twin": ColumnMap({name: name for name in REQUIRED}),
    **{key: ColumnMap(demo.sources, zero_start=True, preset=key) for key, demo in DEMOS.items()},
}


@dataclass(frozen=True, slots=True)
class Resolution:
    """Canonical name or label -> 0-based index in the file, and what was noticed on the way.

    `checked` are columns of the demo `preset` that are to be compared with each other: its own name -> index.
    """

    indices: dict[str, int]
    zero_start: bool
    findings: tuple[Finding, ...]
    preset: str | None = None
    checked: Mapping[str | int, int] = field(default_factory=dict)

    @property
    def flags(self) -> list[int]:
        """The columns that may say true and false: the brake, which is on or off."""
        return [self.indices["brake"]] if "brake" in self.indices else []


def resolve(
    names: Sequence[str] | None,
    count: int,
    column_map: ColumnMap | None,
    *,
    file: str = "file",
    labels: Collection[str] = (),
    front: bool = False,
) -> Resolution:
    """Find the canonical columns, and those of `labels` that are there, among `names` (None: no header, "": no name)
    of a file with `count` columns.

    An explicit map wins; then names without doubt; then the header of a known demo. With `front` the columns of the
    front wheel stand for those of the rear one, where only they are there. Raises UnusableFileError when a required
    column is not found, a mapped one does not exist, or two columns mean the same.
    """
    named = _by_name(names, labels)
    seen = None if column_map or all(name in named for name in REQUIRED) else preset_of(names or ())
    chosen = column_map or (PRESETS[seen] if seen else None)
    demo = DEMOS[chosen.preset] if chosen is not None and chosen.preset else None
    at = places(demo, names, count) if demo else {}
    mapped = {} if chosen is None else {
        name: at[source] if source in at else _locate(source, names, count, name, file)
        for name, source in chosen.sources.items()
    }  # fmt: skip
    wrong = mapped_in_another_unit(mapped, names, file)
    clashes = [
        _clash(name, [names[index] for index in several], file)
        for name, several in named.items()
        if names and len(several) > 1 and name not in mapped
    ]
    if clashes or wrong:
        raise UnusableFileError([*clashes, *wrong])
    indices = {name: several[0] for name, several in named.items()} | mapped
    if front and not {"rear_x_m", "rear_y_m"} & set(indices) and {"front_x_m", "front_y_m"} <= set(indices):
        indices = {name.replace("front_", "rear_") if name in _OF_FRONT else name: at for name, at in indices.items()}
    missing = [name for name in REQUIRED if name not in indices]
    there = [each for each in said_in_another_unit(names, file, missing) if each.column not in indices]
    if missing or there:
        absent = [name for name in missing if name not in {finding.column for finding in there}]
        faults = [*there, *(_missing(name, names, count, file) for name in absent)]
        raise UnusableFileError([*faults, *_only_front(indices, missing, file)])
    findings: list[Finding] = []
    if demo is not None and chosen is not None:
        how = f"the header is that of the preset {seen}" if seen else f"read by the preset {chosen.preset}"
        findings.append(warn(file, Code.PRESET, f"{how}: {_told(demo, mapped, names)}"))
    ignored = [i for i in range(count) if i not in set(indices.values())]
    if ignored:
        listed = ", ".join(quoted(names[i]) if names and names[i] else f"#{i}" for i in ignored[:12])
        message = f"not used: {listed}{', ...' if len(ignored) > 12 else ''}"
        findings.append(warn(file, Code.IGNORED_COLUMN, message))
    checked = {name: at[name] for name in demo.checked if name in at} if demo else {}
    preset = chosen.preset if chosen else None
    return Resolution(indices, chosen.zero_start if chosen else False, tuple(findings), preset, checked)


def _told(demo: Demo, mapped: Mapping[str, int], names: Sequence[str] | None) -> str:
    """What a preset made of a file, in one sentence."""
    columns = [f"{name} is {quoted(names[index]) if names else f'#{index}'}" for name, index in mapped.items()]
    clauses = [
        f"written by {demo.program}",
        ", ".join(columns),
        f"the position is that of {demo.body}",
        "x lies along the slope and z normal to it where the slope is made by tilting gravity",
        *demo.notes,
        "time and x are counted from the first row",
    ]
    return "; ".join(clauses)


def _by_name(names: Sequence[str] | None, labels: Collection[str] = ()) -> dict[str, list[int]]:
    """Which columns have each meaning: two, where a header says a thing twice."""
    found: dict[str, list[int]] = {}
    for index, name in enumerate(names or ()):
        meaning = meaning_of(name)
        if meaning in BY_NAME or meaning in labels:
            found.setdefault(str(meaning), []).append(index)
    return found


def _clash(name: str, headers: Sequence[str], file: str) -> Finding:
    listed = " and ".join(quoted(header) for header in headers[:12])
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


def _only_front(indices: Collection[str], missing: Collection[str], file: str) -> list[Finding]:
    """A word where the front wheel is there and the rear one is not."""
    if not set(_OF_FRONT) <= set(indices) or "time_s" in missing:
        return []
    message = (
        "only the front wheel is recorded: pass --reference front-wheel to have the rear wheel taken one wheelbase "
        "behind it"
    )
    return [reject(file, Code.REFERENCE, message, column="front_x_m")]


def _missing(name: str, names: Sequence[str] | None, count: int, file: str, wanted: str | None = None) -> Finding:
    what = f"no column {quoted(wanted)} for {name}" if wanted else f"no column for {name}"
    if names is None:
        has = f"there is no header over its {count} columns"
        remedy = f"give a column map with 0-based indices, for example {_EXAMPLE}"
    else:
        has = f"the header has {', '.join(quoted(each) for each in names[:16])}"
        remedy = told_by_header(names) or f"give a column map, or a preset among {', '.join(PRESETS)}"
    return reject(file, Code.MISSING_COLUMN, f"{what}: {has}; {remedy}", column=name)
