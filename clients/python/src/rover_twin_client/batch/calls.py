"""Builds the calls that predict many scenarios, and keeps account of which are answered. No I/O."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import Any

import numpy as np

from rover_twin_client.answers import Array, ModelIdentity
from rover_twin_client.batch import parsing
from rover_twin_client.batch.answers import ASKED, FailedPrediction
from rover_twin_client.batch.columns import Numbers, Scenarios, failures, read
from rover_twin_client.batch.parsing import Piece
from rover_twin_client.calls import Call, column, finite, flag, inclusions, require_band, said
from rover_twin_client.errors import InvalidInputError, RefusedError, UnexpectedAnswerError

PIECE_SCENARIOS = 500  # half of what the service takes: a piece every second or so, for the progress
PIECE_POINTS = 200_000  # a fifth of what the service takes; some megabytes
AT_ONCE = 4  # requests; a service computes on a few threads
BATCH_READ_S = 120.0
_USUAL = {"horizon_s": 10.0, "dt_s": 0.05}  # the service's own, only to guess how many points there will be


@dataclass(frozen=True, slots=True, eq=False)
class BatchQuestion:
    """Scenarios as columns (N,), NaN for a horizon that is left to the service; and what they share.

    `unreadable` are those that this client could not read, by place. They are sent without a slope, which the service
    refuses like any other fault, so that rows keep their places.
    """

    columns: Mapping[str, Array]
    shared: Mapping[str, Any]
    unreadable: Mapping[int, FailedPrediction] = field(default_factory=dict)

    @property
    def count(self) -> int:
        """The number of scenarios."""
        return int(self.columns["slope_deg"].size)

    def call(self, start: int, stop: int, model: ModelIdentity | None) -> Call[Piece]:
        """POST /v1/predictions/batch with the scenarios from `start` to before `stop`, to this very version."""
        rows = zip(*(self.columns[name][start:stop].tolist() for name in ASKED), strict=True)
        body = {**self.shared, **({} if model is None else {"model": f"{model.name}@{model.version}"})}
        body["scenarios"] = [_scenario(row) for row in rows]
        for at in self.unreadable.keys() & range(start, stop):
            body["scenarios"][at - start]["slope_deg"] = None
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
    """What is asked; raises InvalidInputError for what are no scenarios, or not as many of each (`columns`)."""
    wanted = list(inclusions(include))
    require_band(wanted, band_level)
    shared: dict[str, Any] = {
        name: finite(name, value) for name, value in said(dt_s=dt_s, band_level=band_level).items()
    }
    if times_s is not None:
        shared["times_s"] = column("times_s", times_s)
    shared |= said(model=model) | {"frame": frame}
    shared |= ({"include": wanted} if wanted else {}) | ({"strict": True} if flag("strict", strict) else {})
    columns, faults = read(scenarios, own)
    return BatchQuestion(columns, shared, failures(faults))


def _scenario(row: tuple[float, ...]) -> dict[str, float | str | None]:
    """As JSON. The service refuses this scenario for what is no number, and chooses a horizon that is not said."""
    written = {
        name: value if math.isfinite(value) else None if math.isnan(value) else str(value)
        for name, value in zip(ASKED, row, strict=True)
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
