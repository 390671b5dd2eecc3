"""Requests of every kind, at random but the same each time, for the soak."""

from __future__ import annotations

import json
import random
from collections.abc import Callable, Mapping
from urllib.parse import urlencode

from tests.benchmarks.client import Question, batch, inference

Expected = tuple[Question, tuple[int, ...]]
"""A question and the statuses it may get."""
_PATH = "/v1/predictions"


class Mixture:
    """An endless mixture; `seed` decides what comes."""

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)
        kinds = {
            self._formatted: 500,
            self._parts: 80,
            self._compressed: 50,
            self._own_times: 60,
            self._inference: 150,
            self._batch: 60,
            self._faulty: 60,
            self._around: 40,
            self._plot: 2,
        }
        self._kinds: list[Callable[[], Expected]] = list(kinds)
        self._weights = list(kinds.values())

    def next(self) -> Expected:
        """A question and the statuses it may get."""
        return self._random.choices(self._kinds, self._weights)[0]()

    def _formatted(self) -> Expected:
        form = self._random.choices(("json", "csv", "npz", "arrow", "usda"), (6, 2, 3, 3, 1))[0]
        return self._get(format=form)

    def _parts(self) -> Expected:
        if self._random.random() < 0.5:
            question, _ = self._get(include="prior,band", band_level=self._random.choice((0.5, 0.8, 0.9, 0.99)))
            return question, (200, 422)  # a network has no band
        return self._get(frame="world", include="prior")

    def _compressed(self) -> Expected:
        question, status = self._get(format=self._random.choice(("json", "csv")))
        coding = self._random.choice(("gzip", "zstd"))
        return Question("GET", question.path, {"Accept-Encoding": coding}), status

    def _own_times(self) -> Expected:
        times = sorted({round(self._random.uniform(0, 59), 4) for _ in range(self._random.randint(1, 2000))})
        return self._post(_PATH, {**self._scenario(), "times_s": [*times, 60.0]})

    def _inference(self) -> Expected:
        asked = [self._scenario() for _ in range(self._some(16))]
        return inference(self._random.choice((0.05, 0.1)), asked, binary=self._random.random() < 0.5), (200,)

    def _batch(self) -> Expected:
        asked = [self._scenario() for _ in range(self._some(16))]
        return batch(self._random.choice(("json", "ndjson", "arrow", "npz")), 0.1, asked), (200,)

    def _faulty(self) -> Expected:
        wrong = ({"slope_deg": 91}, {"mass_kg": "heavy"}, {"dt_s": 0}, {"nonsense": 1}, {"frame": "moon"})
        known = {"model": "viper-lunar@999"}
        if self._random.random() < 0.2:
            return self._get(**known)[0], (404,)
        return self._get(**self._random.choice(wrong))[0], (422,)

    def _around(self) -> Expected:
        paths = (
            "/health/live",
            "/health/ready",
            "/metrics",
            "/v1/models",
            "/v2/models/viper-lunar",
            "/v1/models/viper-lunar",
        )
        return Question("GET", self._random.choice(paths)), (200,)

    def _plot(self) -> Expected:
        return self._get(format=self._random.choice(("svg", "png")))

    def _get(self, **more: object) -> Expected:
        query = {**self._scenario(), **self._sampling(), **more}
        return Question("GET", f"{_PATH}?{urlencode(query)}"), (200,)

    def _post(self, path: str, body: Mapping[str, object]) -> Expected:
        return Question("POST", path, {"Content-Type": "application/json"}, json.dumps(body).encode()), (200,)

    def _scenario(self) -> dict[str, float]:
        spread = self._random.uniform
        return {"slope_deg": spread(-5, 32), "mass_kg": spread(300, 900), "torque_nm": spread(30, 150)}

    def _sampling(self) -> dict[str, float]:
        return {"horizon_s": self._random.uniform(1, 60), "dt_s": self._random.choice((0.5, 0.1, 0.05, 0.05, 0.01))}

    def _some(self, most: int) -> int:
        """Few more often than many."""
        return round(most ** self._random.random())
