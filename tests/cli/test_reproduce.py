"""`reproduce`: one command to a table, a page and figures."""

from __future__ import annotations

import re

import pytest

from service.cli.failures import ExitCode
from tests.cli.conftest import call
from tests.training.test_reproduce import SETS, paper_store

pytestmark = pytest.mark.slow

EARLIER = "# The paper's experiment, repeated\n\nlong ago\n"
FIGURES = ("figure_2_positions", "figure_3_distance", "error_against_time", "figure_4_double_mass")


@pytest.fixture(scope="module")
def reproduced(tmp_path_factory):
    """Written over an earlier page."""
    root = tmp_path_factory.mktemp("reproduce")
    paper_store(root / "store")
    (root / "new" / "page").mkdir(parents=True)
    (root / "new" / "page" / "README.md").write_text(EARLIER, encoding="utf-8")
    answer = call(
        *("reproduce", "--quick", "--threads", "1"), *("--output", root / "new" / "page", "--store", root / "store")
    )
    assert answer.code == 0, answer.err
    return answer, root / "new" / "page"


def test_page_and_figures_are_written_and_nothing_else(reproduced):
    _, folder = reproduced
    expected = {"README.md"} | {f"{name}.{kind}" for name in FIGURES for kind in ("svg", "png")}
    assert {path.name for path in folder.iterdir()} == expected


def test_the_page_shows_every_figure_and_says_how_it_was_made(reproduced):
    _, folder = reproduced
    page = (folder / "README.md").read_text(encoding="utf-8")
    assert set(re.findall(r"\]\((\w+)\.svg\)", page)) == set(FIGURES)
    assert "rover-twin reproduce --quick" in page
    assert "say nothing about accuracy" in page
    assert str(folder) not in page
    assert "{" not in page


def test_the_table_on_stdout_is_that_of_the_page(reproduced):
    answer, folder = reproduced
    page = (folder / "README.md").read_text(encoding="utf-8")
    rows = [line.strip("| ").split(" | ") for line in page.splitlines() if line.startswith("| ")]
    assert len(rows) == 2 + 6 + 2
    for row in rows[2:]:
        line = next(line for line in answer.out.splitlines() if line.startswith(row[0]) and f" {row[1]} " in line)
        assert all(cell.strip() in line for cell in row)


def test_progress_goes_to_stderr(reproduced):
    answer, _ = reproduced
    assert "1 of 6: printed prior alone" in answer.err
    assert "epoch 3/3" in answer.err
    assert "epoch" not in answer.out


def test_a_store_without_the_runs_is_named_and_nothing_is_written(tmp_path):
    paper_store(tmp_path / "store", {"paper": SETS["paper"]})
    answer = call("reproduce", "--quick", "--output", tmp_path / "page", "--store", tmp_path / "store")
    assert answer.code == ExitCode.NOT_FOUND
    assert "mass" in answer.error
    assert not (tmp_path / "page").exists()


@pytest.mark.parametrize("words", [("--seeds", "0"), ("--seeds", "many"), ("--threads", "0")])
def test_impossible_options_are_usage_errors(tmp_path, words):
    answer = call("reproduce", *words, "--output", tmp_path / "page")
    assert answer.code == ExitCode.USAGE
    assert not (tmp_path / "page").exists()


def test_somebody_elses_page_is_not_overwritten(tmp_path):
    page = tmp_path / "README.md"
    page.write_text("# My rover\n")
    answer = call("reproduce", "--quick", "--output", tmp_path)
    assert answer.code == ExitCode.USAGE
    assert "another directory" in answer.error
    assert page.read_text() == "# My rover\n"


def test_an_earlier_page_is_replaced(reproduced):
    _, folder = reproduced
    page = (folder / "README.md").read_text(encoding="utf-8")
    assert page.startswith(EARLIER.splitlines()[0] + "\n")  # by which it is known as a page of this command
    assert "long ago" not in page
