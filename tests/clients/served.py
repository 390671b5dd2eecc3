"""A real `rover-twin serve` with the shipped model, for a whole file of tests."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rover_twin_client import RoverTwin, RoverTwinError

REPOSITORY = Path(__file__).parents[2]
START_S = 60.0


@contextmanager
def served(log: Path, **settings: str) -> Iterator[str]:
    """Its address, once it is ready to predict."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    command = [sys.executable, "-m", "service", "serve", "--host", "127.0.0.1", "--port", str(port)]
    environment = {name: value for name, value in os.environ.items() if not name.startswith("ROVER_TWIN_")} | settings
    with (
        log.open("w") as sink,
        subprocess.Popen(command, cwd=REPOSITORY, env=environment, stdout=sink, stderr=sink) as process,
    ):
        try:
            wait_until_ready(f"http://127.0.0.1:{port}", process, log)
            yield f"http://127.0.0.1:{port}"
        finally:
            process.terminate()


def wait_until_ready(url: str, process: subprocess.Popen[bytes], log: Path) -> None:
    """Returns once the service predicts; fails with its log when it ends, or takes too long."""
    deadline = time.monotonic() + START_S
    with RoverTwin(url) as twin:
        while True:
            try:
                twin.ready()
            except RoverTwinError:
                assert process.poll() is None, log.read_text()[-3000:]
                assert time.monotonic() < deadline, log.read_text()[-3000:]
                time.sleep(0.1)
            else:
                return
