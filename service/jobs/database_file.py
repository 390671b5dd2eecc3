"""Whether the file of a SQLite database is still the one that was opened."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from service.errors import JobsDatabaseGoneError

if TYPE_CHECKING:
    import sqlalchemy as sa

_LOG_BEGINS = (bytes.fromhex("377f0682"), bytes.fromhex("377f0683"))  # as SQLite documents it, of either byte order

Identity = tuple[int, int] | None


def patience_of(timeout_s: float) -> float:
    """Seconds after which a database is given up, so that its error comes before a request is given up."""
    return max(timeout_s - 0.5, timeout_s / 2)


class DatabaseFile:
    """The file of a SQLite database as it was when it was opened; on PostgreSQL there is none.

    Whoever deletes or replaces the file leaves open connections with one that nobody will ever find again: what is
    written there is lost with the last of them. Nor may that one be closed: SQLite would remove the log of the new
    file, which has the same name. So a process that meets this refuses everything until it is started again.
    """

    def __init__(self, engine: sa.Engine, *, keeps_open: bool = True) -> None:
        """Of a database that is open. One that `keeps_open` a connection has the same log as long as it lives."""
        name = engine.url.database if engine.dialect.name == "sqlite" else None
        self._path = Path(name).absolute() if name else None
        self._log = self._path.with_name(f"{self._path.name}-wal") if self._path else None
        self._opened = _identity(self._path)
        self._opened_log = _identity(self._log) if keeps_open else None

    def require(self, *, written: bool = False) -> None:
        """Raises JobsDatabaseGoneError unless the file is still there; after writing, its log has to be there, too.

        After writing means after the commit, and before the connection is closed: the last one takes the log along.
        """
        if self._path is None or self._log is None:
            return
        if self._opened is None or _identity(self._path) != self._opened:
            raise JobsDatabaseGoneError(
                f"the jobs database {self._path} was deleted or replaced while it was in use; put it back if it was "
                "moved, else restart the service: it begins a new one"
            )
        if written and not self._has_its_log(self._log):
            raise JobsDatabaseGoneError(f"the log of the jobs database {self._path} was deleted while it was in use")

    def _has_its_log(self, log: Path) -> bool:
        """A log that was deleted and came back has no beginning: what others wrote before that is not in it."""
        if self._opened_log is not None and _identity(log) != self._opened_log:
            return False
        try:
            with log.open("rb") as file:
                return file.read(4) in _LOG_BEGINS
        except OSError:
            return False


def _identity(path: Path | None) -> Identity:
    if path is None:
        return None
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_dev, found.st_ino
