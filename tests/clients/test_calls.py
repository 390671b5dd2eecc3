"""The questions, without a network: what is asked for, and what cannot be asked at all."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_twin_client import InvalidInputError, calls

DEFAULTS: dict[str, Any] = {"dt_s": None, "model": None, "frame": "slope", "include": (), "strict": False}


def test_a_plain_prediction_leaves_every_default_but_the_frame_to_the_service() -> None:
    call = calls.predict(28, 430, 60, 10, **DEFAULTS)

    assert call.path == "/v1/predictions"
    assert call.query == {
        "slope_deg": "28.0",
        "mass_kg": "430.0",
        "torque_nm": "60.0",
        "horizon_s": "10.0",
        "frame": "slope",
    }


def test_every_option_is_asked_for_in_the_services_own_words() -> None:
    asked = {"dt_s": 0.5, "model": "viper-lunar@3", "frame": "world", "include": ["prior", "band"], "strict": True}
    asked["band_level"] = 0.95

    query = calls.predict(1, 2, 3, 4, **asked).query

    assert query["dt_s"] == "0.5"
    assert query["model"] == "viper-lunar@3"
    assert query["frame"] == "world"
    assert query["include"] == "prior,band"
    assert query["band_level"] == "0.95"
    assert query["strict"] == "true"


def test_one_inclusion_may_be_a_bare_string() -> None:
    assert calls.predict(1, 2, 3, 4, **DEFAULTS | {"include": "prior"}).query["include"] == "prior"


@given(st.floats(allow_nan=False))
def test_numbers_keep_every_digit_even_as_numpy_scalars(value: float) -> None:
    query = calls.predict(np.float64(value), 430, 60, 10, **DEFAULTS).query

    assert float(query["slope_deg"]) == value


@pytest.mark.parametrize("value", ["heavy", None, [430], 10**400], ids=["text", "none", "list", "huge"])
def test_what_is_no_number_is_refused_by_name_before_it_is_sent(value: Any) -> None:
    with pytest.raises(InvalidInputError, match="mass_kg is ") as caught:
        calls.predict(28, value, 60, 10, **DEFAULTS)

    assert caught.value.problem is None
    assert [fault.field for fault in caught.value.faults] == ["mass_kg"]


@pytest.mark.parametrize("name", ["", "..", ".", "a/b", "../admin", "A", "-a", "a" * 64, "a?x=1", "é", 3])
def test_a_name_that_would_lead_to_another_address_is_refused(name: Any) -> None:
    with pytest.raises(InvalidInputError, match="name is "):
        calls.model(name)
    with pytest.raises(InvalidInputError, match="name is "):
        calls.manifest(name, 1)


@pytest.mark.parametrize("version", [0, -1, "1", 1.0, True])
def test_a_version_is_a_positive_integer(version: Any) -> None:
    with pytest.raises(InvalidInputError, match="version is "):
        calls.manifest("viper-lunar", version)


def test_readiness_is_asked_once() -> None:
    assert not calls.ready().retried
    assert calls.models().retried
