"""By how much to multiply the scale for each level, so that bands hold runs as often as they say.

Quantiles of the left-out runs' scores, each run weighing the same; those that went alike count more: constant scenarios
going uphill by how fast they move in the end, those that roll or go downhill, drives. Far ones count little, so
that a kind with few runs leans on all. Whole runs are looked after too: the share of them that leaves
the band somewhere is at most 2.2 times that of single times.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from service.physics.scenario import Array

LEVELS = (0.5, 0.55, 0.6, 0.65, 0.7, 0.75, 0.8, 0.85, 0.9, 0.925, 0.95, 0.975, 0.99)
_FAR_WEIGHT, _WHOLE_LEEWAY = 0.03, 2.2
_SLOW_M_S, _LENGTH = 0.05, 0.5  # speeds are compared as arcsinh(speed / 0.05 m/s)
_NODES: Array = np.linspace(-5.0, 5.0, 21)
COAST, DRIVE = len(_NODES), len(_NODES) + 1
GROUPS = len(_NODES) + 2
UPHILL = -1  # of `kinds`: a constant scenario, driven, not downhill


@dataclass(frozen=True, slots=True, eq=False)
class Kinds:
    """What went alike: of each run or scenario UPHILL, COAST or DRIVE, and how fast it moves in the end (m/s)."""

    kind: npt.NDArray[np.intp]
    speed_m_s: Array

    def without(self, run: int) -> Kinds:
        """All but one."""
        return Kinds(np.delete(self.kind, run), np.delete(self.speed_m_s, run))


def multipliers(scores: Sequence[Array], kinds: Kinds) -> Array:
    """For each group and level, (GROUPS, level), from the scores (time,) of each run. Rise with the level."""
    values = np.concatenate(scores)
    largest = np.array([each.max() for each in scores])
    lengths = [len(each) for each in scores]
    order, most = np.argsort(values, kind="stable"), np.argsort(largest, kind="stable")
    found = np.empty((GROUPS, len(LEVELS)))
    for group in range(GROUPS):
        weights = _weights(kinds, group)
        count = weights.sum() ** 2 / np.square(weights).sum()
        # the new run is one more among them; a high level cannot be had from few and gets the largest
        levels = np.minimum(np.array(LEVELS) * (count + 1.0) / count, 1.0)
        shared = np.repeat(weights / lengths, lengths)
        pointwise = _quantiles(values[order], shared[order], levels)
        whole = _quantiles(largest[most], weights[most], np.maximum(1.0 - _WHOLE_LEEWAY * (1.0 - levels), 0.0))
        found[group] = np.maximum.accumulate(np.maximum(pointwise, whole))
    return found


def at(table: Array, kinds: Kinds, level: float) -> Array:
    """The multiplier of each scenario, (scenario,), from `multipliers`."""
    by_group = _by_group(table, level)
    uphill = np.interp(_position(kinds.speed_m_s), _NODES, by_group[: len(_NODES)])
    return np.asarray(np.where(kinds.kind == UPHILL, uphill, by_group[np.maximum(kinds.kind, 0)]))


def of_drives(table: Array, level: float) -> float:
    """That of every drive."""
    return float(_by_group(table[DRIVE:], level)[0])


def _by_group(table: Array, level: float) -> Array:
    below = min(max(bisect_left(LEVELS, level) - 1, 0), len(LEVELS) - 2)
    share = (level - LEVELS[below]) / (LEVELS[below + 1] - LEVELS[below])
    return np.asarray(table[:, below] + share * (table[:, below + 1] - table[:, below]))


def _position(speed_m_s: Array) -> Array:
    return np.asarray(np.arcsinh(speed_m_s / _SLOW_M_S))


def _weights(kinds: Kinds, group: int) -> Array:
    if group in (COAST, DRIVE):
        return np.where(kinds.kind == group, 1.0, _FAR_WEIGHT)
    near = np.exp(-0.5 * np.square((_position(kinds.speed_m_s) - _NODES[group]) / _LENGTH))
    return np.maximum(np.where(kinds.kind == UPHILL, near, 0.0), _FAR_WEIGHT)


def _quantiles(rising: Array, weights: Array, levels: Array) -> Array:
    """Of values that rise: the least that has the share `levels` of the weight at or below it."""
    shares = np.cumsum(weights) / weights.sum()
    rows = np.searchsorted(shares, levels - 1e-12)
    return np.asarray(rising[np.minimum(rows, len(rising) - 1)])
