"""A real `rover-twin serve` with a token and its worker, on a store of its own; and a line to it that breaks."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from rover_twin_client import RoverTwin, RoverTwinError

REPOSITORY = Path(__file__).parents[2]
TOKEN = "the token of the clients' tests"
START_S = 60.0


class OperatedService:
    """Can be killed and started again on the same port."""

    def __init__(self, folder: Path) -> None:
        self.store = folder / "store"
        shutil.copytree(REPOSITORY / "model_store" / "models" / "viper-lunar", self.store / "models" / "viper-lunar")
        with socket.create_server(("127.0.0.1", 0)) as listener:
            self.port = listener.getsockname()[1]
        self.url = f"http://127.0.0.1:{self.port}"
        self.log = folder / "log.txt"
        self.process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Ready to predict on return."""
        kept = {name: value for name, value in os.environ.items() if not name.startswith("ROVER_TWIN_")}
        settings = {"ROVER_TWIN_ADMIN_TOKEN": TOKEN, "ROVER_TWIN_DRAIN_S": "0"}
        command = [sys.executable, "-m", "service", "serve", "--port", str(self.port), "--store", str(self.store)]
        with self.log.open("a") as sink:
            self.process = subprocess.Popen(command, cwd=REPOSITORY, env=kept | settings, stdout=sink, stderr=sink)
        try:
            self._wait_ready(self.process)
        except BaseException:
            self.stop()  # whoever asked for it never gets to
            raise

    def _wait_ready(self, process: subprocess.Popen[bytes]) -> None:
        deadline = time.monotonic() + START_S
        with RoverTwin(self.url) as twin:
            while not self._is_ready(twin):
                assert process.poll() is None, self.log.read_text()[-3000:]
                assert time.monotonic() < deadline, self.log.read_text()[-3000:]
                time.sleep(0.1)

    def _is_ready(self, twin: RoverTwin) -> bool:
        try:
            twin.ready()
        except RoverTwinError:
            return False
        return True

    def kill(self) -> None:
        """As kill -9."""
        assert self.process is not None
        self.process.kill()
        self.process.wait(30)

    def stop(self) -> None:
        """As an operator does."""
        assert self.process is not None
        self.process.terminate()
        self.process.wait(60)


class BreakingLine:
    """Passes connections on to a port; each of the first `breaks` is cut once `after_bytes` of answers came through."""

    def __init__(self, port: int, breaks: int, after_bytes: int) -> None:
        self._port = port
        self._left = breaks
        self._after_bytes = after_bytes
        self.cut = 0

    @contextmanager
    def listening(self) -> Iterator[str]:
        """The address of the line."""
        with socket.create_server(("127.0.0.1", 0)) as door:
            accepting = threading.Thread(target=self._accept, args=(door,), daemon=True)
            accepting.start()
            yield f"http://127.0.0.1:{door.getsockname()[1]}"
            door.shutdown(socket.SHUT_RDWR)
        accepting.join(5)

    def _accept(self, door: socket.socket) -> None:
        while True:
            try:
                visitor, _ = door.accept()
            except OSError:
                return
            breaking = self._left > 0
            self._left -= breaking
            threading.Thread(target=self._serve, args=(visitor, breaking), daemon=True).start()

    def _serve(self, visitor: socket.socket, breaking: bool) -> None:
        with visitor, socket.create_connection(("127.0.0.1", self._port)) as service:
            threading.Thread(target=_pass_on, args=(visitor, service, None), daemon=True).start()
            if _pass_on(service, visitor, self._after_bytes if breaking else None):
                self.cut += 1
            for end in (visitor, service):
                with suppress(OSError):
                    end.shutdown(socket.SHUT_RDWR)


def _pass_on(source: socket.socket, target: socket.socket, most_bytes: int | None) -> bool:
    """Whether it stopped because that many bytes had gone through."""
    left = most_bytes
    with suppress(OSError):
        while data := source.recv(65536):
            if left is not None and len(data) >= left:
                target.sendall(data[:left])
                return True
            target.sendall(data)
            left = None if left is None else left - len(data)
    return False
