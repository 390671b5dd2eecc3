"""Tokens by name: what one is, and which are in force.

A token is 32 random bytes. Of such a secret the SHA-256 is safe to keep: nobody can try 2^256 of them, so a slow hash
with a salt, which passwords need because people choose them, would only make each request slower. That is why the
command makes the tokens and the file takes none that a person made up.
"""

from __future__ import annotations

import hashlib
import hmac
import os
import secrets
import threading
import time
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import structlog

from service.access.token_file import StoredToken, TokenFileError, content_of, parse

ENVIRONMENT_NAME = "admin"
"""The identity of the token that is set as `ROVER_TWIN_ADMIN_TOKEN`."""

_PREFIX = "rt_"  # by which scanners, and people, find one that lies where it should not
_LOOK_S = 1.0
_STALLED_S = 3.0
_FIRST_S = 5.0
_SETTLED_NS = 2_000_000_000  # a file changed so lately may have changed again without showing it in its times

_log = structlog.get_logger(__name__)


class Scope(StrEnum):
    """What a token allows: to read, or everything."""

    READ = "read"
    ADMIN = "admin"

    def covers(self, wanted: Scope) -> bool:
        """Whether a token of this scope may do what asks for `wanted`."""
        return self is Scope.ADMIN or wanted is Scope.READ


@dataclass(frozen=True, slots=True)
class Identity:
    """Who holds a token."""

    name: str
    scope: Scope


def new_token() -> str:
    """A token nobody can guess."""
    return _PREFIX + secrets.token_urlsafe(32)


def digest_of(token: bytes) -> bytes:
    """What is kept of a token."""
    return hashlib.sha256(token).digest()


class Tokens:
    """The tokens in force: one of the environment, and those of a file, which is read again when it has changed.

    `start` begins to look at the file once a second, on a thread of its own: whoever asks for a holder never waits for
    a disk. There is one look at a time, so a file that does not answer holds one thread.

    A file that has become unusable, is gone, or does not answer, changes nothing: the tokens that were in it last stay
    in force, and `problem` says so until it is well again.
    """

    def __init__(self, environment: str | None = None, path: Path | None = None) -> None:
        """Raises TokenFileError for a file that cannot be used: a service must not start with half its tokens."""
        self._own = [(digest_of(environment.encode()), Identity(ENVIRONMENT_NAME, Scope.ADMIN))] if environment else []
        self._path = path
        self._seen: tuple[int, ...] | None = None
        self._in_force = self._own
        self._problem: str | None = None
        self._stalled = False
        self._end = threading.Event()
        self._began: float | None = None  # the look that goes on
        self._confirmed = time.monotonic()  # when the last one began that found out what the file is
        if path is not None:
            self._take(*_read_in_time(path))

    @property
    def configured(self) -> bool:
        """Whether there can be a token at all."""
        return bool(self._own) or self._path is not None

    def start(self) -> None:
        """Look at the file from now on, until `close`."""
        if self._path is not None:
            threading.Thread(target=self._keep_looking, name="tokens file", daemon=True).start()

    def close(self) -> None:
        """No more looks. Does not wait for one that goes on."""
        self._end.set()

    def holder(self, token: bytes) -> Identity | None:
        """Who holds this token. It takes as long for one that is nearly right, and for the first as for the last."""
        digest, found = digest_of(token), None
        for known, identity in self._in_force:
            if hmac.compare_digest(known, digest):
                found = identity  # and on: no early end
        return found

    @property
    def problem(self) -> str | None:
        """What is wrong with the file."""
        began = self._began
        waited_s = 0.0 if began is None else time.monotonic() - began
        if waited_s < _STALLED_S:
            self._stalled = False
            return self._problem
        if not self._stalled:
            _log.error("the tokens file does not answer; the tokens before stay in force", waited_s=round(waited_s, 1))
        self._stalled = True
        return f"the tokens file does not answer, for {waited_s:.0f} s now"

    @property
    def confirmed_s(self) -> float:
        """Seconds since it was last made sure what the file is; 0 without one."""
        return 0.0 if self._path is None else time.monotonic() - self._confirmed

    def _keep_looking(self) -> None:
        while not self._end.wait(_LOOK_S):
            self.look()

    def look(self) -> None:
        """Take what is in the file now. Blocks as long as the file does."""
        if self._path is None:
            return
        self._began = began = time.monotonic()
        try:
            if self._seen is None or _signature(self._path.stat()) != self._seen:
                self._take(*_read(self._path))
            self._confirmed = began
        except Exception as error:  # the thread must not end by any
            problem = str(error) if isinstance(error, TokenFileError) else _unreadable(error)
            if problem != self._problem:
                _log.error("the tokens file is not used as it is now; the tokens before stay in force", reason=problem)
            self._problem, self._seen = problem, None
        finally:
            self._began = None

    def _take(self, stored: list[StoredToken], seen: tuple[int, ...] | None) -> None:
        read = [(each.digest, Identity(each.name, Scope(each.scope))) for each in stored]
        if self._own + read != self._in_force and self._in_force is not self._own:
            _log.info("the tokens file was read again", tokens=len(read))
        self._in_force, self._seen, self._problem = self._own + read, seen, None


def _read_in_time(path: Path) -> tuple[list[StoredToken], tuple[int, ...] | None]:
    """As `_read`; raises TokenFileError too when that does not come back."""
    found: list[tuple[list[StoredToken], tuple[int, ...] | None] | Exception] = []

    def read() -> None:
        try:
            found.append(_read(path))
        except Exception as error:
            found.append(error)

    reading = threading.Thread(target=read, name="tokens file, first", daemon=True)
    reading.start()
    reading.join(_FIRST_S)
    if not found:
        raise TokenFileError(f"the tokens file cannot be read: it did not answer within {_FIRST_S:g} s")
    if isinstance(found[0], Exception):
        raise found[0]
    return found[0]


def _read(path: Path) -> tuple[list[StoredToken], tuple[int, ...] | None]:
    """What a file holds, and by what to see that it is still the same; None while that is not sure yet."""
    try:
        content, status = content_of(path)
    except OSError as error:
        raise TokenFileError(_unreadable(error)) from error
    settled = time.time_ns() - max(status.st_mtime_ns, status.st_ctime_ns) > _SETTLED_NS
    return parse(content), _signature(status) if settled else None


def _signature(status: os.stat_result) -> tuple[int, ...]:
    """Times of changes, too, that a program which sets times back cannot set."""
    return status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns


def _unreadable(error: Exception) -> str:
    reason = error.strerror if isinstance(error, OSError) else None
    return f"the tokens file cannot be read: {reason or type(error).__name__}"
