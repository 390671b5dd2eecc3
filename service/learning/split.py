"""Which runs a model may see, and which samples decide when to stop.

Test runs are never seen: neither by the prior's calibration, nor by the scaling, nor by the fit. Of each training run
every fourth sample is kept for validation, as in the paper. Those neighbours are 0.5 ms apart, so that validation
says when to stop, not how good the model is; only test runs say that.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from service.errors import TrainingError
from service.learning.observed import ObservedRun

_VALIDATION_EVERY = 4  # the paper, section 4: "one data point every 4 ... saved for the validation set"
SLOPE_TOLERANCE_DEG = 1e-6  # slopes that are closer are the same


@dataclass(frozen=True, slots=True)
class Split:
    """Runs to train on and runs to test on."""

    train: tuple[ObservedRun, ...]
    test: tuple[ObservedRun, ...]


def is_among(slope_deg: float, slopes_deg: Iterable[float]) -> bool:
    """Whether a slope is one of others, but for rounding."""
    return any(abs(slope_deg - each) <= SLOPE_TOLERANCE_DEG for each in slopes_deg)


def split_runs(
    runs: Sequence[ObservedRun], *, test_slopes_deg: Sequence[float] = (), test_fraction: float = 0.0, seed: int = 1
) -> Split:
    """Leave out every run at the given slopes, and then a random fraction of the others. A run whose slope changes is
    at no slope.

    Raises TrainingError when a slope matches no run or nothing would be left to train on.
    """
    slopes = [math.nan if run.controls.slope_angle_rad is not None else run.slope_deg for run in runs]
    for slope in test_slopes_deg:
        if not is_among(slope, slopes):
            raise TrainingError(f"no run has slope_deg {slope:g}, so it cannot be kept for testing")
    kept_apart = [is_among(slope, test_slopes_deg) for slope in slopes]
    others = [index for index, out in enumerate(kept_apart) if not out]
    drawn = np.random.default_rng(seed).permutation(others)[: round(test_fraction * len(others))]
    test = {index for index, out in enumerate(kept_apart) if out} | {int(index) for index in drawn}
    if len(test) >= len(runs):
        raise TrainingError(f"all {len(runs)} runs are kept for testing: nothing remains to train on")
    return Split(
        tuple(run for index, run in enumerate(runs) if index not in test),
        tuple(run for index, run in enumerate(runs) if index in test),
    )


def training_samples(run: ObservedRun) -> ObservedRun:
    """The first three of every four samples."""
    return run.samples(np.flatnonzero(np.arange(len(run.time_s)) % _VALIDATION_EVERY != _VALIDATION_EVERY - 1))


def validation_samples(run: ObservedRun) -> ObservedRun:
    """The fourth of every four samples."""
    return run.samples(slice(_VALIDATION_EVERY - 1, None, _VALIDATION_EVERY))
