"""Mobility maps and suggested runs by both clients over real sockets, and what cannot be asked at all."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from rover_twin_client import InvalidInputError, NotReadyError, TimedOutError, UnexpectedAnswerError, calls
from tests.clients.conftest import seen

Ask = Callable[..., Any]
QUESTIONS = {"mobility": (430, 30), "suggested_runs": ("viper-lunar", 3)}
DEFAULTS: dict[str, Any] = dict.fromkeys(
    ("torque_steps", "slope_min_deg", "slope_max_deg", "slope_steps", "confidence", "model")
)


def test_a_map_arrives_as_tables_of_torque_by_slope(ask: Ask, contract_service: Any) -> None:
    found = ask(contract_service.url, "mobility", 430, 10, 50, torque_steps=3, slope_max_deg=30, slope_steps=4)

    assert found.torque_nm.tolist() == [10, 30, 50]
    assert found.slope_deg.tolist() == [0, 10, 20, 30]
    assert found.outcome.shape == found.slip_ratio.shape == found.inside_domain.shape == (3, 4)
    assert found.steepest_climb_slope_deg.tolist() == [0, 10, 20]
    assert found.steepest_inside_domain == (False, True, True)
    assert found.horizon_s == 10.0


def test_every_option_of_a_map_reaches_the_service(ask: Ask, contract_service: Any) -> None:
    options = {"slope_min_deg": -5, "slope_max_deg": 5, "slope_steps": 2, "confidence": 0.99}

    found = ask(contract_service.url, "mobility", 430, 60, horizon_s=4, **options)

    assert (found.mass_kg, found.horizon_s, found.confidence) == (430, 4, 0.99)
    assert (found.torque_nm.tolist(), found.slope_deg.tolist()) == ([60], [-5, 5])


def test_suggested_runs_arrive_in_the_order_sent(ask: Ask, contract_service: Any) -> None:
    suggested = ask(contract_service.url, "suggested_runs", "viper-lunar", 3, n=2)

    assert str(suggested.model) == "viper-lunar@3"
    assert [run.slope_deg for run in suggested.runs] == [10, 11]
    assert len(ask(contract_service.url, "suggested_runs", "viper-lunar", 3).runs) == 8


FAILING = [
    ("other-api", {}, UnexpectedAnswerError, 1),
    ("corrupt", {}, NotReadyError, 1),
    ("busy-for-long", {}, NotReadyError, 1),
    ("busy", {"retries": 1}, NotReadyError, 2),
    ("busy", {"retries": 0}, NotReadyError, 1),
    ("slow", {"timeout": 0.2}, TimedOutError, 1),
]


@pytest.mark.slow
@pytest.mark.parametrize("word", QUESTIONS)
@pytest.mark.parametrize(("behaviour", "settings", "kind", "questions"), FAILING)
def test_failures_have_the_errors_and_tries_of_a_prediction(
    ask: Ask,
    contract_service: Any,
    fresh_hits: Counter[str],
    word: str,
    behaviour: str,
    settings: dict[str, Any],
    kind: type[Exception],
    questions: int,
) -> None:
    with pytest.raises(kind) as caught:
        ask(f"{contract_service.url}/{behaviour}", word, *QUESTIONS[word], settings=settings)

    assert type(caught.value) is kind
    assert seen(fresh_hits, behaviour, questions) == questions


@pytest.mark.slow
@pytest.mark.parametrize("word", QUESTIONS)
def test_a_service_that_is_busy_once_is_asked_again(
    ask: Ask, contract_service: Any, fresh_hits: Counter[str], word: str
) -> None:
    answer = ask(f"{contract_service.url}/busy-once", word, *QUESTIONS[word])

    assert str(answer.model) == "viper-lunar@3"
    assert fresh_hits["busy-once"] == 2


def test_a_plain_map_leaves_every_default_but_the_horizon_to_the_service() -> None:
    call = calls.mobility(430, 30, None, 10, **DEFAULTS)

    assert call.path == "/v1/mobility"
    assert call.query == {"mass_kg": "430.0", "torque_min_nm": "30.0", "horizon_s": "10.0"}
    assert call.retried


def test_a_map_is_asked_for_in_the_services_own_words() -> None:
    asked = {"torque_steps": np.int64(4), "slope_min_deg": -5, "slope_max_deg": np.float64(5.5), "slope_steps": 7}

    query = calls.mobility(430, 30, 120, 4, **asked, confidence=0.95, model="viper-lunar@3").query

    assert query == {
        "mass_kg": "430.0",
        "torque_min_nm": "30.0",
        "torque_max_nm": "120.0",
        "torque_steps": "4",
        "slope_min_deg": "-5.0",
        "slope_max_deg": "5.5",
        "slope_steps": "7",
        "horizon_s": "4.0",
        "confidence": "0.95",
        "model": "viper-lunar@3",
    }


def test_suggested_runs_are_asked_of_a_version() -> None:
    call = calls.suggested_runs("viper-lunar", 3, 5)

    assert call.path == "/v1/models/viper-lunar/versions/3/suggested-runs"
    assert call.query == {"n": "5"}
    assert calls.suggested_runs("viper-lunar", 3, None).query == {}


NO_COUNT = {"text": "8", "fraction": 8.0, "truth": True, "list": [8], "too long to write": 10**5000}


@pytest.mark.parametrize("value", NO_COUNT.values(), ids=NO_COUNT.keys())
def test_what_is_no_count_is_refused_by_name_before_it_is_sent(value: Any) -> None:
    with pytest.raises(InvalidInputError, match=r"^slope_steps is .*, allowed is a whole number$") as caught:
        calls.mobility(430, 30, 120, 10, **DEFAULTS | {"slope_steps": value})
    assert [fault.field for fault in caught.value.faults] == ["slope_steps"]
    with pytest.raises(InvalidInputError, match=r"^n is "):
        calls.suggested_runs("viper-lunar", 3, value)


@pytest.mark.parametrize("field", ["slope_min_deg", "slope_max_deg", "confidence"])
def test_what_is_no_number_is_refused_by_name_before_it_is_sent(field: str) -> None:
    with pytest.raises(InvalidInputError, match=f"^{field} is 'steep', allowed is a number"):
        calls.mobility(430, 30, 120, 10, **DEFAULTS | {field: "steep"})


NOWHERE: list[tuple[Any, Any]] = [("../x", 1), ("a/b", 1), ("a", 0), ("a", "1"), ("a", True), ("a", 10**5000)]


@pytest.mark.parametrize(("name", "version"), NOWHERE, ids=range(len(NOWHERE)))
def test_a_version_that_would_lead_to_another_address_is_refused(name: Any, version: Any) -> None:
    with pytest.raises(InvalidInputError, match=r"^(name|version) is "):
        calls.suggested_runs(name, version, None)
