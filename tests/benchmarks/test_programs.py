"""The benchmarks' own tools: a number that a broken client measured would be believed."""

from __future__ import annotations

import pytest

from tests.benchmarks import load
from tests.benchmarks.client import Answer, Question, scenarios
from tests.benchmarks.floors import keep_answer
from tests.benchmarks.processes import server
from tests.benchmarks.report import Bar, bars_table, write_part


@pytest.fixture(scope="module")
def floors(processes):
    with server("floors") as running:
        yield running


@pytest.mark.processes
def test_the_floor_sends_the_very_answer(floors):
    body = bytes(range(256)) * 20_000
    with floors.connect() as connection:
        path = keep_answer(connection, "law", Answer(200, {"Content-Type": "a/b", "Vary": "Accept"}, body))
        for method, sent in (("GET", b""), ("POST", b"x" * 70_000)):
            answer = connection.ask(Question(method, path, {}, sent))
            assert answer.body == body
            assert answer.headers["content-type"] == "a/b"
            assert answer.headers["vary"] == "Accept"


def test_a_refusal_is_no_measurement(floors):
    with floors.connect() as connection:
        assert connection.ask(Question("GET", "/nothing"), 404).status == 404
        with pytest.raises(RuntimeError, match="/nothing"):
            connection.ask(Question("GET", "/nothing"))


@pytest.mark.processes
@pytest.mark.parametrize("wrk", [True, False], ids=["wrk", "python"])
def test_load_counts_what_was_answered_and_refuses_failures(floors, monkeypatch, wrk):
    found = load.shutil.which("wrk") if wrk else None
    if wrk and not found:
        pytest.skip("wrk is not installed")
    monkeypatch.setattr(load.shutil, "which", lambda _: found)
    measured = load.apply(floors, ["/tiny", "/ready"], 4, 1)
    assert measured.per_s > 0
    assert 0 < measured.p50 <= measured.p90 <= measured.p99 < 1000
    with pytest.raises(RuntimeError, match="failed"):
        load.apply(floors, ["/tiny", "/nothing"], 2, 1)


def test_no_scenario_comes_twice():
    assert len({each["slope_deg"] for _ in range(3) for each in scenarios(1000)}) == 3000


def test_a_part_replaces_itself_and_nothing_else(tmp_path):
    page = tmp_path / "page.md"
    for name, text in (("one", "first"), ("two", "second"), ("one", r"third \1")):
        write_part(name, text, page)
    kept = page.read_text(encoding="utf-8")
    assert "first" not in kept
    assert kept.index(r"third \1") < kept.index("second")


@pytest.mark.parametrize(("value", "at_least", "held"), [(2.0, False, True), (4.0, False, False), (4.0, True, True)])
def test_a_bar_knows_its_side(value, at_least, held):
    bar = Bar("it", value, 3.0, at_least)
    assert bar.held is held
    assert ("**no**" in bars_table([bar])) is not held
