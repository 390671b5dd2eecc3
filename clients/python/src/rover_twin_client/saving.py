"""Writes a file completely or not at all."""

from __future__ import annotations

import errno
import hashlib
import os
import re
import shutil
import stat
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from rover_twin_client.errors import UnexpectedAnswerError

_DIGEST = re.compile(r'"([0-9a-f]{64})"')
_NEW_MODE = 0o644


@contextmanager
def whole_file(path: Path, headers: Mapping[str, str]) -> Iterator[Callable[[bytes], None]]:
    """Gives a function that takes the pieces of a body. At the end the body becomes the file `path`.

    A symbolic link stays one: the file behind it is replaced. An older file keeps its mode, and its owner where this
    process may give files away. A pipe or a device that takes characters is written into, at the end and at once.

    Raises UnexpectedAnswerError when the body does not have the digest in `headers`, and an OSError with `path` for a
    place that cannot be written. After a failure of any kind an older file at `path` is unchanged, and nothing else is
    left.
    """
    with _naming(path):
        older = _older(path)
    writing = _into_stream(path, older) if older and not stat.S_ISREG(older.st_mode) else _replacing(path, older)
    digest = hashlib.sha256()
    with writing as part:

        def take(piece: bytes) -> None:
            with _naming(path):
                part.write(piece)
            digest.update(piece)

        yield take
        _require(digest.hexdigest(), headers, path)


@contextmanager
def _replacing(path: Path, older: os.stat_result | None) -> Iterator[IO[bytes]]:
    """A hidden file beside the one behind all links, whose place it takes at the end."""
    target = Path(os.path.realpath(path))
    with _naming(path):
        descriptor, name = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name[:40]}.")
    hidden = Path(name)
    try:
        with os.fdopen(descriptor, "wb") as part:
            yield part
            with _naming(path):
                part.flush()
        with _naming(path):
            if older is not None and hasattr(os, "chown"):
                with suppress(OSError):
                    os.chown(hidden, older.st_uid, older.st_gid)
            hidden.chmod(_NEW_MODE if older is None else stat.S_IMODE(older.st_mode))
            hidden.replace(target)
    except BaseException:
        hidden.unlink(missing_ok=True)
        raise


@contextmanager
def _into_stream(path: Path, older: os.stat_result) -> Iterator[IO[bytes]]:
    """A file that nobody sees, whose content goes into the pipe or device once it is whole: a retry repeats nothing."""
    if not (stat.S_ISFIFO(older.st_mode) or stat.S_ISCHR(older.st_mode)):
        code = errno.EISDIR if stat.S_ISDIR(older.st_mode) else errno.EINVAL
        raise OSError(code, "allowed is a file, a pipe, or a device that takes characters", str(path))
    with tempfile.TemporaryFile() as part:
        yield part
        part.seek(0)
        with _naming(path), _opened(path) as stream:
            shutil.copyfileobj(part, stream)


def _opened(path: Path) -> IO[bytes]:
    """The pipe or device; raises OSError at once where nobody reads from a pipe."""
    descriptor = os.open(path, os.O_WRONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOCTTY", 0))
    os.set_blocking(descriptor, True)
    return os.fdopen(descriptor, "wb")


def _older(path: Path) -> os.stat_result | None:
    """What stands behind the path and all its links; None for nothing."""
    try:
        return path.stat()
    except FileNotFoundError:
        return None


@contextmanager
def _naming(path: Path) -> Iterator[None]:
    """Raises an OSError of the same kind that names the caller's path, not a hidden file."""
    try:
        yield
    except OSError as fault:
        if fault.errno is None:
            raise
        said = "nobody reads from this pipe" if fault.errno == errno.ENXIO else os.strerror(fault.errno)
        raise OSError(fault.errno, said, str(path)) from fault


def _require(digest: str, headers: Mapping[str, str], path: Path) -> None:
    told = _DIGEST.fullmatch(headers.get("etag", ""))
    if told and told[1] != digest:
        raise UnexpectedAnswerError(f"the download of {path} is damaged: its SHA-256 digest is {digest}, not {told[1]}")
