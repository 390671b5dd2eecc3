"""Many laws over many runs, for fits: what each row of parameters and weights makes of each run."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from service.learning.drive.inputs import Controls, Track
from service.learning.drive.law import PARAMETERS, LaidOutLaw, Law
from service.learning.drive.library import MOST_S, CompiledRun, address, contiguous, library
from service.physics.scenario import Array


@dataclass(frozen=True, slots=True, eq=False)
class SweptRun:
    """One run: what acted on it, and what was observed at times that rise.

    Where `force_every` is not 0, the state takes `observed_x_m` and `observed_speed_m_s` at each so many-th time (k,
    2k, ...), after its own are recorded: errors of the law then do not add up. Raises ValueError for other shapes and
    for times that fall, are negative or not finite.
    """

    mass_kg: float
    start_speed_m_s: float
    track: Track
    controls: Controls
    time_s: Array
    observed_x_m: Array
    observed_speed_m_s: Array

    def __post_init__(self) -> None:
        for name in ("time_s", "observed_x_m", "observed_speed_m_s"):
            object.__setattr__(self, name, contiguous(getattr(self, name)))
        times = self.time_s
        if not times.ndim == 1 == self.observed_x_m.ndim or not (
            times.shape == self.observed_x_m.shape == self.observed_speed_m_s.shape
        ):
            raise ValueError("a run needs as many positions and speeds as times")
        if len(times) and not (times[0] >= 0 and times[-1] <= MOST_S and (np.diff(times) >= 0).all()):
            raise ValueError(f"times of a run must rise, from 0 to {MOST_S:g} s at most")


class Sweep:
    """Runs laid out for the engine. `offsets` (run + 1,): where each run's times begin in the answer's last axis."""

    def __init__(self, law: Law, runs: Sequence[SweptRun], force_every: int = 0) -> None:
        """Of `law` the rover, the soil and the bases are used."""
        self._law, self._laid_out = law, LaidOutLaw(law)
        self._runs = list(runs)
        self.offsets = np.concatenate([[0], np.cumsum([len(run.time_s) for run in self._runs])]).astype(np.int64)
        self._compiled = (CompiledRun * len(self._runs))(*(_compiled(run, force_every) for run in self._runs))

    def __call__(self, parameters: Array, weights: Array, threads: int = 2) -> tuple[Array, Array, Array, Array]:
        """x, speed, front and rear wheel speed, each (row, all times), for parameters and weights (row, ...)."""
        numbers = np.concatenate([parameters, self._law.padded_weights(weights)], axis=1)
        rows, width = numbers.shape
        if parameters.shape[1:] != (len(PARAMETERS),) or weights.shape != (rows, self._law.weight_count):
            raise ValueError(f"parameters {parameters.shape} and weights {weights.shape} do not fit the law")
        numbers = contiguous(numbers)
        total = int(self.offsets[-1])
        cuts = np.linspace(0, rows, max(1, min(threads, rows)) + 1).astype(int)
        parts = list(pairwise(cuts))

        def swept(part: tuple[int, int]) -> Array:
            first, end = part
            outputs = np.empty((4, end - first, total))
            library().rover_sweep(
                self._laid_out.address,
                end - first,
                width,
                address(numbers[first:]),
                len(self._runs),
                self._compiled,
                address(self.offsets),
                total,
                address(outputs),
            )
            return outputs

        if len(parts) == 1:
            found = swept(parts[0])
        else:
            with ThreadPoolExecutor(len(parts)) as pool:
                found = np.concatenate(list(pool.map(swept, parts)), axis=1)
        return found[0], found[1], found[2], found[3]


def _compiled(run: SweptRun, force_every: int) -> CompiledRun:
    return CompiledRun(
        mass_kg=run.mass_kg,
        start_speed_m_s=run.start_speed_m_s,
        track=run.track.compiled(),
        controls=run.controls.compiled(),
        times=len(run.time_s),
        time_s=address(run.time_s),
        force_every=force_every,
        observed_x_m=address(run.observed_x_m),
        observed_speed_m_s=address(run.observed_speed_m_s),
    )
