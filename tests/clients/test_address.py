"""Addresses of the service as people copy them: those that work, and what is said to the others."""

from __future__ import annotations

import re
from typing import Any

import pytest

from rover_twin_client.address import checked_url

GOOD = ["http://host:8000", "http://host:8000/", "http://host:8000/v1", "http://host:8000/v1/"]
PREFIXED = ["https://moon.example/twin", "https://moon.example/twin/", "https://moon.example/twin/v1/"]


@pytest.mark.parametrize("address", GOOD)
def test_the_version_at_the_end_does_not_matter(address: str) -> None:
    assert str(checked_url(address)).rstrip("/") == "http://host:8000"


@pytest.mark.parametrize("address", PREFIXED)
def test_the_prefix_of_a_proxy_stays(address: str) -> None:
    assert str(checked_url(address)) == "https://moon.example/twin"


def test_a_prefix_may_hold_a_version_of_its_own() -> None:
    assert checked_url("https://moon.example/v1/twin/v1").path == "/v1/twin"
    assert checked_url("https://moon.example/v2/twin").path == "/v2/twin"


WRONG = {
    "127.0.0.1:8000": "lacks its scheme: did you mean 'http://127.0.0.1:8000'",
    "http:/host": "lacks a part of its scheme: did you mean 'http://host'?",
    "https//host:8000": "did you mean 'https://host:8000'?",
    "http:": "allowed is http://host:port",
    "localhost:8000/v1": "did you mean 'http://localhost:8000/v1'",
    "http://host:8000/v2": "Open Inference Protocol; allowed is the address of the service: 'http://host:8000'",
    "http://host/twin/v2/models/viper-lunar": "the address of the service: 'http://host/twin'",
    "http://host:8000/docs": "the page /docs; allowed is the address of the service: 'http://host:8000'",
    "http://host:8000/openapi.json": "the page /openapi.json",
    "http://host:8000/health/ready": "the address of the service: 'http://host:8000'",
    "http://host:8000/v1/predictions": "that of one call; allowed is the address of the service: 'http://host:8000'",
}


@pytest.mark.parametrize(("address", "said"), WRONG.items(), ids=list(WRONG))
def test_a_wrong_address_hears_which_one_was_meant(address: str, said: str) -> None:
    with pytest.raises(ValueError, match=re.escape(said)) as caught:
        checked_url(address)

    assert str(caught.value).startswith(f"base_url is {address!r}, ")


def test_each_form_of_the_address_reaches_the_service(ask: Any, contract_service: Any) -> None:
    for ending in ("/", "/v1", "/v1/"):
        assert ask(contract_service.url + ending, "predict", 28, 430, 60).summary.outcome == "climbs"


def test_https_where_http_is_spoken_hears_so(contract_service: Any, ask: Any) -> None:
    from rover_twin_client import ConnectionFailedError

    address = contract_service.url.replace("http:", "https:")
    with pytest.raises(ConnectionFailedError, match=f"try {contract_service.url}"):
        ask(address, "predict", 28, 430, 60, settings={"retries": 0})
