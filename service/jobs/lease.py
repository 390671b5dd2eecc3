"""Who of the workers is alive: each holds a lock under its own name, which the system drops when the worker dies.

On PostgreSQL that is an advisory lock of a session (a connection pooler in transaction mode would break it), beside
SQLite a locked file. No clocks are compared and nothing expires.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import threading
from contextlib import suppress
from pathlib import Path
from typing import Protocol

import sqlalchemy as sa

from service.jobs.database import answering


class Lease(Protocol):
    """The lock of one worker. Safe to share between threads; on PostgreSQL every method may raise
    JobsUnavailableError.
    """

    def hold(self) -> bool:
        """Take the lock, or take it again after the database was gone; whether it is held now."""

    def is_free(self, worker: str) -> bool:
        """Whether the worker of that name holds no lock: it is dead."""

    def release(self) -> None:
        """Give the lock up."""


def make_lease(engine: sa.Engine, worker: str) -> Lease:
    """The kind of lock that suits the database."""
    if engine.dialect.name == "sqlite":
        return FileLease(Path(f"{engine.url.database}.workers"), worker)
    return SessionLease(engine, worker)


class FileLease:
    """A locked file in a folder beside the database."""

    def __init__(self, folder: Path, worker: str) -> None:
        self._folder = folder
        self._worker = worker
        self._file: int | None = None

    def hold(self) -> bool:
        """Take the lock; once taken it stays."""
        if self._file is not None:
            return True
        self._folder.mkdir(parents=True, exist_ok=True)
        opened = os.open(self._path(self._worker), os.O_CREAT | os.O_RDWR | os.O_CLOEXEC, 0o600)
        try:
            fcntl.flock(opened, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(opened)
            return False
        self._file = opened
        return True

    def is_free(self, worker: str) -> bool:
        """Whether nobody locks the file; a file left behind by the dead is removed."""
        path = self._path(worker)
        try:
            opened = os.open(path, os.O_RDWR | os.O_CLOEXEC)
        except FileNotFoundError:
            return True
        try:
            fcntl.flock(opened, fcntl.LOCK_EX | fcntl.LOCK_NB)
            path.unlink(missing_ok=True)
        except BlockingIOError:
            return False
        finally:
            os.close(opened)
        return True

    def release(self) -> None:
        """Remove the file, then the lock."""
        if self._file is not None:
            self._path(self._worker).unlink(missing_ok=True)
            os.close(self._file)
            self._file = None

    def _path(self, worker: str) -> Path:
        return self._folder / f"{hashlib.sha256(worker.encode()).hexdigest()[:32]}.lock"


class SessionLease:
    """An advisory lock of a connection that is kept for it alone."""

    def __init__(self, engine: sa.Engine, worker: str) -> None:
        self._engine = engine
        self._worker = worker
        self._connection: sa.Connection | None = None
        self._lock = threading.Lock()

    def hold(self) -> bool:
        """Take the lock; asks the server whether the session that has it still lives."""
        with self._lock, answering():
            try:
                if self._connection is None:
                    self._connection = self._engine.connect().execution_options(isolation_level="AUTOCOMMIT")
                    if self._ask("SELECT pg_try_advisory_lock(:key)", self._worker):
                        return True
                    self._drop()
                    return False
                return bool(self._ask("SELECT :key IS NOT NULL", self._worker))
            except sa.exc.SQLAlchemyError:
                self._drop()
                raise

    def is_free(self, worker: str) -> bool:
        """Whether no session has the other's lock; taken for a moment to see."""
        with self._lock, answering():
            if self._connection is None:
                return False  # one that is not sure of itself does not judge others
            try:
                free = self._ask("SELECT pg_try_advisory_lock(:key)", worker)
                if free:
                    self._ask("SELECT pg_advisory_unlock(:key)", worker)
            except sa.exc.SQLAlchemyError:
                self._drop()
                raise
            return free

    def release(self) -> None:
        """End the session, and with it the lock."""
        with self._lock:
            self._drop()

    def _ask(self, question: str, worker: str) -> bool:
        assert self._connection is not None
        digest = hashlib.sha256(f"rover-twin worker {worker}".encode()).digest()
        key = int.from_bytes(digest[:8], "big", signed=True)
        return bool(self._connection.execute(sa.text(question), {"key": key}).scalar())

    def _drop(self) -> None:
        if self._connection is not None:
            with suppress(sa.exc.SQLAlchemyError):
                self._connection.invalidate()  # a connection of the pool would keep the lock
                self._connection.close()
            self._connection = None
