"""The answers to many scenarios, as columns; one of them in full is `batch[row]`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from service.learning.domain import DomainVerdicts
from service.physics.scenario import Array
from service.twin.many import ManyScenarios
from service.twin.prediction import Frame, NonFiniteError, Prediction, PredictionBand
from service.twin.scenario import sample_times
from service.twin.summary import Summaries

Index = npt.NDArray[np.intp]


def sample_grid(horizons_s: Sequence[float], dt_s: float) -> Array:
    """The `sample_times` of many scenarios, s: (time,) where all horizons are one, otherwise (scenario, time).

    Rows shorter than the longest are filled up with their horizon, so that nothing moves there. The whole grid is held
    in memory: whoever lets others ask bounds scenarios times the longest row (`sample_count`).

    Raises InvalidValueError unless all are positive and finite.
    """
    rows = {horizon: sample_times(horizon, dt_s) for horizon in dict.fromkeys(horizons_s)}
    if len(rows) == 1:
        return next(iter(rows.values()))
    longest = max(map(len, rows.values()), default=0)
    grid = np.empty((len(horizons_s), longest))
    for at, horizon in enumerate(horizons_s):
        row = rows[horizon]
        grid[at, : len(row)] = row
        grid[at, len(row) :] = horizon
    return grid


def own_samples(time_s: Array, horizons_s: Array) -> npt.NDArray[np.intp]:
    """How many samples of each row come before the horizon is repeated, shape (scenario,). Raises ValueError."""
    rows = len(horizons_s)
    if rows == 0 or time_s.ndim not in (1, 2) or (time_s.ndim == 2 and len(time_s) != rows) or not time_s.size:
        raise ValueError(f"times of shape {time_s.shape} do not fit {rows} scenarios")
    if rows == 1 and time_s.ndim == 1:
        wrong = time_s[-1] != horizons_s[0]
    else:
        wrong = bool(np.any(time_s[..., -1] != horizons_s))
    if wrong:
        raise ValueError("times must end at their scenario's horizon")
    if time_s.ndim == 1:
        return np.full(rows, len(time_s), dtype=np.intp)
    return np.asarray((time_s >= time_s[:, -1:]).argmax(axis=1) + 1, dtype=np.intp)


@dataclass(frozen=True, slots=True, eq=False)
class PredictionBatch:
    """Predictions in columns, the members those of `Prediction`: arrays that have shape (time,) there have
    (scenario, time) here, those of `band` too.

    `time_s` has shape (time,) where all scenarios share it, otherwise (scenario, time); `trajectory` is without it. Of
    a row only the first `counts[row]` samples are its own; the rest repeats the last one. Prior and band are None
    unless asked for.
    """

    scenarios: ManyScenarios
    frame: Frame
    time_s: Array
    counts: Index
    trajectory: Mapping[str, Array]
    prior_name: str
    prior: Mapping[str, Array] | None
    domain: DomainVerdicts
    summaries: Summaries
    band: PredictionBand | None = None

    def __len__(self) -> int:
        return len(self.scenarios)

    def __iter__(self) -> Iterator[Prediction]:
        return (self[row] for row in range(len(self)))

    def only(self, rows: Index) -> PredictionBatch:
        """Some of the predictions; the arrays are copies."""
        return PredictionBatch(
            scenarios=self.scenarios.only(rows),
            frame=self.frame,
            time_s=self.time_s if self.time_s.ndim == 1 else self.time_s[rows],
            counts=self.counts[rows],
            trajectory={name: column[rows] for name, column in self.trajectory.items()},
            prior_name=self.prior_name,
            prior=None if self.prior is None else {name: column[rows] for name, column in self.prior.items()},
            domain=self.domain.only(rows),
            summaries=self.summaries.only(rows),
            band=self.band
            and PredictionBand(self.band.level, **{name: each[rows] for name, each in self.band.columns().items()}),
        )

    def __getitem__(self, row: int) -> Prediction:
        """One prediction; its arrays are views of the columns."""
        if not -len(self) <= row < len(self):
            raise IndexError(f"row {row} of {len(self)} predictions")
        count = int(self.counts[row])
        time = (self.time_s if self.time_s.ndim == 1 else self.time_s[row])[:count]
        bounds = None if self.band is None else _first(self.band.columns(), row, count)
        return Prediction(
            scenario=self.scenarios[row],
            frame=self.frame,
            trajectory={"time_s": time, **_first(self.trajectory, row, count)},
            prior_name=self.prior_name,
            prior=None if self.prior is None else _first(self.prior, row, count),
            domain=self.domain[row],
            summary=self.summaries[row],
            band=None if self.band is None or bounds is None else PredictionBand(self.band.level, **bounds),
        )


def predict_finite(
    predict: Callable[[Index], PredictionBatch], rows: Index
) -> tuple[PredictionBatch | None, Index, dict[int, NonFiniteError]]:
    """What `predict` answers for those rows that have a finite answer, these rows, and what is wrong with the others.

    `predict` is `Twin.predict_many` for some rows. One that fails is searched for by halving, so that one in a
    thousand costs about as much as three more predictions; None where nothing is left.
    """
    if not len(rows):
        return None, rows, {}
    try:
        return predict(rows), rows, {}
    except NonFiniteError as error:
        failed = _failures(predict, rows, error)
    left = rows[~np.isin(rows, list(failed))]
    return (predict(left) if len(left) else None), left, failed


def _failures(
    predict: Callable[[Index], PredictionBatch], rows: Index, error: NonFiniteError
) -> dict[int, NonFiniteError]:
    """What is wrong with each of the rows that fail, of some that fail together with `error`."""
    if len(rows) == 1:
        return {int(rows[0]): error}
    failed: dict[int, NonFiniteError] = {}
    for half in np.array_split(rows, 2):
        try:
            predict(half)
        except NonFiniteError as found:
            failed |= _failures(predict, half, found)
    return failed


def _first(columns: Mapping[str, Array], row: int, count: int) -> dict[str, Array]:
    return {name: column[row, :count] for name, column in columns.items()}
