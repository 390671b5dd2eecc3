"""The notebook of first steps runs from its first cell to its last."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl
import nbformat
import pytest

from tests.clients.notebooks import cells_of, shown_by
from tests.clients.served import REPOSITORY, served

NOTEBOOK = REPOSITORY / "clients" / "python" / "notebooks" / "first_steps.ipynb"


def test_the_notebook_is_a_valid_one_without_outputs() -> None:
    nbformat.validate(nbformat.read(NOTEBOOK, as_version=4))
    for cell in cells_of(NOTEBOOK):
        assert cell["cell_type"] == "markdown" or (cell["outputs"], cell["execution_count"]) == ([], None)


@pytest.mark.processes
def test_the_notebook_runs_and_shows_what_it_promises(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from matplotlib import pyplot

    mpl.use("agg")
    monkeypatch.chdir(tmp_path)
    with served(tmp_path / "log.txt") as url:
        monkeypatch.setenv("ROVER_TWIN_URL", url)
        shown = shown_by(cells_of(NOTEBOOK))

    figures = [pyplot.figure(number) for number in pyplot.get_fignums()]
    pyplot.close("all")
    assert len(figures) == 3
    assert "climbs" in html(shown["predict"])
    assert "200 scenarios" in html(shown["batch"])
    assert "passes" in html(shown["drive"])
    assert "<svg" in html(shown["map"])
    assert list(shown["pandas"].columns[:3]) == ["time_s", "x_m", "y_m"]
    assert shown["many"] > 0
    assert shown["file"].read_text().startswith("#usda")


def html(answer: Any) -> str:
    text: str = answer._repr_html_()
    return text
