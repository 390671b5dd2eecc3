"""Both clients over real sockets: the same questions, the same answers, the same named failures."""

from __future__ import annotations

import asyncio
import inspect
import socket
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from rover_twin_client import (
    AsyncRoverTwin,
    ConnectionFailedError,
    InvalidInputError,
    NotFoundError,
    NotReadyError,
    OutsideDomainError,
    RefusedError,
    RoverTwin,
    ServerError,
    TimedOutError,
    UnexpectedAnswerError,
    network,
    training_calls,
)
from rover_twin_client.batch.calls import BATCH_READ_S
from tests.clients.conftest import seen

Ask = Callable[..., Any]


def test_a_prediction_arrives_as_arrays(ask: Ask, contract_service: Any) -> None:
    prediction = ask(contract_service.url, "predict", 28, 430, 60)

    assert prediction.scenario.horizon_s == 10.0
    assert prediction.time_s[-1] == 10.0
    np.testing.assert_allclose(prediction.x_m, 0.1 * prediction.time_s)
    assert prediction.prior is None


def test_options_reach_the_service(ask: Ask, contract_service: Any) -> None:
    prediction = ask(contract_service.url, "predict", 28, 430, 60, 20, frame="world", include=["prior"])

    assert prediction.frame == "world"
    assert prediction.time_s[-1] == 20.0
    assert prediction.z_m is not None
    assert prediction.prior.name == "motor_slope"


@pytest.mark.slow
def test_models_versions_and_readiness(ask: Ask, contract_service: Any) -> None:
    url = contract_service.url

    assert [model.name for model in ask(url, "models")] == ["viper-lunar"]
    assert ask(url, "model", "viper-lunar").description == "VIPER on lunar regolith"
    assert ask(url, "manifest", "viper-lunar", 3)["format"] == "rover-twin-manifest"
    assert ask(url, "ready").model.version == 3


def test_a_refused_value_names_its_field_value_and_range(ask: Ask, contract_service: Any) -> None:
    with pytest.raises(InvalidInputError, match="mass_kg") as caught:
        ask(contract_service.url, "predict", 28, -1, 60)

    (fault,) = caught.value.faults
    assert (fault.field, fault.value, fault.allowed) == ("mass_kg", -1.0, "1 to 10000")


def test_not_a_number_is_the_services_to_refuse(ask: Ask, contract_service: Any) -> None:
    with pytest.raises(InvalidInputError, match="mass_kg is nan"):
        ask(contract_service.url, "predict", 28, float("nan"), 60)


def test_strictness_turns_a_verdict_into_an_error(ask: Ask, contract_service: Any) -> None:
    ask(contract_service.url, "predict", 44, 430, 60)
    with pytest.raises(OutsideDomainError):
        ask(contract_service.url, "predict", 44, 430, 60, strict=True)


@pytest.mark.slow
def test_what_is_not_there_is_a_lookup_error(ask: Ask, contract_service: Any) -> None:
    url = contract_service.url
    with pytest.raises(NotFoundError) as caught:
        ask(url, "predict", 28, 430, 60, model="who@champion")
    assert caught.value.problem is not None
    assert caught.value.problem.slug == "model-not-found"
    with pytest.raises(NotFoundError):
        ask(url, "manifest", "viper-lunar", 9)
    with pytest.raises(LookupError):
        ask(url, "model", "who")


FAILING = [
    ("broken", ServerError, 1),
    ("proxy-page", ServerError, 1),
    ("throttled", RefusedError, 1),
    ("redirect", UnexpectedAnswerError, 1),
    ("website", UnexpectedAnswerError, 1),
    ("other-api", UnexpectedAnswerError, 1),
    ("bad-gzip", UnexpectedAnswerError, 1),
    ("corrupt", NotReadyError, 1),
    ("busy-for-long", NotReadyError, 1),
    ("busy", NotReadyError, 3),
]


@pytest.mark.slow
@pytest.mark.parametrize(("behaviour", "kind", "questions"), FAILING, ids=[name for name, *_ in FAILING])
def test_each_misbehaviour_has_its_error_and_its_number_of_tries(
    ask: Ask, contract_service: Any, fresh_hits: Counter[str], behaviour: str, kind: type, questions: int
) -> None:
    with pytest.raises(kind) as caught:
        ask(f"{contract_service.url}/{behaviour}", "predict", 28, 430, 60, settings={"retries": 2})

    assert type(caught.value) is kind
    assert seen(fresh_hits, behaviour, questions) == questions


@pytest.mark.slow
def test_a_service_that_is_busy_once_is_asked_again(ask: Ask, contract_service: Any, fresh_hits: Counter[str]) -> None:
    prediction = ask(f"{contract_service.url}/busy-once", "predict", 28, 430, 60)

    assert prediction.summary.outcome == "climbs"
    assert fresh_hits["busy-once"] == 2


def test_no_retries_means_one_question(ask: Ask, contract_service: Any, fresh_hits: Counter[str]) -> None:
    with pytest.raises(NotReadyError):
        ask(f"{contract_service.url}/busy", "predict", 28, 430, 60, settings={"retries": 0})

    assert fresh_hits["busy"] == 1


def test_readiness_hears_the_no_at_once(ask: Ask, contract_service: Any, fresh_hits: Counter[str]) -> None:
    with pytest.raises(NotReadyError) as caught:
        ask(f"{contract_service.url}/busy", "ready")

    assert caught.value.retry_after_s == 0.0
    assert fresh_hits["busy"] == 1


@pytest.mark.slow
def test_a_slow_answer_times_out_as_told_and_is_not_repeated(
    ask: Ask, contract_service: Any, fresh_hits: Counter[str]
) -> None:
    with pytest.raises(TimedOutError, match="in time"):
        ask(f"{contract_service.url}/slow", "predict", 28, 430, 60, settings={"timeout": 0.2})

    assert seen(fresh_hits, "slow", 1) == 1


@pytest.mark.timeout(60)  # the system waits for minutes where nobody says no
@pytest.mark.slow
def test_nobody_there_is_a_connection_error_soon(ask: Ask) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]

    with pytest.raises(ConnectionFailedError, match=rf"127\.0\.0\.1:{port}.*is the service running"):
        ask(f"http://127.0.0.1:{port}", "models")


@pytest.mark.slow
def test_a_connection_that_breaks_once_is_made_again(ask: Ask) -> None:
    with socket.create_server(("127.0.0.1", 0)) as door, ThreadPoolExecutor() as pool:
        answering = pool.submit(_hang_up_once_then_answer, door, b'{"models": []}')
        models = ask(f"http://127.0.0.1:{door.getsockname()[1]}", "models")
        answering.result(timeout=30)

    assert models == []


def _hang_up_once_then_answer(door: socket.socket, body: bytes) -> None:
    door.accept()[0].close()
    visitor, _ = door.accept()
    with visitor:
        visitor.recv(65536)
        visitor.sendall(b"HTTP/1.1 200 OK\r\nContent-Length: %d\r\n\r\n%s" % (len(body), body))


@pytest.mark.parametrize(
    "base_url", ["", "127.0.0.1:8000", "ftp://host", "http://", "http://h/?a=1", None, "http://host:port"]
)
@pytest.mark.parametrize("kind", [RoverTwin, AsyncRoverTwin])
def test_an_address_that_is_none_is_refused_when_made(kind: type, base_url: Any) -> None:
    with pytest.raises(ValueError, match="base_url is "):
        kind(base_url)


@pytest.mark.parametrize("timeout", [-1, 0, "x", float("nan"), float("inf"), True, httpx.Timeout(5, read=-1), 1e6])
@pytest.mark.parametrize("kind", [RoverTwin, AsyncRoverTwin])
def test_a_timeout_that_is_none_is_refused_when_made(kind: type, timeout: Any) -> None:
    with pytest.raises(ValueError, match=r"^timeout(\.read)? is .*, allowed is more than 0 and at most 86400 seconds"):
        kind(timeout=timeout)


@pytest.mark.timeout(60)
def test_a_timeout_that_is_given_holds_for_batches_and_drives_too(ask: Ask) -> None:
    track = {"distance_m": [0], "slope_deg": [10]}
    questions: list[tuple[str, tuple[Any, ...], dict[str, Any]]] = [
        ("predict_batch", (), {"slope_deg": 1, "mass_kg": 430, "torque_nm": 60}),
        ("drive", (430, track, 60), {}),
    ]
    with socket.create_server(("127.0.0.1", 0)) as silent:
        url = f"http://127.0.0.1:{silent.getsockname()[1]}"
        for word, args, more in questions:
            began = time.monotonic()
            with pytest.raises(TimedOutError):
                ask(url, word, *args, settings={"timeout": 0.3}, **more)
            assert time.monotonic() - began < 10


def test_an_upload_keeps_its_patience_and_a_default_timeout_that_of_batches() -> None:
    upload = training_calls.upload({}, retried=False)
    short, usual = network.from_sending(2), network.from_sending(network.DEFAULT_TIMEOUT)

    assert network.limits_of(upload, short, is_default=False).read == training_calls.UPLOAD_S
    batch = replace(upload, read_s=BATCH_READ_S, always_patient=False)
    assert network.limits_of(batch, short, is_default=False).read == 2
    assert network.limits_of(batch, usual, is_default=True).read == BATCH_READ_S


def test_a_closed_client_says_so(contract_service: Any, tmp_path: Path) -> None:
    with RoverTwin(contract_service.url) as twin:
        pass
    for ask_it in (twin.models, lambda: twin.predict(28, 430, 60, save_to=tmp_path / "a.csv")):
        with pytest.raises(RuntimeError, match="this client was closed: make another one"):
            ask_it()


def test_an_asynchronous_client_in_a_second_event_loop_says_what_to_do(contract_service: Any) -> None:
    twin = AsyncRoverTwin(contract_service.url, connections=1)

    async def ask_thrice() -> None:
        await asyncio.gather(*(twin.models() for _ in range(3)))

    with asyncio.Runner() as first, asyncio.Runner() as second:
        first.run(ask_thrice())
        with pytest.raises(RuntimeError, match=r"in another event loop before.*make one inside each asyncio\.run"):
            second.run(ask_thrice())
        first.run(twin.aclose())


@pytest.mark.parametrize("retries", [-1, 11, 1.5, True])
def test_retries_are_bounded(retries: Any) -> None:
    with pytest.raises(ValueError, match=r"retries is .*, allowed is 0 to 10"):
        RoverTwin(retries=retries)


def test_one_client_serves_many_threads(contract_service: Any) -> None:
    with RoverTwin(contract_service.url) as twin, ThreadPoolExecutor(8) as pool:
        horizons = np.arange(6.0, 46.0)
        answers = list(pool.map(lambda horizon: twin.predict(28, 430, 60, horizon), horizons))

    assert [answer.time_s[-1] for answer in answers] == horizons.tolist()


@pytest.mark.slow
def test_one_client_serves_many_coroutines(contract_service: Any) -> None:
    async def ask_many() -> list[Any]:
        async with AsyncRoverTwin(contract_service.url) as twin:
            return await asyncio.gather(*(twin.predict(28, 430, 60, horizon) for horizon in range(6, 46)))

    assert [answer.time_s[-1] for answer in asyncio.run(ask_many())] == list(range(6, 46))


def test_both_clients_have_the_same_words_and_arguments() -> None:
    words = {word for word, _ in inspect.getmembers(RoverTwin, inspect.isfunction) if not word.startswith("_")}
    assert words >= {"predict", "mobility", "suggested_runs", "models", "model", "manifest", "ready"}
    assert words >= {"upload_dataset", "datasets", "start_training_job", "wait_for_job", "move_alias", "job_events"}
    for word in words - {"close", "live"}:
        one, other = inspect.signature(getattr(RoverTwin, word)), inspect.signature(getattr(AsyncRoverTwin, word))
        assert one.parameters == other.parameters
        if word != "job_events":  # iterators of each kind
            assert one.return_annotation == other.return_annotation
            assert inspect.iscoroutinefunction(getattr(AsyncRoverTwin, word))


@pytest.mark.processes
def test_importing_the_client_needs_none_of_the_services_weight() -> None:
    heavy = {"torch", "pydantic", "fastapi", "service", "model_store"}
    code = "import sys, rover_twin_client; print(*{name.split('.')[0] for name in sys.modules})"

    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()

    assert heavy.isdisjoint(loaded)
