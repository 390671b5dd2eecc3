"""Databases for the jobs' tests: a SQLite file, and a real PostgreSQL server that the tests start themselves."""

from __future__ import annotations

import importlib.util
import itertools
import os
import shutil
import signal
import subprocess
import tempfile
import time
import warnings
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import psutil
import psycopg
import pytest

_NUMBERS = itertools.count()
_RECOVERY_S = 90


class Postgres:
    """One server; each test gets a database of its own, made in a tenth of a second."""

    def __init__(self, folder: Path) -> None:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about the environment of the tests, not about ours
            import pgserver

            self.server = pgserver.get_server(folder, cleanup_mode="stop")

    def new_database(self) -> str:
        name = f"jobs_{os.getpid()}_{next(_NUMBERS)}"
        with psycopg.connect(self.server.get_uri(), autocommit=True) as connection:
            connection.execute(f"CREATE DATABASE {name}")
        return self.server.get_uri(database=name)

    def kill(self) -> None:
        """As a power cut: the server and all its sessions, at once."""
        postmaster = self.server.get_postmaster_info().process
        sessions = postmaster.children(recursive=True)
        for process in (postmaster, *sessions):
            with suppress(psutil.NoSuchProcess):
                process.send_signal(signal.SIGKILL)
        psutil.wait_procs([postmaster, *sessions], timeout=10)

    def _all(self) -> list[psutil.Process]:
        postmaster = self.server.get_postmaster_info().process
        return [postmaster, *postmaster.children(recursive=True)]

    def freeze(self) -> None:
        """The server and all its sessions stand still; the kernel goes on taking connections for them."""
        for process in self._all():
            with suppress(psutil.NoSuchProcess):
                process.suspend()

    def thaw(self) -> None:
        for process in self._all():
            with suppress(psutil.NoSuchProcess):
                process.resume()

    def start(self) -> None:
        """Start it again after `kill`; it recovers from its log.

        Before that it writes its whole folder to disk, with the databases of all tests, which may take longer than the
        ten seconds that pgserver waits; the server that it then gives up on goes on starting.
        """
        deadline = time.monotonic() + _RECOVERY_S
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            while True:
                try:
                    self.server.ensure_postgres_running()
                except (subprocess.TimeoutExpired, AssertionError):  # the latter: there, and not ready yet
                    if time.monotonic() > deadline:
                        raise
                    time.sleep(0.2)
                else:
                    return


def start_postgres() -> Iterator[Postgres]:
    if importlib.util.find_spec("pgserver") is None:
        pytest.skip("no PostgreSQL server to start: pgserver is not installed")
    folder = Path(tempfile.mkdtemp(prefix="pg"))  # a socket's path has a hundred characters at most
    server = Postgres(folder)
    try:
        yield server
    finally:
        server.server.cleanup()
        shutil.rmtree(folder, ignore_errors=True)
