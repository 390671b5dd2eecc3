"""Outcomes of rovers that get less far the more resists them: their borders, and which outcome is the most probable."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from hypothesis import given, settings
from hypothesis import strategies as st

from service.learning.doubt.outcomes import Ends, OutcomeLaw, find_borders
from service.physics.scenario import Array


class Counted:
    """Late speeds and ends that fall with the offset, some of them in steps; counts what was driven."""

    def __init__(self, rng: np.random.Generator, count: int) -> None:
        self.drives = 0
        self._speed, self._end = rng.normal(0.0, 0.05, count), rng.normal(0.0, 0.5, count)
        self._slopes = rng.uniform(0.0, 4.0, (2, count))
        self._step_at, self._step = rng.normal(0.0, 0.02, count), rng.choice([0.0, 0.1], count)

    def __call__(self, offsets: Array, rows: npt.NDArray[np.intp]) -> tuple[Array, Array]:
        self.drives += len(rows)
        step = np.where(offsets > self._step_at[rows], self._step[rows], 0.0)
        speed, end = self._slopes[:, rows] * offsets
        return self._speed[rows] - speed - step, self._end[rows] - 10.0 * end - 5.0 * step


def borders_one_by_one(ends: Ends, middle: tuple[Array, Array], reach: Array) -> list[Array]:
    """The borders of each alone."""
    found = []
    for row in range(len(reach)):

        def alone(offsets: Array, rows: npt.NDArray[np.intp], row: int = row) -> tuple[Array, Array]:
            return ends(offsets, np.full(len(rows), row))

        borders = find_borders(alone, middle[0][[row]], middle[1][[row]], reach[[row]])
        found.append(np.array([borders.stalls_from, borders.below_from, borders.slides_from])[:, 0])
    return found


@given(st.integers(0, 2**32 - 1), st.integers(1, 20), st.floats(0.3, 8.0), st.integers(3, 400))
@settings(max_examples=60)
def test_the_most_probable_outcome_is_that_of_all_probabilities(seed, count, spread, runs):
    rng = np.random.default_rng(seed)
    ends, law = Counted(rng, count), OutcomeLaw(spread, runs)
    scale = rng.uniform(0.001, 0.02, count)
    middle, reach = ends(np.zeros(count), np.arange(count)), law.reach(scale)

    ends.drives = 0
    found = law.likeliest(ends, *middle, reach, scale)
    fewer, ends.drives = ends.drives, 0
    chances = law.probabilities(find_borders(ends, *middle, reach), scale)

    assert (found == chances.argmax(axis=1)).all()
    assert fewer <= ends.drives


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=20)
def test_the_borders_of_many_are_those_of_each(seed):
    rng = np.random.default_rng(seed)
    ends, reach = Counted(rng, 12), rng.uniform(0.01, 0.1, 12)
    middle = ends(np.zeros(12), np.arange(12))

    borders = find_borders(ends, *middle, reach)
    found = np.stack([borders.stalls_from, borders.below_from, borders.slides_from], axis=1)

    assert np.array_equal(found, np.stack(borders_one_by_one(ends, middle, reach)))


def test_what_is_decided_is_driven_no_more():
    rng = np.random.default_rng(5)
    ends, law = Counted(rng, 200), OutcomeLaw(1.5, 160)
    scale = np.full(200, 0.01)
    middle, reach = ends(np.zeros(200), np.arange(200)), law.reach(scale)

    ends.drives = 0
    law.likeliest(ends, *middle, reach, scale)
    fewer, ends.drives = ends.drives, 0
    find_borders(ends, *middle, reach)

    assert fewer < 0.7 * ends.drives
