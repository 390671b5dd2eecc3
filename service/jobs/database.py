"""The database of the training jobs, on SQLite or PostgreSQL: what dbos keeps there, and what we ask of it.

Import it late: dbos takes two seconds to import, which a service without jobs need not wait for.
"""

from __future__ import annotations

import logging
import re
import sqlite3
import threading
from collections.abc import Collection, Iterator, Sequence
from contextlib import closing, contextmanager
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any, Self

import psycopg
import sqlalchemy as sa
from dbos import DBOSClient, DBOSPortableJSONSerializer, EnqueueOptions, WorkflowStatus
from dbos import error as dbos_errors

from service.errors import JobsDatabaseGoneError, JobsUnavailableError, QueueFullError
from service.jobs.database_file import DatabaseFile
from service.jobs.failure import JobFailedError
from service.jobs.job import APPLICATION, APPLICATION_VERSION, EVENTS, QUEUE, STATUS, WORKFLOW

_CONNECT_S = 3
_CONNECT_AGAIN_S = 0.5
_POOL = 8
_RETRY_AFTER_S = 30
_EVENT_POLL_S = 0.25
_SUBMISSIONS_LOCK = 0x526F766572  # any number, the same in every process
_LEFT_OPEN: list[JobsDatabase] = []
_SECRETS = re.compile(r"(?<=//)[^\s/]*@|password=\S+")


def make_engine(url: str, *, pool_size: int, patience_s: float) -> sa.Engine:
    """An engine that gives up on a server or a lock that does not answer within about `patience_s`.

    SQLite gets its folder, a write-ahead log (readers and the writer do not wait for each other) and transactions
    that take the write lock when they begin to write, as dbos wants it.
    Raises JobsUnavailableError when the folder cannot be made.
    """
    parsed = sa.make_url(url)
    bounds: dict[str, Any] = {"pool_size": pool_size, "max_overflow": 0, "pool_timeout": patience_s}
    milliseconds = int(patience_s * 1000)
    if parsed.get_backend_name() == "sqlite":
        _make_folder(parsed.database)
        engine = sa.create_engine(parsed, **bounds)
        sa.event.listen(engine, "connect", lambda connection, _record: _prepare_sqlite(connection, milliseconds))
        return engine
    engine = sa.create_engine(
        parsed.set(drivername="postgresql+psycopg"),
        **bounds,
        pool_pre_ping=True,
        connect_args={
            "application_name": APPLICATION,
            "connect_timeout": _CONNECT_S,
            "keepalives_idle": 5,
            "keepalives_interval": 2,
            "keepalives_count": 3,
            "tcp_user_timeout": milliseconds,
            "options": f"-c idle_in_transaction_session_timeout=60000 -c lock_timeout={milliseconds}",
        },
    )
    sa.event.listen(engine, "handle_error", _call_it_a_lost_connection)
    return engine


def wait_for_server(engine: sa.Engine, ending: threading.Event) -> None:
    """Let connecting to a PostgreSQL server that does not answer go on until it does or `ending` is set.

    dbos waits, too, but after each failure twice as long as before: up to a minute and a half after the server is back.
    """

    def connect(dialect: sa.Dialect, _record: Any, arguments: Any, options: Any) -> Any:  # noqa: ANN401
        while True:
            try:
                return dialect.connect(*arguments, **options)
            except psycopg.OperationalError:
                if ending.wait(_CONNECT_AGAIN_S):
                    raise

    if engine.dialect.name == "postgresql":
        sa.event.listen(engine, "do_connect", connect)


class JobsDatabase:
    """Rows, streams and notes of the jobs. Safe to share between threads.

    Every method raises JobsUnavailableError when the database is down, slow beyond its patience, or unusable.
    """

    def __init__(self, engine: sa.Engine, patience_s: float) -> None:
        self.engine = engine
        self._patience_s = patience_s
        self._submitting = threading.Lock()
        self.file = DatabaseFile(engine)
        # dbos would wait for a locked file for ever
        sa.event.listen(engine, "handle_error", _give_up_when_locked)
        self._client = DBOSClient(
            system_database_engine=engine,
            serializer=DBOSPortableJSONSerializer(),
            application_name=APPLICATION,
            retry_connection_errors=False,
            lazy=True,
        )

    @classmethod
    def open(cls, url: str, *, patience_s: float) -> Self:
        """Connect, and create the tables or bring them up to date; of several processes at once one does it."""
        _quieten()
        with answering():
            engine = make_engine(url, pool_size=_POOL, patience_s=patience_s)
            try:
                database = cls(engine, patience_s)
                # dbos 3.4 leaves this to its workers; the API may be there before the first of them
                database._client._sys_db.run_migrations()
            except BaseException:
                engine.dispose()
                raise
            database.file = DatabaseFile(engine)
            return database

    def close(self) -> None:
        """Let go of all connections, but for those to a file that is gone."""
        try:
            self.file.require()
        except JobsDatabaseGoneError:
            _LEFT_OPEN.append(self)
            return
        self._client.destroy()
        self.engine.dispose()

    def enqueue(
        self, job_id: str, request: dict[str, Any], actor: str, *, attributes: dict[str, Any], capacity: int
    ) -> bool:
        """Add a job; False, and nothing changed, when there is one with this id.

        Raises QueueFullError when `capacity` jobs wait: submitters queue up, so that two never share the last place.
        """
        options: EnqueueOptions = {
            "workflow_name": WORKFLOW,
            "queue_name": QUEUE,
            "workflow_id": job_id,
            "workflow_id_reuse_policy": "reject",
            "app_version": APPLICATION_VERSION,
            "application_name": APPLICATION,
            "attributes": attributes,
        }
        self.file.require()
        try:
            with self._one_submitter(), answering(), self.engine.begin() as connection:
                if connection.dialect.name == "postgresql":  # SQLite has one writer at a time anyway
                    connection.exec_driver_sql(f"SELECT pg_advisory_xact_lock({_SUBMISSIONS_LOCK})")
                self._client.enqueue_in_transaction(connection, options, request, actor)
                # seen from another connection, which does not see the new one; raising takes that one back
                waiting = len(self.rows(["ENQUEUED", "DELAYED"], limit=capacity))
                if waiting >= capacity:
                    raise QueueFullError(waiting, _RETRY_AFTER_S)
            self.file.require(written=True)  # nothing is acknowledged that went into a file without a name
        except dbos_errors.DBOSWorkflowIDInUseError:
            return False
        return True

    @contextmanager
    def _one_submitter(self) -> Iterator[None]:
        """Of this process; those of others wait in the database. Many waiting there would take all connections."""
        if not self._submitting.acquire(timeout=self._patience_s):
            raise JobsUnavailableError("the jobs database is slow: others wait to submit jobs")
        try:
            yield
        finally:
            self._submitting.release()

    def row(self, job_id: str) -> WorkflowStatus | None:
        """A job's row with input and output, None when there is none."""
        self.file.require()
        with answering():
            found = self._client.list_workflows(workflow_ids=[job_id], name=WORKFLOW)
        return found[0] if found else None

    def rows(
        self,
        statuses: Sequence[str] | None,
        *,
        limit: int | None = None,
        offset: int | None = None,
        end_time: str | None = None,
        whole: bool = False,
    ) -> list[WorkflowStatus]:
        """Rows of jobs, newest first; `whole` ones have input and output."""
        self.file.require()
        with answering():
            return self._client.list_workflows(
                name=WORKFLOW,
                status=list(statuses) if statuses is not None else None,
                limit=limit,
                offset=offset,
                end_time=end_time,
                sort_desc=True,
                load_input=whole,
                load_output=whole,
            )

    def ended_before(self, until: datetime, limit: int) -> list[str]:
        """Ids of at most `limit` jobs that ended before that time."""
        time = until.isoformat()
        plain = partial(self._client.list_workflows, name=WORKFLOW, limit=limit, load_input=False, load_output=False)
        with answering():
            ended = plain(status=["SUCCESS", "ERROR", "CANCELLED"], completed_before=time)
            # dbos notes no end for those that killed worker after worker: it counts when they were submitted
            ended += plain(status=["MAX_RECOVERY_ATTEMPTS_EXCEEDED"], end_time=time)
        return [row.workflow_id for row in ended[:limit]]

    def remove(self, job_ids: Sequence[str]) -> None:
        """Remove jobs with all that the database has of them, in one transaction. Only for those that have ended."""
        with answering():
            self._client.delete_workflows(list(job_ids))

    def note(self, job_id: str) -> dict[str, Any] | None:
        """What the worker last noted about the job (start and progress)."""
        with answering():
            note: dict[str, Any] | None = self._client.get_event(job_id, STATUS, timeout_seconds=0)
            return note

    def entries(self, job_id: str, start: int, limit: int) -> tuple[list[dict[str, Any]], bool]:
        """What the worker wrote from entry `start` on, and whether the job has ended and that is all of it."""
        entries: list[dict[str, Any]] = []
        stream = self._client.read_stream(job_id, EVENTS, offset=start, timeout_seconds=0)
        with answering(), closing(stream):
            try:
                for entry in stream:
                    entries.append(entry)
                    if len(entries) == limit:
                        return entries, False
            except dbos_errors.DBOSStreamTimeoutError:
                return entries, False
        return entries, True

    def wait_for_entry(self, job_id: str, number: int, wait_s: float) -> bool:
        """Whether that entry came, or the job ended, within `wait_s`."""
        stream = self._client.read_stream(
            job_id, EVENTS, offset=number, timeout_seconds=wait_s, polling_interval_sec=_EVENT_POLL_S
        )
        with answering(), closing(stream):
            try:
                next(stream, None)
            except dbos_errors.DBOSStreamTimeoutError:
                return False
        return True

    def cancel(self, job_id: str) -> None:
        """Cancel a job unless it has ended. Its worker notices when it looks."""
        self.file.require()
        with answering():
            self._client.cancel_workflow(job_id)
        self.file.require(written=True)

    def take_back(self, executor_id: str, only: Collection[str] | None = None) -> list[str]:
        """Queue again what this executor was running, or `only` some of it; returns the ids.

        Only for an executor that is known to be dead, and for jobs that it is known not to run.
        """
        with answering():
            system = self._client._sys_db  # dbos offers this to its own workers only
            pending = system.get_pending_workflows(executor_id, APPLICATION_VERSION)
            return [
                each.workflow_id
                for each in pending
                if (only is None or each.workflow_id in only)
                and system.reenqueue_for_recovery(each.workflow_id, [executor_id], QUEUE)
            ]

    def forgive(self, job_id: str, deaths: int) -> None:
        """Note that so many deaths of workers do not count against the job: it has got further since."""
        with answering():
            self._client.update_workflow_attributes(job_id, {"forgiven": deaths}, merge=True)

    def count_hand_back(self, job_id: str, hand_backs: int) -> None:
        """Note that a worker gave the job back in order: not one of the ends that count against the job."""
        with answering():
            self._client.update_workflow_attributes(job_id, {"hand_backs": hand_backs}, merge=True)


def _quieten() -> None:
    """Let dbos, which tells about every connection, log what matters, and where everything else is logged."""
    log = logging.getLogger("dbos")
    log.setLevel(logging.WARNING)
    if not log.handlers:  # dbos adds one of its own, in a format of its own, to a logger without any
        log.addHandler(logging.NullHandler())
        log.addFilter(_is_news)


def _is_news(record: logging.LogRecord) -> bool:
    """Not that a job was cancelled or failed: the worker logs that in a line, dbos with a traceback."""
    error = record.exc_info[1] if isinstance(record.exc_info, tuple) else None
    return not isinstance(error, dbos_errors.DBOSAwaitedWorkflowCancelledError | JobFailedError)


@contextmanager
def answering() -> Iterator[None]:
    """Turns what the driver raises when the database is down, slow or unusable into JobsUnavailableError."""
    try:
        yield
    except (sa.exc.SQLAlchemyError, OSError) as error:
        cause = getattr(error, "orig", None) or error
        reason = _SECRETS.sub("", str(cause).strip().partition("\n")[0])[:200]
        raise JobsUnavailableError(f"the jobs database does not answer: {reason}") from error


def _give_up_when_locked(context: sa.engine.ExceptionContext) -> None:
    if isinstance(context.original_exception, sqlite3.OperationalError) and "locked" in str(context.original_exception):
        raise JobsUnavailableError("the jobs database does not answer: another process keeps writing to it")


def _call_it_a_lost_connection(context: sa.engine.ExceptionContext) -> None:
    """A connection that does not come about counts as one that was lost: whoever waits for the database waits then.

    dbos 3.4 knows such an error by the words "connection failed" alone; "connection is bad", which psycopg says of a
    socket that nobody listens on, it takes for an answer, and lets the step that wanted to record something fail.
    """
    refused = isinstance(context.original_exception, psycopg.OperationalError)
    if refused and context.connection is None and not context.is_pre_ping:
        context.is_disconnect = True


def _make_folder(database: str | None) -> None:
    if not database or database == ":memory:":
        raise JobsUnavailableError("the jobs database needs a file: sqlite:///folder/jobs.sqlite")
    folder = Path(database).absolute().parent
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise JobsUnavailableError(
            f"the folder of the jobs database cannot be made: {error}; set ROVER_TWIN_JOBS_DATABASE_URL"
        ) from error


def _prepare_sqlite(connection: Any, milliseconds: int) -> None:  # noqa: ANN401 - the driver's own type
    connection.isolation_level = "IMMEDIATE"
    connection.execute(f"PRAGMA busy_timeout={milliseconds}")
    connection.execute("PRAGMA foreign_keys=ON")
    connection.execute("PRAGMA journal_mode=WAL")
