"""The audit log: every call that may change something, in a table of the jobs' database, on SQLite or PostgreSQL.

A row is written before the call does anything, and gets its status when it is answered. A row without a status is of a
call that runs, or whose process died: what it did is not known. No row holds a body, a query, or a header.

It has connections of its own, one for each call: admin calls are few, and one must not wait two seconds, as long as
dbos takes to be imported, before it may move an alias.
"""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import structlog

from service.errors import AuditUnavailableError, JobsDatabaseGoneError
from service.jobs.database_file import DatabaseFile, patience_of

if TYPE_CHECKING:
    import sqlalchemy as sa

TABLE = "rover_twin_audit"
MOST_LISTED = 200
_TIMEOUT_S = 4.5
_LONGEST_SUBJECT = 300
_FORGET_EVERY_S = 3600.0
_MOST_FORGOTTEN = 10_000  # at once: the table is not locked for long
_LOCK = 0x526F766573  # any number, the same in every process
_UNDEFINED_TABLE = "42P01"  # of PostgreSQL
_DAY_MS = 86_400_000
_SECRETS = re.compile(r"(?<=//)[^\s/]*@|password=\S+")

Result = TypeVar("Result")
_log = structlog.get_logger(__name__)


class Attempt(NamedTuple):
    """A call before it is carried out. `route` is a template, `path` what was asked for, percent-encoded."""

    actor: str
    client: str
    method: str
    route: str
    path: str
    request_id: str


@dataclass(frozen=True, slots=True)
class AuditEntry:
    """A row. `status` is what was answered, `subject` what it was about; None while it is not known."""

    id: int
    at: datetime
    actor: str
    client: str
    method: str
    route: str
    path: str
    request_id: str
    status: int | None
    subject: str | None = None


class AuditLog:
    """The table, in the database at `url` (sqlite:///file or postgresql://...). Safe to share between threads.

    Every method blocks, less than `timeout_s` unless the system stops answering, and raises AuditUnavailableError when
    the database is down, slow, not writable, or a file that was deleted or replaced since. Nothing is opened before the
    first call.
    """

    def __init__(self, url: str, kept_days: int, timeout_s: float = _TIMEOUT_S) -> None:
        self._url = url
        self._patience_s = patience_of(timeout_s)
        self._kept_days = kept_days
        self._lock = threading.Lock()
        self._engine: sa.Engine | None = None
        self._file: DatabaseFile | None = None
        self._prepared = False
        self._forgot_at = -_FORGET_EVERY_S

    def begin(self, attempt: Attempt) -> int:
        """Write that a call is about to be carried out; the number of its row. On return it survives any kill."""
        row = {**attempt._asdict(), "at_ms": time.time_ns() // 1_000_000, "path": attempt.path[:1000]}
        number = self._in_table(lambda connection: _inserted(connection, row))
        self._forget_sometimes()
        return number

    def complete(self, number: int, status: int, subject: str | None = None) -> None:
        """Write how the call was answered, and what it was about (its first 300 characters)."""
        table = _table()
        values = {"status": status, "subject": None if subject is None else subject[:_LONGEST_SUBJECT]}
        change = table.update().where(table.c.id == number).values(values)
        self._in_table(lambda connection: connection.execute(change))

    def page(
        self,
        *,
        limit: int,
        before: int | None = None,
        actor: str | None = None,
        since: datetime | None = None,
        until: datetime | None = None,
    ) -> list[AuditEntry]:
        """At most `limit` rows, newest first: those older than row `before`, of `actor`, from `since` up to `until`."""
        table = _table()
        wanted = table.select().order_by(table.c.id.desc()).limit(limit)
        if before is not None:
            wanted = wanted.where(table.c.id < before)
        if actor is not None:
            wanted = wanted.where(table.c.actor == actor)
        if since is not None:
            wanted = wanted.where(table.c.at_ms >= _ms(since))
        if until is not None:
            wanted = wanted.where(table.c.at_ms < _ms(until))
        return self._in_table(lambda connection: [_entry(row) for row in connection.execute(wanted)])

    def forget(self) -> int:
        """Delete rows that are older than they are kept, at most 10,000; how many."""
        table = _table()
        oldest = time.time_ns() // 1_000_000 - self._kept_days * _DAY_MS
        old = table.select().with_only_columns(table.c.id).where(table.c.at_ms < oldest).limit(_MOST_FORGOTTEN)
        deletion = table.delete().where(table.c.id.in_(old.scalar_subquery()))
        return self._in_table(lambda connection: int(connection.execute(deletion).rowcount))

    def _forget_sometimes(self) -> None:
        """Now and then, with a call: there is no clock of its own for it. What fails is done the next time."""
        with self._lock:
            if time.monotonic() < self._forgot_at + _FORGET_EVERY_S:
                return
            self._forgot_at = time.monotonic()
        try:
            if gone := self.forget():
                _log.info("old rows of the audit log were deleted", rows=gone, days=self._kept_days)
        except AuditUnavailableError as error:
            _log.warning("old rows of the audit log could not be deleted", reason=str(error))

    def _in_table(self, work: Callable[[sa.Connection], Result]) -> Result:
        """What `work` returns, in a transaction. A table that somebody dropped is made again, once."""
        try:
            with self._connected() as connection:
                return work(connection)
        except _TableGoneError as error:
            _log.error("the audit log has lost its table, or its database; it is made again, empty", reason=str(error))
            self._prepared = False
            with self._connected() as connection:
                return work(connection)

    @contextmanager
    def _connected(self) -> Iterator[sa.Connection]:
        """A transaction, in a database that has the table. What it wrote is where the next process finds it."""
        import sqlalchemy as sa  # noqa: PLC0415 - a service without admin calls need not wait for it

        try:
            with self._lock:
                engine = self._engine = self._engine or _make_engine(self._url, self._patience_s)
            if self._file is not None:
                self._file.require()  # else connecting would make it anew
            with _connection(engine, self._file_of) as connection:
                if not self._prepared:
                    with connection.begin():
                        _prepare(connection)
                    self._prepared = True
                with connection.begin():
                    yield connection
                self._file_of(engine).require(written=_changed_rows(connection))
        except JobsDatabaseGoneError as error:
            raise AuditUnavailableError(str(error)) from error
        except (sa.exc.SQLAlchemyError, OSError) as error:
            cause = getattr(error, "orig", None) or error
            reason = _SECRETS.sub("", str(cause).strip().partition("\n")[0])[:200]
            kind = _TableGoneError if self._prepared and _tells_of_no_table(cause) else AuditUnavailableError
            raise kind(f"the database of the audit log does not answer: {reason}") from error

    def _file_of(self, engine: sa.Engine) -> DatabaseFile:
        """The file as the first connection found it."""
        with self._lock:
            self._file = self._file or DatabaseFile(engine, keeps_open=False)
            return self._file


class _TableGoneError(AuditUnavailableError):
    """The table was there, and is not any more."""


def _tells_of_no_table(cause: object) -> bool:
    return getattr(cause, "sqlstate", None) == _UNDEFINED_TABLE or str(cause).startswith("no such table")


def _inserted(connection: sa.Connection, row: dict[str, Any]) -> int:
    made = connection.execute(_table().insert().values(row))
    return int(made.inserted_primary_key[0])  # type: ignore[index] # one row has one


def _changed_rows(connection: sa.Connection) -> bool:
    """Whether a connection to SQLite has changed any row: else the log may be empty."""
    return int(getattr(connection.connection.driver_connection, "total_changes", 0)) > 0


_LEFT_OPEN: list[Any] = []


@contextmanager
def _connection(engine: sa.Engine, file_of: Callable[[sa.Engine], DatabaseFile]) -> Iterator[sa.Connection]:
    """A connection, closed unless its file is gone: see `DatabaseFile`."""
    connection = engine.connect()
    try:
        file_of(engine).require()
        yield connection
    finally:
        try:
            file_of(engine).require()
        except JobsDatabaseGoneError:
            _LEFT_OPEN.append(connection)
        else:
            connection.close()


def _make_engine(url: str, patience_s: float) -> sa.Engine:
    import sqlalchemy as sa  # noqa: PLC0415

    parsed = sa.make_url(url)
    if parsed.get_backend_name() == "sqlite":
        Path(parsed.database or "").absolute().parent.mkdir(parents=True, exist_ok=True)
        engine = sa.create_engine(parsed, poolclass=sa.pool.NullPool, connect_args={"timeout": patience_s})
        sa.event.listen(engine, "connect", _prepare_sqlite)
        return engine
    milliseconds = round(patience_s * 1000)
    bounds = f"-c statement_timeout={milliseconds} -c lock_timeout={milliseconds}"
    return sa.create_engine(
        parsed.set(drivername="postgresql+psycopg"),
        poolclass=sa.pool.NullPool,
        connect_args={
            "application_name": "rover-twin-audit",
            "connect_timeout": max(2, round(patience_s) - 1),  # libpq knows no less
            "tcp_user_timeout": milliseconds,
            "options": bounds,
        },
    )


def _prepare_sqlite(connection: Any, _record: Any) -> None:  # noqa: ANN401 - the driver's own types
    connection.isolation_level = "IMMEDIATE"
    connection.execute("PRAGMA journal_mode=WAL")  # as the jobs have it
    connection.execute("PRAGMA synchronous=FULL")


def _prepare(connection: sa.Connection) -> None:
    import sqlalchemy as sa  # noqa: PLC0415

    if connection.dialect.name == "postgresql":  # of several at once, all but one would fail
        connection.exec_driver_sql(f"SELECT pg_advisory_xact_lock({_LOCK})")
    connection.execute(sa.schema.CreateTable(_table(), if_not_exists=True))
    for index in _table().indexes:
        connection.execute(sa.schema.CreateIndex(index, if_not_exists=True))
    if "subject" not in {each["name"] for each in sa.inspect(connection).get_columns(TABLE)}:  # made before there was
        connection.exec_driver_sql(f"ALTER TABLE {TABLE} ADD COLUMN subject TEXT")


_made: dict[str, Any] = {}


def _table() -> sa.Table:
    """The table; SQLAlchemy is imported with the first call, as all of the database is."""
    if not _made:
        import sqlalchemy as sa  # noqa: PLC0415

        number = sa.BigInteger().with_variant(sa.Integer(), "sqlite")  # which counts up integers only
        texts = ("actor", "client", "method", "route", "path", "request_id")
        _made[TABLE] = sa.Table(
            TABLE,
            sa.MetaData(),
            sa.Column("id", number, primary_key=True, autoincrement=True),
            sa.Column("at_ms", sa.BigInteger, nullable=False, index=True),
            *(sa.Column(name, sa.Text, nullable=False) for name in texts),
            sa.Column("status", sa.Integer),
            sa.Column("subject", sa.Text),
            sqlite_autoincrement=True,  # the number of a row that is gone is not given again
        )
    table: sa.Table = _made[TABLE]
    return table


def _ms(moment: datetime) -> int:
    return round((moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp() * 1000)


def _entry(row: Any) -> AuditEntry:  # noqa: ANN401 - a row as SQLAlchemy gives it
    fields = dict(row._mapping)
    at = datetime.fromtimestamp(fields.pop("at_ms") / 1000, UTC)
    return AuditEntry(at=at, **fields)
