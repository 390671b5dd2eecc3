"""The report says what was measured."""

from __future__ import annotations

from service.training.doubt_report import doubt_report
from tests.learning.doubt.test_doubt import DOUBT


def test_the_report_has_every_regime_and_the_scores():
    files = doubt_report(DOUBT.measured)
    page = files["report/doubt.md"].decode()

    for name, each in DOUBT.measured["regimes"].items():
        assert f"| {name} | {each['runs']} | {100 * each['pointwise']:.1f} % | {100 * each['whole']:.1f} % |" in page
    assert f"{DOUBT.measured['outcomes']['log_score']:.3f}" in page
    assert {name for name in files if name.endswith(".svg")} == {
        f"report/{name}" for name in ("doubt_regimes.svg", "doubt_reliability.svg")
    }
    assert all(f"({name.removeprefix('report/')})" in page for name in files if name.endswith(".svg"))


def test_the_same_measurements_give_the_same_bytes():
    assert doubt_report(DOUBT.measured) == doubt_report(DOUBT.measured)
