"""The image's health check, run as it is against a real server: 0 for ready, 1 with a reason for anything else."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path

import pytest

pytestmark = pytest.mark.processes

SCRIPT = Path(__file__).parents[2] / "docker" / "healthcheck.py"


class Answering(BaseHTTPRequestHandler):
    status = 200

    def do_GET(self) -> None:
        self.send_response(self.status if self.path == "/health/ready" else 404)
        self.end_headers()

    def log_message(self, *arguments: object) -> None:
        """Quiet."""


@pytest.fixture
def server() -> Iterator[HTTPServer]:
    """Answers /health/ready with the status that `Answering.status` says."""
    with HTTPServer(("127.0.0.1", 0), type("Own", (Answering,), {})) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield server
        server.shutdown()


def check(port: int | str, **environment: str) -> subprocess.CompletedProcess[str]:
    surroundings = os.environ | {"ROVER_TWIN_PORT": str(port)} | environment
    return subprocess.run(
        [sys.executable, str(SCRIPT)], env=surroundings, capture_output=True, text=True, check=False, timeout=30
    )


def test_ready_is_zero_and_silent(server: HTTPServer) -> None:
    done = check(server.server_port)

    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_a_proxy_in_the_environment_is_passed_by(server: HTTPServer) -> None:
    assert check(server.server_port, http_proxy="http://127.0.0.1:9", no_proxy="").returncode == 0


@pytest.mark.parametrize("status", [503, 500, 404])
def test_anything_but_ready_is_one_with_the_reason(server: HTTPServer, status: int) -> None:
    server.RequestHandlerClass.status = status

    done = check(server.server_port)

    assert done.returncode == 1
    assert done.stderr.startswith(f"not ready: HTTP Error {status}")


def test_nobody_there_is_one_line() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]

    done = check(port)

    assert done.returncode == 1
    assert len(done.stderr.splitlines()) == 1


def test_a_port_that_is_none_is_one_line() -> None:
    done = check("http")

    assert done.returncode == 1
    assert len(done.stderr.splitlines()) == 1
