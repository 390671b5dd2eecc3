"""Reads scenarios as people have them into columns. One that cannot be read sinks no other. No I/O."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np

from rover_twin_client.answers import Array, Scenario
from rover_twin_client.batch.answers import ASKED, TABLE_COLUMNS, FailedPrediction
from rover_twin_client.calls import refused
from rover_twin_client.errors import InvalidInputError

Numbers: TypeAlias = float | Sequence[float] | Array
"""One number for all scenarios, or one for each."""
Scenarios: TypeAlias = Any
"""Mappings or `Scenario`s, a mapping of columns, or a table of pandas or polars with these columns."""
Faults: TypeAlias = dict[int, InvalidInputError]
"""What is wrong with a scenario that is not worth sending, by its place."""

TAKEN = "one or more scenarios: mappings with slope_deg, mass_kg, torque_nm (and horizon_s), or columns of them"
_ROW = "a mapping with slope_deg, mass_kg, torque_nm, and horizon_s if wanted"
_HORIZON = "a number of seconds, or None for that of the service"


def read(scenarios: Scenarios | None, own: Mapping[str, Numbers | None]) -> tuple[dict[str, Array], Faults]:
    """Columns (N,) of all fields, NaN where a horizon is left to the service; and the scenarios that cannot be read.

    Raises InvalidInputError for what are no scenarios, not as many of each, or when not one can be read.
    """
    faults: Faults = {}
    given = {name: _numbers(name, value, faults) for name, value in own.items() if value is not None}
    if scenarios is not None:
        table = _table(scenarios, faults)
        if twice := sorted(given.keys() & table.keys()):
            raise refused(twice[0], "given twice", "either in the scenarios or as an argument for all of them")
        given |= table
    if faults and len(faults) == max(values.size for values in given.values()):
        raise faults[min(faults)]
    return _columns(given), faults


def failures(faults: Faults) -> dict[int, FailedPrediction]:
    """The same as the batch tells them."""
    return {at: FailedPrediction(at, str(fault), fault.faults) for at, fault in faults.items()}


def _columns(given: Mapping[str, Array]) -> dict[str, Array]:
    for name in ASKED[:3]:
        if name not in given:
            raise refused(name, None, "a number for all scenarios, or one for each")
    sizes = {name: values.size for name, values in given.items() if values.ndim}
    count = next(iter(sizes.values()), 1)
    for name, size in sizes.items():
        if size != count:
            raise refused(name, f"{size} numbers", f"one number, or {count} as in {next(iter(sizes))}")
    if count == 0:
        raise refused("scenarios", "none", TAKEN)
    whole = {"horizon_s": np.array(np.nan), **given}
    return {name: np.array(np.broadcast_to(whole[name], (count,)), dtype=np.float64) for name in ASKED}


def _table(scenarios: Scenarios, faults: Faults) -> dict[str, Array]:
    if hasattr(scenarios, "columns"):  # of pandas or polars; that of a batch has its answers beside the questions
        names = [name for name in scenarios.columns if str(name) not in TABLE_COLUMNS]
    elif isinstance(scenarios, Mapping):
        names = list(scenarios)
    elif isinstance(scenarios, str | bytes) or not isinstance(scenarios, Iterable):
        raise refused("scenarios", scenarios, TAKEN)
    else:
        return _rows(scenarios, faults)
    for name in names:
        if str(name) not in ASKED:
            raise refused("scenarios", f"a table with a column {name}", "columns " + ", ".join(ASKED))
    return {str(name): _numbers(str(name), scenarios[name], faults) for name in names}


def _rows(scenarios: Iterable[object], faults: Faults) -> dict[str, Array]:
    rows: list[dict[str, float]] = []
    for at, each in enumerate(scenarios):
        try:
            rows.append(_row(at, each, faults))
        except InvalidInputError as fault:
            faults[at] = fault
            rows.append({})
    if not rows:
        raise refused("scenarios", [], TAKEN)
    if len(faults) == len(rows):
        raise faults[min(faults)]
    names = [name for name in ASKED if any(name in row for row in rows)]
    return {name: np.array([row.get(name, math.nan) for row in rows], dtype=np.float64) for name in names}


def _row(at: int, each: object, faults: Faults) -> dict[str, float]:
    """The fields that can be read; adds the first other one to the faults. Raises InvalidInputError for no scenario."""
    if isinstance(each, Scenario):
        each = {name: getattr(each, name) for name in ASKED}
    if not isinstance(each, Mapping):
        raise refused(f"scenarios[{at}]", each, _ROW)
    for name in each:
        if name not in ASKED:
            raise refused(f"scenarios[{at}]", str(name), "fields " + ", ".join(ASKED))
    row: dict[str, float] = {}
    for name, value in each.items():
        try:
            row[name] = _number(f"scenarios[{at}].{name}", value)
        except InvalidInputError as fault:
            faults.setdefault(at, fault)
    return row


def _number(name: str, value: Any) -> float:  # noqa: ANN401 - whatever people have there
    """A number, NaN for None; raises InvalidInputError for anything else, and for a horizon that is NaN."""
    if value is None:
        return math.nan
    try:
        found = float(value)
    except (TypeError, ValueError, OverflowError) as fault:
        raise refused(name, value, "a number") from fault
    if math.isnan(found) and name.endswith("horizon_s"):
        raise refused(name, found, _HORIZON)
    return found


def _numbers(name: str, values: object, faults: Faults) -> Array:
    """A number (), or numbers (N,); NaN stands for one that is missing. Adds those that are none to the faults."""
    if isinstance(values, Iterable) and not hasattr(values, "__array__") and not isinstance(values, str | bytes):
        values = list(values)
    try:
        found = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as fault:
        is_flat = getattr(values, "ndim", 1) == 1
        if isinstance(values, str | bytes | Mapping) or not isinstance(values, Iterable) or not is_flat:
            raise refused(name, values, "a number, or a flat list of numbers") from fault
        return _one_by_one(name, list(values), faults)
    if found.ndim > 1:
        raise refused(name, f"an array of shape {found.shape}", "a number, or a flat list of numbers")
    if name == "horizon_s" and np.isnan(found).any():
        if found.ndim and isinstance(values, Iterable):
            return _one_by_one(name, list(values), faults)  # as an array, None is NaN too
        raise refused(name, math.nan, _HORIZON)
    return found


def _one_by_one(name: str, values: list[object], faults: Faults) -> Array:
    found = np.full(len(values), np.nan)
    for at, value in enumerate(values):
        try:
            found[at] = _number(f"scenarios[{at}].{name}", value)
        except InvalidInputError as fault:
            faults.setdefault(at, fault)
    return found
