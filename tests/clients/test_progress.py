"""How far a long call is: told to a function, to a bar, or on a line of text where no library draws one."""

from __future__ import annotations

import sys
from types import SimpleNamespace

import pytest

from rover_twin_client.progress import reporting


@pytest.fixture
def without(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """An installation without tqdm, as an import finds it."""
    monkeypatch.setitem(sys.modules, "tqdm.auto", None)
    return monkeypatch


def count(total: int, *more: int) -> None:
    with reporting(True, total, "scenarios") as report:
        for each in more:
            report(each)


def test_a_function_hears_how_many_are_done() -> None:
    told: list[tuple[int, int]] = []
    with reporting(lambda done, total: told.append((done, total)), 10, "scenarios") as report:
        report(4)
        report(6)

    assert told == [(4, 10), (10, 10)]


def test_silence_unless_wanted(capfd: pytest.CaptureFixture[str]) -> None:
    with reporting(False, 10, "scenarios") as report:
        report(10)

    assert capfd.readouterr() == ("", "")


def test_tqdm_draws_the_bar_where_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[int] = []

    class Bar:
        def __init__(self, total: int, unit: str) -> None:
            assert (total, unit) == (10, " scenarios")

        def __enter__(self) -> Bar:
            return self

        def __exit__(self, *_: object) -> None:
            drawn.append(-1)

        def update(self, more: int) -> None:
            drawn.append(more)

    monkeypatch.setitem(sys.modules, "tqdm.auto", SimpleNamespace(tqdm=Bar))
    count(10, 4, 6)

    assert drawn == [4, 6, -1]


def test_rich_draws_it_otherwise(without: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> None:
    count(10, 4, 6)

    assert "100%" in capfd.readouterr().out


def test_a_line_of_text_does_without_either(without: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> None:
    without.setitem(sys.modules, "rich.progress", None)
    count(10, 4, 6)

    assert capfd.readouterr().err.endswith("\r10 of 10 scenarios\n")
