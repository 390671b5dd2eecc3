"""`serve`: answers with the store and model that were asked for, and ends on Ctrl-C."""

from __future__ import annotations

import signal
import socket

import httpx
import pytest

from service.cli.failures import ExitCode
from service.learning.drive import library as engine
from service.wire import digits
from tests.cli.conftest import call, serve, start

_QUERY = {"slope_deg": 22, "mass_kg": 430, "torque_nm": 60}


@pytest.mark.processes
def test_serves_until_interrupted(small_store):
    serving = serve(small_store)
    answer = httpx.get(f"{serving.address}/v1/predictions", params=_QUERY, timeout=30)
    assert answer.json()["model"] == {"name": "rover", "version": 1, "alias": "champion"}
    serving.process.send_signal(signal.SIGINT)
    out, err = serving.process.communicate(timeout=30)
    assert serving.process.returncode == ExitCode.INTERRUPTED
    assert "Traceback" not in err
    assert out == ""


def test_settings_are_checked_before_anything_starts(small_store):
    answer = call("serve", "--model", "not a model", "--store", small_store)
    assert answer.code == ExitCode.USAGE
    assert "not a model" in answer.error


@pytest.mark.parametrize("wrong", ["0", "many", "257"])
def test_a_wrong_number_of_processes_is_refused_by_name(wrong, small_store):
    answer = call("serve", "--workers", wrong, "--store", small_store)
    assert answer.code == ExitCode.USAGE
    assert "workers" in answer.error


@pytest.mark.processes
def test_a_port_in_use_is_a_failure_that_says_so():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        process = start("serve", "--port", port)  # with the shipped model, which needs no torch
        _, err = process.communicate(timeout=60)
    assert process.returncode == ExitCode.FAILED
    assert "in use" in err
    assert any(line.startswith(f"error: the server on 127.0.0.1:{port} ended") for line in err.splitlines())


@pytest.mark.parametrize("path", ["service.wire.digits.PATH", "service.learning.drive.library.PATH"])
def test_a_compiled_library_that_does_not_fit_is_told_before_anything_starts(path, small_store, tmp_path, monkeypatch):
    (tmp_path / "library.so").write_bytes(b"not a library")
    monkeypatch.setattr(path, tmp_path / "library.so")
    digits.library.cache_clear()
    engine.library.cache_clear()
    try:
        answer = call("serve", "--store", small_store)
    finally:
        monkeypatch.undo()
        digits.library.cache_clear()
        engine.library.cache_clear()

    assert answer.code == ExitCode.FAILED
    assert "library.so cannot be loaded" in answer.error
    assert "pip install" in answer.error
