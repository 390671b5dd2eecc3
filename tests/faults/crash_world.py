"""A whole service that can be killed in parts: an API, a worker and a database, each a real process, over one store."""

from __future__ import annotations

import socket
import threading
import time
from collections import defaultdict, deque
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from typing import Any, Self

import httpx

from model_store import AliasRecord, ModelStore
from service.errors import JobsUnavailableError
from service.jobs.job import TrainingJob
from service.jobs.queue import JobQueue
from tests.api.conftest import PLAIN
from tests.databases import Postgres
from tests.jobs.nursery import Nursery, WorkerProcess, until
from tests.training.stored import put_dataset, stored_runs

TOKEN = "a token of the crash table"
HEADERS = {"Authorization": f"Bearer {TOKEN}"}
DATASETS = "/v1/admin/datasets"
JOBS = "/v1/admin/training-jobs"
# what a client that waits for an answer may meet when the other side is killed
GONE = (httpx.TransportError,)
_QUESTION = {"slope_deg": 12, "mass_kg": 430, "torque_nm": 60, "horizon_s": 4, "dt_s": 1}
_STUCK_S = 90.0
_SUPERVISED_S = 0.2
_FIRST_GUESS_S = 0.05
_REMEMBERED = 15


class Steps:
    """What the worker is at: told by it at the beginning of each step, so that a kill can be aimed."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._begun: list[tuple[float, str]] = []
        self._lasted: dict[str, deque[float]] = defaultdict(lambda: deque(maxlen=_REMEMBERED))

    def heard(self, _pid: int, step: str) -> None:
        with self._changed:
            self._begun.append((time.monotonic(), step))
            self._changed.notify_all()

    def forget(self) -> None:
        """Another job begins."""
        with self._changed:
            self._begun.clear()

    def learn(self) -> None:
        """How long steps last, from a job that nobody disturbed."""
        with self._changed:
            ends = [begun for begun, _ in self._begun[1:]]
            for (begun, step), end in zip(self._begun, ends, strict=False):
                self._lasted[step].append(end - begun)

    def wait_for(self, step: str, timeout_s: float) -> bool:
        """Whether the step began within the time."""
        with self._changed:
            return self._changed.wait_for(lambda: any(name == step for _, name in self._begun), timeout_s)

    def present(self) -> str:
        """The step that began last; `waiting` before the first."""
        with self._changed:
            return self._begun[-1][1] if self._begun else "waiting"

    def length_s(self, step: str) -> float:
        """What the step usually lasts."""
        with self._changed:
            return median(self._lasted[step]) if self._lasted[step] else _FIRST_GUESS_S


class World:
    """The processes, and a client of each. Whatever is killed is started again by `revive`."""

    def __init__(
        self, folder: Path, nursery: Nursery, steps: Steps, postgres: Postgres | None, store_url: str | None = None
    ) -> None:
        self._store_url = store_url or str(folder / "store")
        self.store = ModelStore.open(self._store_url, create=True)
        self.dataset = put_dataset(self.store, "unit", stored_runs())
        self.postgres = postgres
        self.steps = steps
        self.temporary = folder / "temporary"
        self.temporary.mkdir(exist_ok=True)
        self.jobs_file = folder / "jobs" / "jobs.sqlite"  # unless it is in PostgreSQL
        self._nursery = nursery
        self.url = postgres.new_database() if postgres else f"sqlite:///{self.jobs_file}"
        self.queue = JobQueue.open(self.url, 1000)
        self.acknowledged: list[tuple[str, int]] = []  # id and status of each call that was, until they are looked up
        self.refused = 0  # calls that were answered 503 or 507
        with socket.create_server(("127.0.0.1", 0)) as listener:
            self._port = listener.getsockname()[1]
        self._lives: dict[str, WorkerProcess] = {}
        self._killed: WorkerProcess | None = None  # the worker that `revive` is to start again
        self._changing = threading.Lock()
        self._over = threading.Event()
        self._supervisor = threading.Thread(target=self._keep_a_worker, daemon=True)

    def __enter__(self) -> Self:
        for victim in ("api", "worker"):
            self.revive(victim)
        self._supervisor.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._supervisor.join()
        self.queue.close()
        for process in self._lives.values():
            if process.code is None:
                process.kill()

    @contextmanager
    def client(self) -> Iterator[httpx.Client]:
        """A client of the API, with the token."""
        base = f"http://127.0.0.1:{self._port}"
        with httpx.Client(base_url=base, headers=HEADERS, timeout=60, **PLAIN) as client:
            yield client

    def kill(self, victim: str) -> None:
        """SIGKILL."""
        if victim == "database":
            assert self.postgres is not None
            self.postgres.kill()
        elif victim == "worker":
            with self._changing:
                self._killed = self._lives[victim]
                self._killed.kill()
        else:
            self._lives[victim].kill()

    def revive(self, victim: str) -> None:
        """Start it again; on return an API and a database answer."""
        if victim == "database":
            assert self.postgres is not None
            self.postgres.start()
        elif victim == "worker":
            with self._changing:
                self._start_worker()
        else:
            self._lives[victim] = self._nursery.serve(
                self.temporary,
                store_url=self._store_url,
                jobs_database_url=self.url,
                port=self._port,
                admin_token=TOKEN,
                start_worker=False,
                max_queued_jobs=1000,
                threads=1,
            )
            until(self._api_answers, 30, "the API answers")

    def _start_worker(self) -> None:
        self._lives["worker"] = self._nursery.start(self._store_url, self.url, aloud=True)

    def _keep_a_worker(self) -> None:
        """As the service does with its own: one that ended, because the database died as it began, is started again."""
        while not self._over.wait(_SUPERVISED_S):
            with self._changing:
                worker = self._lives["worker"]
                if worker.code is not None and worker is not self._killed:
                    self._start_worker()

    def _api_answers(self) -> bool:
        try:
            with self.client() as client:
                return client.get("/health/live").status_code == 200
        except GONE:
            return False

    def restart(self) -> None:
        """API and worker, after both were killed: as long as one holds a file that was deleted, none gets a new one."""
        for change in (self.kill, self.revive):
            for victim in ("api", "worker"):
                change(victim)

    def _told(self, method: str, address: str, **asked: Any) -> httpx.Response | None:
        """The answer to a call that changes something; None for one that is refused for now, or never came."""
        try:
            with self.client() as client:
                answer = client.request(method, address, **asked)
        except GONE:
            return None
        if answer.status_code in (503, 507):
            self.refused += 1
            return None
        if answer.is_success:
            self.acknowledged.append((answer.headers["X-Request-ID"], answer.status_code))
        return answer

    def submit(self, request: dict[str, Any], key: str) -> str | None:
        """Post a job; its id once the API has acknowledged it, None when it could not."""
        answer = self._told("POST", JOBS, json=request, headers={"Idempotency-Key": key})
        if answer is None:
            return None
        assert answer.status_code == 202, answer.text
        job_id: str = answer.json()["id"]
        return job_id

    def move(self, moved: str, version: int, seen: int) -> int | None:
        """Point name@alias to a version if its last move is number `seen`; the move's number once acknowledged.

        0 when somebody else has moved it since.
        """
        name, _, alias = moved.partition("@")
        condition = {"If-Match": f'"{seen}"'} if seen else {"If-None-Match": "*"}
        content = {"version": version, "reason": "by hand"}
        answer = self._told("PUT", f"/v1/models/{name}/aliases/{alias}", json=content, headers=condition)
        if answer is None:
            return None
        if answer.status_code == 412:
            return 0
        assert answer.status_code in (200, 201), answer.text
        seq: int = answer.json()["seq"]
        return seq

    def retire(self, name: str, version: int, how: str) -> str | None:
        """Archive or delete a version; its state once acknowledged."""
        place = f"/v1/admin/models/{name}/versions/{version}"
        answer = self._told("POST", f"{place}/archive") if how == "archived" else self._told("DELETE", place)
        if answer is None:
            return None
        assert answer.status_code == 200, answer.text
        state: str = answer.json()["state"]
        return state

    def moves_of(self, moved: str) -> list[AliasRecord]:
        """All moves of name@alias, oldest first."""
        name, _, alias = moved.partition("@")
        return self.store.alias_history(name, alias)

    def served_version(self, moved: str) -> int | None:
        """The version that answers a prediction by name@alias."""
        with self.client() as client:
            answer = client.get("/v1/predictions", params={**_QUESTION, "model": moved})
        version: int | None = answer.json()["model"]["version"] if answer.is_success else None
        return version

    def upload(self, data: bytes, pause_s: float = 0.0) -> str | None:
        """Post a dataset, half of it `pause_s` after the other; its id once acknowledged."""

        def halves() -> Iterator[bytes]:
            yield data[: len(data) // 2]
            time.sleep(pause_s)
            yield data[len(data) // 2 :]

        answer = self._told("POST", DATASETS, content=halves())
        if answer is None:
            return None
        assert answer.status_code in (200, 201), answer.text
        identity: str = answer.json()["id"]
        return identity

    def ended(self, job_id: str) -> TrainingJob | None:
        """The job once it has ended, None when it is stuck. Raises JobNotFoundError."""
        deadline = time.monotonic() + _STUCK_S
        while time.monotonic() < deadline:
            try:
                job = self.queue.get(job_id)
            except JobsUnavailableError:
                continue
            if job.finished_at is not None:
                return job
            time.sleep(0.03)
        return None
