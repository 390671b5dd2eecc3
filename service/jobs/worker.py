"""The training worker: a process of its own that takes jobs from the queue, one at a time.

Any number of workers share a queue. Each looks after the others: the job of one that was killed is queued again.
"""

from __future__ import annotations

import os
import socket
import threading
import time
import uuid
from collections import Counter
from collections.abc import Iterable
from contextlib import suppress

import structlog
from dbos import DBOS, DBOSConfig, DBOSPortableJSONSerializer

from model_store import ModelStore, StoreError
from service.cpu import limit_compute_threads, limit_torch_threads
from service.errors import JobsDatabaseGoneError, JobsUnavailableError
from service.jobs.database import JobsDatabase, answering, make_engine, wait_for_server
from service.jobs.job import APPLICATION, APPLICATION_VERSION, QUEUE
from service.jobs.lease import make_lease
from service.jobs.retention import alone, prune
from service.jobs.workflow import register_workflow
from service.settings import Settings

POLL_S = 0.5
ROUND_S = 2.0
# Two looks in a row must find a worker dead: one that lost its lock with the database gets it back in between.
_LOOKS = 2
_LOOKS_AT_OWN = 4
_TIDY_EVERY_ROUNDS = 150
_PRUNE_EVERY_ROUNDS = 1800
_HAND_BACK_S, _GIVE_UP_S = 20.0, 3.0
_POOL = 8
_PATIENCE_S = 30.0
_CLIENT_PATIENCE_S = 5.0

_log = structlog.get_logger(__name__)


def run_worker(settings: Settings, ending: threading.Event, *, once: bool = False) -> None:
    """Work until `ending` is set, or with `once` until nothing is left to do; blocks.

    Told to end, it finishes the piece of the fit that runs (at most 20 s) and gives its job back. On return nothing
    runs any more that matters, but threads of dbos may be left: leave the process by `os._exit`, after an error too.
    Raises JobsUnavailableError and StoreUnavailableError when it cannot begin.
    """
    limit_torch_threads(settings.worker_threads)
    limit_compute_threads(settings.worker_threads)
    worker = Worker(
        ModelStore.open(settings.store_url, create="://" not in settings.store_url),
        settings.jobs_url(),
        ending,
        keep_days=settings.keep_jobs_days,
    )
    worker.run(once=once)


class Worker:
    """One worker. Its name is new in every life: the lock under that name says whether it lives."""

    def __init__(self, store: ModelStore, url: str, ending: threading.Event, *, keep_days: int) -> None:
        self.name = f"{socket.gethostname()[:40]}-{os.getpid()}-{uuid.uuid4().hex[:12]}"
        self.store = store
        self._keep_days = keep_days
        self.database = JobsDatabase.open(url, patience_s=_CLIENT_PATIENCE_S)
        self._engine = make_engine(url, pool_size=_POOL, patience_s=_PATIENCE_S)
        wait_for_server(self._engine, ending)
        self._lease = make_lease(self.database.engine, self.name)
        self._ending = ending
        self._running: set[str] = set()
        self._left: set[str] = set()
        self._suspects: Counter[str] = Counter()
        self._lock = threading.Lock()

    # ---- what a job asks (workflow.Runner)

    def enter(self, job_id: str) -> None:
        """A job begins to run here."""
        with self._lock:
            self._running.add(job_id)
        _log.info("training job runs", job=job_id)

    def leave(self, job_id: str) -> None:
        """It no longer does."""
        with self._lock:
            self._running.discard(job_id)
            self._left.add(job_id)
        _log.info("training job left", job=job_id)

    def is_ending(self) -> bool:
        """Whether the worker was told to end."""
        return self._ending.is_set()

    def is_alive(self) -> bool:
        """Whether this worker holds its lock; while nobody can tell, the others cannot either."""
        try:
            return self._lease.hold()
        except JobsUnavailableError:
            return True

    # ---- its life

    def run(self, *, once: bool) -> None:
        """Take jobs until told to end."""
        if not self._lease.hold():
            raise JobsUnavailableError(f"the lock of worker {self.name} is taken")
        config: DBOSConfig = {
            "name": APPLICATION,
            "application_version": APPLICATION_VERSION,
            "executor_id": self.name,
            "system_database_engine": self._engine,
            "serializer": DBOSPortableJSONSerializer(),
            "use_listen_notify": False,
            "notification_listener_polling_interval_sec": 1.0,
            "log_level": "WARNING",
        }
        with answering():  # what dbos asks while it starts it asks once
            DBOS(config=config)
            register_workflow(self)
            DBOS.launch()
            DBOS.register_queue(QUEUE, worker_concurrency=1, polling_interval_sec=POLL_S)
        _log.info("training worker ready", worker=self.name)
        try:
            self._rounds(once)
        except JobsDatabaseGoneError:
            _log.exception("the worker ends: its jobs are gone with the database")
            raise
        except BaseException:
            self._hand_back()
            raise
        self._hand_back()

    def _rounds(self, once: bool) -> None:
        rounds = 0
        while not self._ending.wait(ROUND_S if not once else POLL_S):
            try:
                self._tidy(self.store.jobs_with_work() if rounds % _TIDY_EVERY_ROUNDS == 0 else ())
                if self._lease.hold():
                    self._look_after_others()
                if rounds % _PRUNE_EVERY_ROUNDS == 0:
                    self._prune()
                if once and not self._anything_left():
                    return
                self.database.file.require()
            except JobsDatabaseGoneError:
                raise
            except (JobsUnavailableError, StoreError) as error:
                _log.warning("the worker waits", reason=str(error))
            rounds += 1

    def _look_after_others(self) -> None:
        """Queue again what dead workers were running, and what was given to this one and never began."""
        running = self.database.rows(["PENDING"])
        suspects: Counter[str] = Counter()
        for row in running:
            owner = str(row.executor_id)
            if owner == self.name:
                if row.workflow_id not in self._running:
                    suspects[row.workflow_id] = self._suspects[row.workflow_id] + 1
            elif owner not in suspects and self._lease.is_free(owner):
                suspects[owner] = self._suspects[owner] + 1
        self._suspects = suspects
        for owner in {str(row.executor_id) for row in running}:
            if owner != self.name and suspects[owner] >= _LOOKS:
                for job in self.database.take_back(owner):
                    _log.warning("worker died, its job is queued again", worker=owner, job=job)
        lost = {row.workflow_id for row in running if suspects[row.workflow_id] >= _LOOKS_AT_OWN}
        if lost:
            self.database.take_back(self.name, only=lost)

    def _prune(self) -> None:
        """Remove jobs that ended long ago, unless another worker is at it."""
        with alone(self.database) as mine:
            removed = prune(self.database, self.store, self._keep_days) if mine else 0
        if removed:
            _log.info("training jobs removed", jobs=removed, ended_days_ago=self._keep_days)

    def _anything_left(self) -> bool:
        return bool(self._running or self.database.rows(["ENQUEUED", "PENDING"], limit=1))

    def _tidy(self, others: Iterable[str]) -> None:
        """Remove work files of jobs that were cancelled here, and of `others` that ended while nobody ran them."""
        with self._lock:
            left, self._left = self._left, set()
        for job in left.union(others):
            row = self.database.row(job)
            if row is not None and row.status not in ("ENQUEUED", "DELAYED", "PENDING"):
                self.store.remove_work(job)

    def _hand_back(self) -> None:
        """Give back what runs. A database that hangs is not waited for: others then find this worker dead."""
        end = threading.Timer(_HAND_BACK_S + _GIVE_UP_S, os._exit, (1,))
        end.daemon = True
        end.start()
        self._ending.set()
        deadline = time.monotonic() + _HAND_BACK_S
        while self._running and time.monotonic() < deadline:
            time.sleep(0.05)
        DBOS.destroy()
        with suppress(JobsUnavailableError):  # then the others find this worker dead, which it is
            for job in self.database.take_back(self.name):
                row = self.database.row(job)
                given = int((row.attributes or {}).get("hand_backs", 0)) if row else 0
                self.database.count_hand_back(job, given + 1)
                _log.info("training job handed back", job=job)
            self._lease.release()
        _log.info("training worker ended", worker=self.name)
