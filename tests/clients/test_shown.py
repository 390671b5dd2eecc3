"""How answers show themselves: tables of three libraries, figures, one line, and a page for notebooks."""

from __future__ import annotations

import re
import sys
from dataclasses import replace
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.figure import Figure

from rover_twin_client import InvalidInputError, MobilityMap, Prediction, parsing
from rover_twin_client.document import Node
from rover_twin_client.shown.facts import unit_of


@pytest.fixture
def prediction(slope_answer: dict[str, Any]) -> Prediction:
    return parsing.prediction(Node(slope_answer))


@pytest.fixture
def found(map_answer: dict[str, Any]) -> MobilityMap:
    return parsing.mobility(Node(map_answer))


def test_tables_hold_the_numbers_of_the_answer(slope_answer: dict[str, Any], prediction: Prediction) -> None:
    wanted = {
        **slope_answer["trajectory"],
        **{f"prior_{name}": slope_answer["prior"][name] for name in ("x_m", "y_m")},
        **{name: slope_answer["band"][name] for name in ("x_lower_m", "x_upper_m", "y_lower_m", "y_upper_m")},
    }

    assert prediction.to_pandas().to_dict("list") == wanted
    assert prediction.to_polars().to_dict(as_series=False) == wanted
    assert {name: each.values.tolist() for name, each in prediction.to_xarray().variables.items()} == wanted


def test_a_dataset_has_units_coordinates_and_what_was_asked(prediction: Prediction, found: MobilityMap) -> None:
    dataset, grid = prediction.to_xarray(), found.to_xarray()

    assert dataset["x_m"].dims == ("time_s",)
    assert dataset["x_m"].attrs["units"] == "m"
    assert dataset["time_s"].attrs["units"] == "s"
    assert dataset.attrs["model"] == "viper-lunar@3"
    assert dataset.attrs["mass_kg"] == prediction.to_pandas().attrs["mass_kg"] == 430
    assert grid["outcome"].dims == ("torque_nm", "slope_deg")
    assert grid["mean_speed_m_s"].sel(torque_nm=40, slope_deg=20).item() == found.mean_speed_m_s[1, 1]


def test_a_map_as_a_table_has_a_row_for_each_cell(found: MobilityMap) -> None:
    table = found.to_pandas()

    assert len(table) == found.outcome.size
    for row in table.to_dict("records"):
        at = found.torque_nm.tolist().index(row["torque_nm"]), found.slope_deg.tolist().index(row["slope_deg"])
        assert row["outcome"] == found.outcome[at]


@pytest.mark.parametrize(
    ("name", "unit"),
    [("x_m", "m"), ("speed_m_s", "m/s"), ("rear_wheel_speed_rad_s", "rad/s"), ("torque_nm", "N m"), ("outcome", None)],
)
def test_units_are_those_of_names(name: str, unit: str | None) -> None:
    assert unit_of(name) == unit


@pytest.mark.parametrize("library", ["pandas", "polars", "xarray", "matplotlib"])
def test_a_library_that_is_missing_is_named_with_the_command(
    prediction: Prediction, library: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in [each for each in sys.modules if each.partition(".")[0] == library]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, library, None)  # as an import finds it that is not installed
    ask = prediction.plot if library == "matplotlib" else getattr(prediction, f"to_{library}")

    with pytest.raises(ImportError, match=rf"needs {library}, which is not installed: pip install {library}"):
        ask()


def test_a_figure_has_curve_band_and_prior_and_says_the_outcome(prediction: Prediction) -> None:
    axes = prediction.plot(ax=Figure().subplots())

    curve, prior = axes.get_lines()
    np.testing.assert_array_equal(curve.get_xydata(), np.column_stack([prediction.time_s, prediction.x_m]))
    assert prediction.prior is not None
    np.testing.assert_array_equal(prior.get_ydata(), prediction.prior.x_m)
    assert len(axes.collections) == 1
    assert axes.get_title().startswith("climbs - slope 28 deg")
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("time (s)", "x (m)")


def test_a_column_that_is_not_there_is_named_with_those_that_are(prediction: Prediction) -> None:
    with pytest.raises(InvalidInputError, match="column is 'speed_m_s', allowed is one of x_m, y_m"):
        prediction.plot("speed_m_s", ax=Figure().subplots())


def test_a_map_is_drawn_with_its_steepest_slopes(found: MobilityMap) -> None:
    axes = found.plot(ax=Figure().subplots())

    assert (axes.get_xlabel(), axes.get_ylabel()) == ("slope (degree)", "torque (N m)")
    assert len(axes.get_lines()) == 1
    axes.figure.canvas.draw()  # type: ignore[attr-defined]  # of every figure


def test_one_line_says_what_matters(prediction: Prediction, found: MobilityMap) -> None:
    for answer in (prediction, found):
        assert "\n" not in repr(answer)
        assert len(repr(answer)) < 300
    assert "climbs" in repr(prediction)


def test_the_page_is_whole_says_the_same_and_asks_nobody(prediction: Prediction, found: MobilityMap) -> None:
    for answer in (prediction, found):
        page = answer._repr_html_()
        ElementTree.fromstring(page)  # every tag is closed
        assert "<svg" in page
        assert not re.search(r"https?:|src=|href=|url\(|<script|@import", page)
        assert "viper-lunar@3" in page
        assert len(page) < 20_000


def test_words_of_the_service_cannot_become_markup(prediction: Prediction) -> None:
    evil = replace(prediction, model=replace(prediction.model, name="<script>alert('1')</script>\"&"))

    assert "<script" not in evil._repr_html_()


def test_a_page_of_a_very_long_answer_stays_small(prediction: Prediction) -> None:
    times = np.linspace(0, 600, 100_000)
    long = replace(prediction, time_s=times, x_m=np.sin(times), y_m=times, prior=None, band=None)

    assert len(long._repr_html_()) < 20_000
