"""A prediction or a drive as a page for people: the picture, the summary, what is outside the domain, some points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, is_dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from service.pictures.report import Cell, Report, Section, Table, as_html
from service.wire.forms.numbers import DECIMALS, is_rounded, require_finite
from service.wire.forms.plot import drawing_of
from service.wire.forms.subject import Writable

_UNITS = {"_rad_s": "rad/s", "_m_s": "m/s", "_deg": "°", "_kg": "kg", "_nm": "N m", "_m": "m", "_s": "s", "_j": "J"}
MOST_ROWS = 41
"""Points that the table shows, spread evenly; the other forms have all."""


def encode_html(subject: Writable) -> bytes:
    """The page. Raises NonFiniteError, and MissingPartError where Matplotlib is not installed."""
    require_finite(subject.scalars(), "answer")
    drawing, about = drawing_of(subject), subject.about()
    title, _, rest = subject.picture().title.partition("\n")
    domain = about["domain"]
    warning = "" if domain["inside"] else "Outside the model's domain: what is said here is extrapolated there."
    report = Report(
        title=title,
        lead=rest,
        facts=_facts(about),
        sections=[
            Section("Where it goes", [drawing.description], figure=drawing, tables=[_points(subject)]),
            *_events(about),
            *_domain(domain),
        ],
        warning=warning,
    )
    return as_html(report)


def _facts(about: Mapping[str, Any]) -> dict[str, Cell]:
    model, facts = about["model"], {"model": f"{about['model']['name']}@{about['model']['version']}"}
    alias = {"asked for as": model["alias"]} if model["alias"] else {}
    scenario = _flat(about["scenario"] if "scenario" in about else about["drive"])
    found: dict[str, Cell] = {**facts, **alias, "frame": about["frame"], **scenario, **_flat(about["summary"])}
    if "band" in about:
        found["band_level"] = about["band"]["level"]
    return {words_of(name): value for name, value in found.items() if value is not None}


def words_of(name: str) -> str:
    """A name of an answer for people: `mean_speed_m_s` is "mean speed, m/s"."""
    for ending, unit in _UNITS.items():
        if name.endswith(ending):
            return f"{name.removesuffix(ending).replace('_', ' ')}, {unit}"
    return name.replace("_", " ")


def _flat(members: object) -> dict[str, Cell]:
    """Members under the names of the JSON answer, those of a member with members of its own beside them."""
    known = asdict(members) if is_dataclass(members) and not isinstance(members, type) else members
    found: dict[str, Cell] = {}
    assert isinstance(known, Mapping)
    for name, value in known.items():
        if isinstance(value, Mapping):
            found |= {f"{name}: {inner}": each for inner, each in _flat(value).items()}
        else:
            found[name] = str(value) if isinstance(value, str) else value
    return found


def _points(subject: Writable) -> Table:
    columns = subject.columns()
    count = len(columns["time_s"])
    rows = np.unique(np.linspace(0, count - 1, min(count, MOST_ROWS)).round().astype(int))
    shown = f"{len(rows)} of {count} points, evenly spread" if len(rows) < count else f"all {count} points"
    cells = zip(*(_cells(name, values[rows]) for name, values in columns.items()), strict=True)
    return Table(shown, list(columns), list(cells), digits=5)


def _cells(name: str, values: npt.NDArray[Any]) -> list[Any]:
    """The numbers of the JSON answer."""
    cells: list[Any] = values.tolist()
    return [round(each, DECIMALS) for each in cells] if is_rounded(name, values) else cells


def _events(about: Mapping[str, Any]) -> list[Section]:
    if "events" not in about:
        return []
    rows = [(each.event.value, each.time_s, each.x_m) for each in about["events"]]
    return [Section("What happens", tables=[Table("Events", ("event", "time_s", "x_m"), rows)] if rows else [],
                    sentences=[] if rows else ["Nothing happens on the way."])]  # fmt: skip


def _domain(domain: Mapping[str, Any]) -> list[Section]:
    """What is outside, in sentences; of a drive, stretch by stretch."""
    if "stretches" not in domain:
        points = [str(each["detail"]) for each in domain["reasons"]]
        inside = "The scenario lies among the training runs." if not points else ""
        return [Section("Domain", [inside] if inside else [], points)]
    rows = [
        (each["from_s"], each["to_s"], each["from_m"], each["to_m"], each["inside"],
         "; ".join(str(reason["detail"]) for reason in each["reasons"]))
        for each in domain["stretches"]
    ]  # fmt: skip
    columns = ("from_s", "to_s", "from_m", "to_m", "inside", "what is outside")
    return [Section("Domain", tables=[Table("Stretches of the way", columns, rows)])]
