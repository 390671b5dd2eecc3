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
import time
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import structlog

from service.access.token_file import MOST_BYTES, StoredToken, TokenFileError, parse

ENVIRONMENT_NAME = "admin"
"""The identity of the token that is set as `ROVER_TWIN_ADMIN_TOKEN`."""

_PREFIX = "rt_"  # by which scanners, and people, find one that lies where it should not
_LOOK_S = 1.0
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

    A file that has become unusable, or is gone, changes nothing: the tokens that were in it last stay in force, and
    `problem` says so until it is well again. To be used by one thread.
    """

    def __init__(self, environment: str | None = None, path: Path | None = None) -> None:
        """Raises TokenFileError for a file that cannot be used: a service must not start with half its tokens."""
        self._own = [(digest_of(environment.encode()), Identity(ENVIRONMENT_NAME, Scope.ADMIN))] if environment else []
        self._path = path
        self._looked_at = time.monotonic()
        self._seen: tuple[int, ...] | None = None
        self._in_force = self._own
        self.problem: str | None = None
        if path is not None:
            self._take(*_read(path))

    @property
    def configured(self) -> bool:
        """Whether there can be a token at all."""
        return bool(self._own) or self._path is not None

    def holder(self, token: bytes) -> Identity | None:
        """Who holds this token. It takes as long for one that is nearly right, and for the first as for the last."""
        self._look_again()
        digest, found = digest_of(token), None
        for known, identity in self._in_force:
            if hmac.compare_digest(known, digest):
                found = identity  # and on: no early end
        return found

    def look(self) -> str | None:
        """What is wrong with the file, after a look at it."""
        self._look_again()
        return self.problem

    def _look_again(self) -> None:
        now = time.monotonic()
        if self._path is None or now < self._looked_at + _LOOK_S:
            return
        self._looked_at = now
        try:
            if _signature(self._path.stat()) == self._seen:
                return
            self._take(*_read(self._path))
        except (TokenFileError, OSError) as error:
            problem = str(error) if isinstance(error, TokenFileError) else _unreadable(error)
            if problem != self.problem:
                _log.error("the tokens file is not used as it is now; the tokens before stay in force", reason=problem)
            self.problem, self._seen = problem, None

    def _take(self, stored: list[StoredToken], seen: tuple[int, ...] | None) -> None:
        read = [(each.digest, Identity(each.name, Scope(each.scope))) for each in stored]
        if self._own + read != self._in_force and self._in_force is not self._own:
            _log.info("the tokens file was read again", tokens=len(read))
        self._in_force, self._seen, self.problem = self._own + read, seen, None


def _read(path: Path) -> tuple[list[StoredToken], tuple[int, ...] | None]:
    """What a file holds, and by what to see that it is still the same; None while that is not sure yet."""
    try:
        with path.open("rb") as file:
            content, status = file.read(MOST_BYTES + 1), os.fstat(file.fileno())
    except OSError as error:
        raise TokenFileError(_unreadable(error)) from error
    settled = time.time_ns() - status.st_mtime_ns > _SETTLED_NS
    return parse(content), _signature(status) if settled else None


def _signature(status: os.stat_result) -> tuple[int, ...]:
    return status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns


def _unreadable(error: OSError) -> str:
    return f"the tokens file cannot be read: {error.strerror or type(error).__name__}"
