"""How bands and probabilities did on left-out runs: nothing of a run is in what is said of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from service.learning.doubt import multipliers
from service.learning.doubt.evidence import Evidence
from service.learning.doubt.excursions import UNIT_OFFSET, Excursion
from service.learning.doubt.multipliers import COAST, DRIVE, LEVELS, Kinds
from service.learning.doubt.outcomes import OutcomeLaw
from service.learning.doubt.reliability import reliability
from service.physics.scenario import Array

USUAL_LEVEL = 0.9
_MOST_FOLDS = 200
_FAR_S = 10.5  # runs that last longer tell how doubt goes on beyond ten seconds
_BEYOND_S = 10.0
_SLID_M = -0.25
# The reserve is the resistance, as a fraction of the weight, that the rover could still climb against.
_RESERVES = (("far from stalling", 0.25, np.inf), ("in between", 0.12, 0.25), ("near stalling", -np.inf, 0.12))


def tables(evidence: Evidence, expected: Array) -> Array:
    """Multipliers for x and y, (2, group, level), from all runs and what the others lead one to expect of each."""
    x, y = _scores(evidence, expected)
    return np.stack([multipliers.multipliers(x, evidence.kinds), multipliers.multipliers(y, evidence.kinds)])


def measure(evidence: Evidence, expected: Array) -> dict[str, Any]:
    """Coverage and widths at the usual level by regime, coverage by level, and outcomes, as JSON values."""
    found, levels = evidence.found, list(LEVELS)
    inside = _left_out_inside(evidence, expected)
    usual = levels.index(USUAL_LEVEL)
    regimes = _regimes(found, evidence.kinds)
    true, borders = evidence.outcomes()
    chances = OutcomeLaw.left_out(true, borders, UNIT_OFFSET * expected[0])
    return {
        "level": USUAL_LEVEL,
        "runs": len(found),
        "regimes": {
            name: _regime([inside[row] for row in np.flatnonzero(members)], from_s, usual)
            for name, (members, from_s) in regimes.items()
            if members.any()
        },
        "levels": {
            f"{level:g}": float(np.mean([each.x[at].mean() for each in inside])) for at, level in enumerate(levels)
        },
        "y": float(np.mean([each.y[usual].mean() for each in inside])),
        "outcomes": reliability(true, chances),
    }


class _Inside:
    """Of one run, whether it is inside by level and time, (level, time), for x and y; the usual band's width in x."""

    def __init__(self, each: Excursion, scores: tuple[Array, Array], factors: Array, expected: Array) -> None:
        self.time_s = each.time_s[1:]
        self.x, self.y = (one <= factor[:, None] for one, factor in zip(scores, factors, strict=True))
        self.half_m = each.half_width(factors[0, LEVELS.index(USUAL_LEVEL)], float(expected[0]))


def _left_out_inside(evidence: Evidence, expected: Array) -> list[_Inside]:
    count, shares = len(evidence.found), evidence.shares()
    x, y = _scores(evidence, expected)
    found: dict[int, _Inside] = {}
    folds = min(count, _MOST_FOLDS)
    for fold in range(folds):
        left = range(fold, count, folds)
        others = np.setdiff1d(np.arange(count), left)
        touched = np.setdiff1d(evidence.touched(left, shares), left)
        again = _scores(evidence, evidence.expected(touched.tolist(), left), touched.tolist())
        sides = []
        for plain, new in zip((x, y), again, strict=True):
            changed = dict(zip(touched.tolist(), new, strict=True))
            sides.append([changed.get(row, plain[row]) for row in others.tolist()])
        kinds = Kinds(evidence.kinds.kind[others], evidence.kinds.speed_m_s[others])
        made = [multipliers.multipliers(side, kinds) for side in sides]
        own = evidence.expected(left, left)
        for row, there, scores in zip(left, own.T, zip(*_scores(evidence, own, left), strict=True), strict=True):
            one = Kinds(evidence.kinds.kind[[row]], evidence.kinds.speed_m_s[[row]])
            factors = np.array([[float(multipliers.at(table, one, level)[0]) for level in LEVELS] for table in made])
            found[row] = _Inside(evidence.found[row], scores, factors, there)
    return [found[row] for row in range(count)]


def _scores(evidence: Evidence, expected: Array, rows: Sequence[int] | None = None) -> tuple[list[Array], list[Array]]:
    """Of x and y: each run's errors beyond the first time in units of what was expected, (time - 1,)."""
    chosen = evidence.found if rows is None else [evidence.found[row] for row in rows]
    x = [each.scores(float(there)) for each, there in zip(chosen, expected[0], strict=True)]
    y = [each.y_error_m[1:] / there for each, there in zip(chosen, expected[1], strict=True)]
    return x, y


def _regimes(found: Sequence[Excursion], kinds: Kinds) -> Mapping[str, tuple[npt.NDArray[np.bool_], float]]:
    """Which runs belong to each, and the time (s) from which on they count."""
    constant = kinds.kind != DRIVE
    coasts = kinds.kind == COAST
    slid = np.array([min(each.true_x_m[-1], each.central_m[-1]) < _SLID_M for each in found])
    reserve = np.array([each.reserve() for each in found])
    climbs = constant & ~coasts & ~slid
    lasts = np.array([each.run.horizon_s > _FAR_S for each in found])
    regimes = {name: (climbs & (reserve >= low) & (reserve < high), 0.0) for name, low, high in _RESERVES}
    return regimes | {
        "sliding": (constant & slid & ~coasts, 0.0),
        "downhill or free wheels": (coasts, 0.0),
        "beyond 10 s": (constant & lasts, _BEYOND_S),
        "drives": (~constant, 0.0),
    }


def _regime(members: Sequence[_Inside], from_s: float, level: int) -> dict[str, Any]:
    return {
        "runs": len(members),
        "pointwise": float(np.mean([each.x[level][each.time_s > from_s].mean() for each in members])),
        "whole": float(np.mean([each.x[level].all() for each in members])),
        "y_pointwise": float(np.mean([each.y[level][each.time_s > from_s].mean() for each in members])),
        "median_half_width_m": float(np.median([each.half_m[-1] for each in members])),
    }
