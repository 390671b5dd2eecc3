"""The preview of a dataset: drawn from the runs, the same bytes each time."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from service.datasets import Dataset, Run, parse_passport
from service.training.dataset_figure import MOST_ROWS, MOST_RUNS, Origin, preview, preview_figure
from tests.datasets.conftest import PASSPORT
from tests.pictures.looking import require_page


def dataset(count):
    time = np.linspace(0.0, 10.0, 300)
    runs = [
        Run(f"r{i}", "a", 20.0 + i / 100, 400.0 + i, 60.0 + i / 10, 10.0,
            {"time_s": time, "rear_x_m": (0.1 + i / 1000) * time, "rear_y_m": np.full(300, 0.24)})
        for i in range(count)
    ]  # fmt: skip
    return Dataset("d", parse_passport(json.dumps(PASSPORT).encode()), tuple(runs))


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "magic"), [("svg", b"<?xml"), ("png", b"\x89PNG")])
def test_it_is_an_image_and_the_same_each_time(kind, magic):
    drawn = preview(dataset(3), kind=kind)
    assert drawn.startswith(magic)
    assert drawn == preview(dataset(3), kind=kind)
    assert drawn != preview(dataset(4), kind=kind)


def test_it_shows_the_ends_of_the_runs_and_their_scenarios():
    figure = preview_figure(dataset(3))
    curves, scenarios = figure.axes[0].collections[0], figure.axes[1].collections[0]
    np.testing.assert_allclose([path.vertices[-1] for path in curves.get_paths()], [[10, 1.0], [10, 1.01], [10, 1.02]])
    np.testing.assert_allclose(scenarios.get_offsets(), [[400, 60], [401, 60.1], [402, 60.2]])


@pytest.mark.slow
def test_one_run_and_very_many_are_drawn():
    assert len(preview_figure(dataset(1)).axes[0].collections[0].get_paths()) == 1
    assert len(preview_figure(dataset(MOST_RUNS + 50)).axes[0].collections[0].get_paths()) == MOST_RUNS
    assert len(preview(dataset(MOST_RUNS + 50))) < 1_000_000


def test_a_slope_that_changes_changes_the_colour_and_torque_and_brake_are_marked():
    steady = dataset(1).runs[0]
    later = steady.time_s > 5
    inputs = {"slope_deg": 20.0 + 5.0 * later, "torque_nm": np.where(later, 0.0, 60.0), "brake": later.astype(float)}
    driven = Run("d", "a", 20.0, 500.0, 60.0, 10.0, {**steady.columns, **inputs})
    curves, scenarios = preview_figure(Dataset("d", dataset(1).passport, (steady, driven))).axes[:2]
    pieces = sorted((path.vertices[0][0], path.vertices[-1][0]) for path in curves.collections[0].get_paths())
    bend = pieces[0][1]
    assert bend == pytest.approx(5.0, abs=0.06)
    assert pieces == [(0.0, bend), (0.0, 10.0), (bend, 10.0)]
    assert len({tuple(colour) for colour in curves.collections[0].get_colors()}) == 2
    np.testing.assert_allclose(scenarios.lines[0].get_ydata(), [0.0, 60.0])
    np.testing.assert_allclose(scenarios.collections[1].get_offsets(), [[500.0, 60.0]])
    assert "1 that change" in scenarios.get_title(loc="left")


@pytest.mark.slow
def test_as_a_page_it_lists_its_runs_and_what_strangers_wrote_stays_text():
    hostile = "<script>alert(1)</script>$\\frac{1}{0$"
    data = dataset(3)
    named = Dataset(hostile, data.passport, tuple(replace(run, name=f"{hostile}{run.name}") for run in data.runs))
    page = require_page(preview(named, kind="html", origin=Origin(hostile, "0" * 64, hostile, f"today by {hostile}")))

    assert "".join(page.text).count(hostile) >= 6
    assert sum(tag == "tr" for tag, _ in page.elements) == 1 + 3
    many = require_page(preview(dataset(MOST_ROWS + 5), kind="html"))
    assert sum(tag == "tr" for tag, _ in many.elements) == 1 + MOST_ROWS
    assert f"The first {MOST_ROWS} of {MOST_ROWS + 5} runs" in "".join(many.text)
