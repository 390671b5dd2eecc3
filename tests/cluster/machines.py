"""Many machines on this one: two APIs, two workers, PostgreSQL and a bucket, each a process that can be killed."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

import httpx
import psycopg
import pytest

from model_store import ModelStore
from tests.api.conftest import PLAIN, move_alias, publish_version
from tests.databases import Postgres
from tests.s3 import S3Server
from tests.training.stored import put_dataset, stored_runs

TOKEN = "a token of the many machines"
HEADERS = {"Authorization": f"Bearer {TOKEN}"}
JOBS, DATASETS = "/v1/admin/training-jobs", "/v1/admin/datasets"
QUESTION = {"slope_deg": 28, "mass_kg": 430, "torque_nm": 60, "horizon_s": 4, "dt_s": 1}
APIS, WORKERS = ("api-a", "api-b"), ("worker-a", "worker-b")
START_S = 120.0
_RUNNING = "SELECT executor_id FROM dbos.workflow_status WHERE workflow_uuid = %s"


def until(condition: Callable[[], Any], timeout_s: float, what: str) -> Any:
    """What `condition` returns once that is true; a side that does not answer is not true."""
    deadline = time.monotonic() + timeout_s
    while time.monotonic() < deadline:
        with suppress(httpx.TransportError):
            if found := condition():
                return found
        time.sleep(0.05)
    raise AssertionError(f"not within {timeout_s:g} s: {what}")


def free_port() -> int:
    """A TCP port that nobody listens on."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        return int(listener.getsockname()[1])


class Machines:
    """All of them. The bucket has a model that predicts and a dataset to train on before anything starts."""

    def __init__(self, folder: Path, postgres: Postgres, bucket: S3Server) -> None:
        self.postgres = postgres
        self.bucket = bucket
        self._folder = folder
        self.ports = {name: free_port() for name in APIS}
        self.database = postgres.new_database()
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        self._clients = {name: self._client(name) for name in APIS}

    def __enter__(self) -> Self:
        with pytest.MonkeyPatch.context() as patch:  # it is read when a store is opened
            for name, value in self.bucket.environment.items():
                patch.setenv(name, value)
            self.store = ModelStore.open(self.bucket.url())
        move_alias(self.store, publish_version(self.store))
        put_dataset(self.store, "unit", stored_runs())
        try:
            for name in (*APIS, *WORKERS):
                self._begin(name)
            for name in APIS:
                self.wait_ready(name)
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        for client in self._clients.values():
            client.close()
        for process in self.processes.values():
            process.kill()
        for process in self.processes.values():
            process.wait(30)

    def _client(self, name: str) -> httpx.Client:
        return httpx.Client(base_url=f"http://127.0.0.1:{self.ports[name]}", headers=HEADERS, timeout=60, **PLAIN)

    def api(self, name: str) -> httpx.Client:
        """The operator's client of an API, with the token."""
        return self._clients[name]

    def url(self, name: str) -> str:
        """The address of an API."""
        return f"http://127.0.0.1:{self.ports[name]}"

    def kill(self, name: str) -> None:
        """SIGKILL."""
        if name == "database":
            self.postgres.kill()
        elif name == "bucket":
            self.bucket.kill()
        else:
            self.processes[name].send_signal(signal.SIGKILL)
            self.processes[name].wait(30)

    def start(self, name: str) -> None:
        """Start it again; on return database and bucket listen, the others are on their way."""
        if name == "database":
            self.postgres.start()
        elif name == "bucket":
            self.bucket.restart()
        else:
            self._begin(name)

    def _begin(self, name: str) -> None:
        settings = {
            "STORE_URL": self.bucket.url(),
            "JOBS_DATABASE_URL": self.database,
            "ADMIN_TOKEN": TOKEN,
            "START_WORKER": "false",
            "PORT": str(self.ports.get(name, 0)),
            "THREADS": "1",
            "LOG_LEVEL": "warning",
        }
        environment = (
            os.environ | self.bucket.environment | {f"ROVER_TWIN_{key}": each for key, each in settings.items()}
        )
        command = [sys.executable, "-m", "service", "serve" if name in APIS else "worker"]
        with (self._folder / f"{name}.log").open("ab") as log:
            self.processes[name] = subprocess.Popen(
                command, env=environment, stdout=log, stderr=log, cwd=Path(__file__).parents[2]
            )

    def wait_ready(self, name: str, timeout_s: float = START_S) -> None:
        """Until the API can predict."""
        until(lambda: self.api(name).get("/health/ready").status_code == 200, timeout_s, f"{name} is ready")

    @staticmethod
    def answered(ask: Callable[[], httpx.Response]) -> httpx.Response:
        """The answer, asked for again where a busy machine let the database answer too late (503)."""
        for _ in range(10):
            if (answer := ask()).status_code != 503:
                break
            time.sleep(1)
        return answer

    def served(self, name: str, reference: str) -> int | None:
        """The version with which an API answers."""
        answer = self.api(name).get("/v1/predictions", params=QUESTION | {"model": reference})
        return answer.json()["model"]["version"] if answer.is_success else None

    def runner(self, job_id: str) -> str | None:
        """Which worker runs a job now, None while nobody does."""
        with psycopg.connect(self.database) as connection:
            row = connection.execute(_RUNNING, (job_id,)).fetchone()
        pids = {f"-{process.pid}-": name for name, process in self.processes.items() if name in WORKERS}
        return next((name for part, name in pids.items() if row and row[0] and part in row[0]), None)

    def job(self, job_id: str, *, at: str = "api-a") -> dict[str, Any]:
        """A job as an API tells it; empty while it cannot."""
        answer = self.api(at).get(f"{JOBS}/{job_id}")
        return answer.json() if answer.is_success else {}

    def ended(self, job_id: str, timeout_s: float) -> dict[str, Any]:
        """The job once it has ended."""
        states = ("succeeded", "failed", "cancelled")

        def over() -> dict[str, Any] | None:
            job = self.job(job_id)
            return job if job.get("state") in states else None

        return until(over, timeout_s, f"job {job_id} ends: {self.job(job_id)}")

    def versions_of(self, job_id: str, model: str) -> list[int]:
        """The versions of a model that a job has published; each is whole."""
        if model not in self.store.model_names():
            return []
        manifests = [self.store.verify(model, version) for version in self.store.versions(model)]
        return [manifest.version for manifest in manifests if manifest.lineage.job == job_id]
