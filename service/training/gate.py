"""The promotion gate: is a candidate better than the champion, on runs that neither has seen?

Why these rules: docs/decisions/0011-promotion-gate.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np

from model_store import CorruptArtefactError, ModelStore, NotFoundError, UnsupportedFormatError
from service.errors import InvalidValueError
from service.training.evidence import Errors, Evidence, RunKey, read_evidence

DEFAULT_MARGIN = 0.05
MAX_MARGIN = 0.5
LEAST_COMMON_RUNS = 5
TAIL_ALLOWANCE = 1.10
"""A 90th percentile of the candidate may be at most this many times the champion's."""
FLOOR_M = 0.001
"""Errors below 1 mm count as 1 mm: nobody drives by less, and ratios of tiny errors would drown the others."""

_TAILS = {"rmse_m": "rms error", "final_m": "final error", "maximum_m": "largest error"}


class Verdict(StrEnum):
    """What the gate says; the first two let a candidate through."""

    FIRST = "first"
    BETTER = "better"
    NOT_BETTER = "not_better"
    NOT_COMPARABLE = "not_comparable"


@dataclass(frozen=True, slots=True)
class Tail:
    """90th percentiles (m, floored at 1 mm) over the common runs of one kind of error."""

    candidate_m: float
    against_m: float

    @property
    def ratio(self) -> float:
        """Candidate over champion, dimensionless."""
        return self.candidate_m / self.against_m


@dataclass(frozen=True, slots=True)
class Comparison:
    """The verdict on `candidate`, and what it rests on. Versions read "name@number".

    `ratio` is the geometric mean over the common runs of the candidate's rms error over the champion's; None, and
    `tails` empty, where nothing could be compared. `seen_by_candidate` and `seen_by_against` count runs unseen by one
    side only because the other was trained on them.
    """

    candidate: str
    against: str | None
    margin: float
    verdict: Verdict
    reason: str
    common_runs: int = 0
    ratio: float | None = None
    tails: Mapping[str, Tail] = field(default_factory=dict)
    seen_by_candidate: int = 0
    seen_by_against: int = 0

    @property
    def promote(self) -> bool:
        """Whether the candidate should become the champion."""
        return self.verdict in (Verdict.FIRST, Verdict.BETTER)

    def sentence(self) -> str:
        """The verdict with its reason, for people, logs and the alias history."""
        if self.against is None:
            return f"{self.candidate} is the first: {self.reason}"
        words = {
            Verdict.BETTER: "is better than",
            Verdict.NOT_BETTER: "is not better than",
            Verdict.NOT_COMPARABLE: "cannot be compared with",
        }
        return f"{self.candidate} {words[self.verdict]} {self.against}: {self.reason}"

    def describe(self) -> dict[str, Any]:
        """Plain JSON content; errors in metres, ratios dimensionless."""
        return {
            "candidate": self.candidate,
            "against": self.against,
            "verdict": self.verdict.value,
            "promote": self.promote,
            "sentence": self.sentence(),
            "margin": self.margin,
            "common_runs": self.common_runs,
            "ratio": self.ratio,
            "p90": {name: asdict(tail) | {"ratio": tail.ratio} for name, tail in self.tails.items()},
            "seen_by_candidate": self.seen_by_candidate,
            "seen_by_against": self.seen_by_against,
        }


def compare(
    store: ModelStore,
    model: str,
    candidate_version: int,
    against_version: int | None,
    *,
    margin: float = DEFAULT_MARGIN,
) -> Comparison:
    """Judge a version of a model beside another one, or beside none when the model has no champion yet.

    Reads two manifests and two reports, no datasets. A champion that is damaged or gone is "not comparable": people
    decide then. Raises InvalidValueError for a margin outside 0..0.5, and what the store raises for the candidate.
    """
    against = None if against_version is None else (model, against_version)
    return compare_versions(store, (model, candidate_version), against, margin=margin)


def compare_versions(
    store: ModelStore, candidate: tuple[str, int], against: tuple[str, int] | None, *, margin: float = DEFAULT_MARGIN
) -> Comparison:
    """`compare` for versions, as (name, number), of any two models."""
    if not 0 <= margin <= MAX_MARGIN:
        raise InvalidValueError("margin", margin, f"0 to {MAX_MARGIN:g}")
    ours = read_evidence(store, store.manifest(*candidate))
    if against is None:
        return Comparison(ours.version, None, margin, Verdict.FIRST, "there is no champion to compare it with")
    theirs_name = f"{against[0]}@{against[1]}"
    try:
        theirs = read_evidence(store, store.manifest(*against))
    except (CorruptArtefactError, UnsupportedFormatError, NotFoundError) as error:
        return Comparison(ours.version, theirs_name, margin, Verdict.NOT_COMPARABLE, str(error))
    return _judge(ours, theirs, margin)


def _judge(ours: Evidence, theirs: Evidence, margin: float) -> Comparison:
    common = sorted(ours.errors.keys() & theirs.errors.keys())
    facts: dict[str, Any] = {
        "candidate": ours.version,
        "against": theirs.version,
        "margin": margin,
        "common_runs": len(common),
        "seen_by_candidate": _seen(theirs, ours),
        "seen_by_against": _seen(ours, theirs),
    }
    if len(common) < LEAST_COMMON_RUNS:
        return Comparison(verdict=Verdict.NOT_COMPARABLE, reason=_too_few(ours, theirs, len(common)), **facts)
    rms = _floored(ours, common, "rmse_m") / _floored(theirs, common, "rmse_m")
    ratio = float(np.exp(np.mean(np.log(rms))))
    tails = {name: Tail(_p90(ours, common, name), _p90(theirs, common, name)) for name in _TAILS}
    verdict, reason = _verdict(ratio, tails, margin, len(common))
    return Comparison(verdict=verdict, reason=reason, ratio=ratio, tails=tails, **facts)


def _verdict(ratio: float, tails: Mapping[str, Tail], margin: float, runs: int) -> tuple[Verdict, str]:
    measured = f"over {runs} runs, each predicted without it, its rms error is {ratio:.3f} times as large"
    allowed = f"at most {1 - margin:g} is asked for"
    if ratio > 1 - margin or ratio >= 1:
        return Verdict.NOT_BETTER, f"{measured}, {allowed}"
    name, worst = max(tails.items(), key=lambda item: item[1].ratio)
    if worst.ratio > TAIL_ALLOWANCE:
        return Verdict.NOT_BETTER, (
            f"{measured}, but the 90th percentile of its {_TAILS[name]} is {100 * worst.candidate_m:.2f} cm where the "
            f"other has {100 * worst.against_m:.2f} cm; at most {TAIL_ALLOWANCE:g} times as much is allowed"
        )
    return Verdict.BETTER, f"{measured}, {allowed}"


def _too_few(ours: Evidence, theirs: Evidence, common: int) -> str:
    for side in (ours, theirs):
        if not side.errors:
            return f"{side.version} has no errors on unseen runs; train it with test runs"
    seen = "; ".join(
        f"{judge.version} was trained on {count} of the {len(side.errors)} runs that {side.version} has not seen"
        for side, judge in ((ours, theirs), (theirs, ours))
        if (count := _seen(side, judge))
    )
    return f"{common} runs are unseen by both, at least {LEAST_COMMON_RUNS} are needed" + (f"; {seen}" if seen else "")


def _seen(side: Evidence, judge: Evidence) -> int:
    """How many unseen runs of one side the other was made from, without having predicted them unseen."""
    return sum(key not in judge.errors and key.run in judge.trained_on for key in side.errors)


def _floored(side: Evidence, runs: list[RunKey], name: str) -> np.ndarray[Any, np.dtype[np.float64]]:
    return np.maximum([_error(side.errors[run], name) for run in runs], FLOOR_M)


def _p90(side: Evidence, runs: list[RunKey], name: str) -> float:
    return float(np.quantile(_floored(side, runs, name), 0.9))


def _error(errors: Errors, name: str) -> float:
    return float(getattr(errors, name))
