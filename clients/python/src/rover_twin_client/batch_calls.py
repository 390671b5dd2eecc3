"""Builds the calls that predict many scenarios, and keeps account of which are answered. No I/O."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from http import HTTPStatus
from typing import Any, TypeAlias

import numpy as np

from rover_twin_client import batch_parsing as parsing
from rover_twin_client.answers import Array, ModelIdentity, Scenario
from rover_twin_client.batch_parsing import Piece
from rover_twin_client.calls import Call, column, finite, inclusions, refused, require_band, said
from rover_twin_client.errors import InvalidInputError, RefusedError, UnexpectedAnswerError

Numbers: TypeAlias = float | Sequence[float] | Array
"""One number for all scenarios, or one for each."""
Scenarios: TypeAlias = Any
"""Mappings or `Scenario`s, a mapping of columns, or a table of pandas or polars with these columns."""

FIELDS = ("slope_deg", "mass_kg", "torque_nm", "horizon_s")
PIECE_SCENARIOS = 500  # half of what the service takes: a piece every second or so, for the progress
PIECE_POINTS = 200_000  # a fifth of what the service takes; some megabytes
AT_ONCE = 4  # requests; a service computes on a few threads
BATCH_READ_S = 120.0
_USUAL = {"horizon_s": 10.0, "dt_s": 0.05}  # the service's own, only to guess how many points there will be
_TAKEN = "one or more scenarios: mappings with slope_deg, mass_kg, torque_nm (and horizon_s), or columns of them"


@dataclass(frozen=True, slots=True, eq=False)
class BatchQuestion:
    """Scenarios as columns (N,), NaN for a horizon that is left to the service; and what they share."""

    columns: Mapping[str, Array]
    shared: Mapping[str, Any]

    @property
    def count(self) -> int:
        """The number of scenarios."""
        return int(self.columns["slope_deg"].size)

    def call(self, start: int, stop: int, model: ModelIdentity | None) -> Call[Piece]:
        """POST /v1/predictions/batch with the scenarios from `start` to before `stop`, to this very version."""
        rows = zip(*(self.columns[name][start:stop].tolist() for name in FIELDS), strict=True)
        body = {**self.shared, **({} if model is None else {"model": f"{model.name}@{model.version}"})}
        body["scenarios"] = [_scenario(row) for row in rows]
        return Call(
            "/v1/predictions/batch",
            parsing.piece,
            {"format": "npz"},
            method="POST",
            headers={"Accept": "*/*"},
            json=body,
            read_s=BATCH_READ_S,
            is_document=False,
        )

    def most_scenarios(self) -> int:
        """How many scenarios to ask for in one request, so that the answer stays a handy one."""
        times = self.shared.get("times_s")
        horizons = self.columns["horizon_s"]
        longest = float(np.nanmax(horizons)) if np.isfinite(horizons).any() else _USUAL["horizon_s"]
        step = self.shared.get("dt_s", _USUAL["dt_s"])
        points = len(times) if times else longest / step if longest > 0 and step > 0 else 1
        return max(1, min(PIECE_SCENARIOS, int(PIECE_POINTS / max(points, 1))))


class BatchWork:
    """Which scenarios are still to be asked for, and the pieces that were answered.

    The first piece is asked for alone: its answer says which version all others are asked from, so that a batch has
    one version even if an alias moves meanwhile.
    """

    def __init__(self, question: BatchQuestion, report: Callable[[int], None]) -> None:
        self.question = question
        self.pieces: dict[int, Piece] = {}
        self._left: deque[tuple[int, int]] = deque([(0, question.count)])
        self._most = question.most_scenarios()
        self._model: ModelIdentity | None = None
        self._report = report

    def take_first(self) -> tuple[int, int] | None:
        """The first scenarios, until some are answered."""
        return self.take() if self._model is None else None

    def take(self) -> tuple[int, int] | None:
        """The next scenarios to ask for, from the first to before the second number; None when none are left."""
        try:
            start, stop = self._left.popleft()
        except IndexError:  # other threads take too
            return None
        if stop - start > self._most:
            self._left.appendleft((start + self._most, stop))
            stop = start + self._most
        return start, stop

    def call(self, span: tuple[int, int]) -> Call[Piece]:
        """The call that asks for them."""
        return self.question.call(*span, self._model)

    def answered(self, span: tuple[int, int], piece: Piece) -> None:
        """Keeps the answer; raises UnexpectedAnswerError when it is not one to all of them."""
        places = sorted([*piece.arrays["index"].tolist(), *(each.index for each in piece.failures)])
        if places != list(range(span[1] - span[0])):
            raise UnexpectedAnswerError(f"{span[1] - span[0]} scenarios were sent, the answer is to {len(places)}")
        self._model = self._model or piece.model
        self.pieces[span[0]] = piece
        self._report(span[1] - span[0])

    def refused(self, span: tuple[int, int], error: RefusedError) -> None:
        """Cuts smaller pieces where the service takes only those; otherwise raises the error."""
        start, stop = span
        if stop - start == 1 or not _too_many(error):
            raise error
        self._most = min(self._most, (stop - start) // 2)
        self._left.appendleft(span)

    def abandon(self) -> None:
        """Nothing more is to be asked for."""
        self._left.clear()

    def workers(self) -> int:
        """How many requests at once are worth it."""
        left = sum(stop - start for start, stop in self._left)
        return min(AT_ONCE, math.ceil(left / self._most))


def question(
    scenarios: Scenarios | None,
    own: Mapping[str, Numbers | None],
    *,
    dt_s: float | None,
    times_s: Iterable[float] | None,
    model: str | None,
    frame: str,
    include: Iterable[str],
    band_level: float | None,
    strict: bool,
) -> BatchQuestion:
    """What is asked; raises InvalidInputError for what are no scenarios, no numbers, or not as many of each."""
    require_band(include, band_level)
    shared: dict[str, Any] = {
        name: finite(name, value) for name, value in said(dt_s=dt_s, band_level=band_level).items()
    }
    if times_s is not None:
        shared["times_s"] = column("times_s", times_s)
    wanted = list(inclusions(include))
    shared |= said(model=model) | {"frame": frame}
    shared |= ({"include": wanted} if wanted else {}) | ({"strict": True} if strict else {})
    given = {name: _numbers(name, value) for name, value in own.items() if value is not None}
    if scenarios is not None:
        table = _table(scenarios)
        if twice := sorted(given.keys() & table.keys()):
            raise refused(twice[0], "given twice", "either in the scenarios or as an argument for all of them")
        given |= table
    return BatchQuestion(_columns(given), shared)


def _columns(given: Mapping[str, Array]) -> dict[str, Array]:
    for name in FIELDS[:3]:
        if name not in given:
            raise refused(name, None, "a number for all scenarios, or one for each")
    sizes = {name: values.size for name, values in given.items() if values.ndim}
    count = next(iter(sizes.values()), 1)
    for name, size in sizes.items():
        if size != count:
            raise refused(name, f"{size} numbers", f"one number, or {count} as in {next(iter(sizes))}")
    if count == 0:
        raise refused("scenarios", "none", _TAKEN)
    whole = {"horizon_s": np.array(np.nan), **given}
    return {name: np.array(np.broadcast_to(whole[name], (count,)), dtype=np.float64) for name in FIELDS}


def _table(scenarios: Scenarios) -> dict[str, Array]:
    if hasattr(scenarios, "columns"):  # of pandas or polars
        return _known({str(name): _numbers(str(name), scenarios[name]) for name in scenarios.columns})
    if isinstance(scenarios, Mapping):
        return _known({str(name): _numbers(str(name), values) for name, values in scenarios.items()})
    if isinstance(scenarios, str | bytes) or not isinstance(scenarios, Iterable):
        raise refused("scenarios", scenarios, _TAKEN)
    rows = [_row(at, each) for at, each in enumerate(scenarios)]
    if not rows:
        raise refused("scenarios", [], _TAKEN)
    names = [name for name in FIELDS if any(name in row for row in rows)]
    return {name: np.array([row.get(name, math.nan) for row in rows], dtype=np.float64) for name in names}


def _row(at: int, each: object) -> dict[str, float]:
    if isinstance(each, Scenario):
        return {name: float(getattr(each, name)) for name in FIELDS}
    if not isinstance(each, Mapping):
        raise refused(f"scenarios[{at}]", each, "a mapping with slope_deg, mass_kg, torque_nm, and horizon_s if wanted")
    for name in each:
        if name not in FIELDS:
            raise refused(f"scenarios[{at}]", str(name), "fields " + ", ".join(FIELDS))
    try:
        return {name: math.nan if value is None else float(value) for name, value in each.items()}
    except (TypeError, ValueError, OverflowError) as fault:
        raise refused(f"scenarios[{at}]", dict(each), "numbers") from fault


def _known(table: dict[str, Array]) -> dict[str, Array]:
    for name in table:
        if name not in FIELDS:
            raise refused("scenarios", f"a table with a column {name}", "columns " + ", ".join(FIELDS))
    return table


def _numbers(name: str, values: object) -> Array:
    """A number (), or numbers (N,); NaN stands for one that is missing."""
    if isinstance(values, Iterable) and not hasattr(values, "__array__") and not isinstance(values, str | bytes):
        values = list(values)
    try:
        found = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as fault:
        raise refused(name, values, "a number, or a flat list of numbers") from fault
    if found.ndim > 1:
        raise refused(name, f"an array of shape {found.shape}", "a number, or a flat list of numbers")
    return found


def _scenario(row: tuple[float, ...]) -> dict[str, float | str | None]:
    """As JSON. The service refuses this scenario for what is no number, and chooses a horizon that is not said."""
    written = {
        name: value if math.isfinite(value) else None if math.isnan(value) else str(value)
        for name, value in zip(FIELDS, row, strict=True)
    }
    if written["horizon_s"] is None:
        del written["horizon_s"]
    return written


def _too_many(error: RefusedError) -> bool:
    """Whether the service would take fewer of them: its operator may have set other limits than the usual ones."""
    if error.problem is not None and error.problem.status == HTTPStatus.REQUEST_ENTITY_TOO_LARGE:
        return True
    faults = error.faults if isinstance(error, InvalidInputError) else ()
    return any(
        fault.field == "scenarios" or (fault.field in ("dt_s", "times_s") and "for each of" in (fault.allowed or ""))
        for fault in faults
    )
