"""The few things the store asks of a place for bytes, over `obstore`: a directory, memory, S3, GCS, Azure.

Only `Backend.open` knows URLs. Everything else sees keys such as `models/viper-lunar/versions/1/manifest.json`.

What a directory gives (obstore's LocalStore): a put is staged beside its target as `<file>#<n>` and hard-linked
into place, so of many processes creating one key exactly one wins, nobody sees a partial object, and what a killed
put leaves behind never shows up in a listing. It does not fsync: `ModelStore.publish` says what that means.

The runtime under obstore has threads: open a store after `fork`, not before.
"""

from __future__ import annotations

import errno
import hashlib
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, cast
from urllib.parse import urlsplit

import obstore
from obstore.exceptions import AlreadyExistsError as ObjectExistsError
from obstore.exceptions import BaseError, PermissionDeniedError, PreconditionError, UnauthenticatedError
from obstore.store import LocalStore, from_url

from model_store.errors import ArtefactTooLargeError, StoreFullError, StoreUnavailableError
from model_store.observing import observed

if TYPE_CHECKING:
    from obstore import BytesStream
    from obstore.store import ClientConfig, ObjectStore

CHUNK_BYTES = 1 << 20
PATIENCE_S = 4.0
_SMALL_BYTES = 8 << 20  # documents; what is larger may take `_LARGE_S`, with pauses of `_SILENT_S`
_LARGE_S, _SILENT_S = timedelta(seconds=600), timedelta(seconds=20)

_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_URL = re.compile(r"[a-z][a-z0-9+.-]*://")
_TOOK = re.compile(r" in [0-9.]+(s|ms|µs|ns)\b")
_SECRETS = re.compile(r"(?<=//)[^\s/]*@|\?[^\s\"]+")


class Backend:
    """Keys and bytes; every failure of the backend becomes a `StoreUnavailableError`."""

    def __init__(self, objects: ObjectStore, location: str, large: ObjectStore | None = None) -> None:
        self._objects = objects
        self._large = large or objects  # the same place, asked with more patience
        self.location = location
        self.remote = large is not None  # every look is a request over a network

    @classmethod
    def open(cls, url: str | os.PathLike[str], *, create: bool = False, patience_s: float = PATIENCE_S) -> Backend:
        """Open a plain path or a URL; `create` makes a missing directory (buckets are never made).

        A call to a remote store that does not answer fails within `patience_s`, retries included. Over 8 MiB it may
        take longer, with pauses of 20 s.

        Raises:
            StoreUnavailableError: the directory is missing, or the URL is of no kind obstore knows.
        """
        text = os.fspath(url)
        is_url = _URL.match(text) is not None
        location = _public(text) if is_url else text
        try:
            if not is_url:
                return cls(LocalStore(Path(text).expanduser().resolve(), mkdir=create), location)
            if text.startswith("file://"):
                return cls(LocalStore.from_url(text, mkdir=create), location)
            if text.startswith("memory://"):
                return cls(from_url(text), location)
            quick = timedelta(seconds=patience_s / 2)
            return cls(_remote(text, quick, quick), location, _remote(text, _LARGE_S, _SILENT_S))
        except (BaseError, OSError, ValueError) as error:
            raise StoreUnavailableError(
                f"cannot open the model store {location!r}: {_SECRETS.sub('', _first_line(error))}; give an existing "
                "directory (or allow creating it), or a file://, memory://, s3://, gs:// or az:// URL"
            ) from None  # the cause repeats the URL with its credentials

    def read(self, key: str, *, limit_bytes: int) -> bytes | None:
        """Return an object whole, or None when there is none.

        Raises:
            ArtefactTooLargeError: it is larger than `limit_bytes`; nothing of it was read.
            StoreUnavailableError: the backend fails.
        """
        with self._translated("read", key):
            try:
                found = obstore.get(self._objects if limit_bytes <= _SMALL_BYTES else self._large, key)
            except FileNotFoundError:
                return None
            size = found.meta["size"]
            if size > limit_bytes:
                raise ArtefactTooLargeError(
                    f"{key} has {size} bytes, more than the {limit_bytes} this reader accepts; "
                    "if that size is right, raise the limit, else restore the file from a backup"
                )
            return bytes(found.bytes())

    def chunks(self, key: str) -> Iterator[bytes] | None:
        """An object piece by piece, for those who pass it on; None when there is none.

        Raises StoreUnavailableError, also between two pieces.
        """
        with self._translated("read", key):
            try:
                found = obstore.get(self._large, key)
            except FileNotFoundError:
                return None
        return self._pieces(found.stream(min_chunk_size=CHUNK_BYTES), key)

    def _pieces(self, pieces: BytesStream, key: str) -> Iterator[bytes]:
        while True:
            with self._translated("read", key):
                piece = next(pieces, None)
            if piece is None:
                return
            yield bytes(piece)

    def exists(self, key: str) -> bool:
        """Whether an object is there, without reading it."""
        with self._translated("look up", key):
            try:
                obstore.head(self._objects, key)
            except FileNotFoundError:
                return False
            return True

    def create(self, key: str, data: bytes) -> bool:
        """Write a new object in one piece; False, and nothing changed, when the key is taken."""
        with self._translated("create", key):
            try:
                obstore.put(self._for(data), key, data, mode="create", use_multipart=False)
            except (ObjectExistsError, PreconditionError):
                return False
            return True

    def create_or_confirm(self, key: str, data: bytes) -> bool:
        """Create, and count finding the very same bytes as success.

        Over a network the answer to a successful put can get lost and the retry then meets its own object.
        """
        return self.create(key, data) or self.read(key, limit_bytes=max(len(data), 1 << 20)) == data

    def replace(self, key: str, data: bytes) -> None:
        """Write an object in one piece, over the one that may be there."""
        with self._translated("write", key):
            obstore.put(self._for(data), key, data, use_multipart=False)

    def remove(self, key: str) -> bool:
        """Remove an object; False when there was none."""
        with self._translated("remove", key):
            try:
                obstore.delete(self._objects, key)
            except FileNotFoundError:
                return False
            return True

    def keys(self, prefix: str) -> list[str]:
        """Every key under a prefix, relative to it, in no particular order; empty when there is nothing."""
        with self._translated("list", prefix):
            found = obstore.list(self._objects, prefix).collect()
            return [entry["path"].removeprefix(f"{prefix}/") for entry in found]

    def fingerprint(self, prefix: str) -> str:
        """A digest of all keys under a prefix and their states: it changes with anything there. One listing."""
        with self._translated("list", prefix):
            found = obstore.list(self._objects, prefix).collect()
            states = sorted(f"{each['path']} {each['e_tag']} {each['size']}" for each in found)
            return hashlib.sha256("\n".join(states).encode()).hexdigest()

    def folders(self, prefix: str) -> list[str]:
        """The names one level under a prefix that have something below them."""
        with self._translated("list", prefix):
            found = obstore.list_with_delimiter(self._objects, prefix)
            return [path.rpartition("/")[2] for path in found["common_prefixes"]]

    def _for(self, data: bytes) -> ObjectStore:
        return self._objects if len(data) <= 1 << 20 else self._large

    @contextmanager
    def _translated(self, doing: str, key: str) -> Iterator[None]:
        try:
            with observed(doing, key):
                yield
        except (PermissionDeniedError, UnauthenticatedError, PermissionError) as error:
            raise StoreUnavailableError(
                f"not permitted to {doing} {key} in the model store {self.location!r}; "
                "check the owner and mode of the directory, or the credentials"
            ) from error
        except (BaseError, OSError) as error:
            kind = StoreFullError if _is_full(error) else StoreUnavailableError
            raise kind(f"cannot {doing} {key} in the model store {self.location!r}: {_first_line(error)}") from error


def _remote(url: str, whole: timedelta, silent: timedelta) -> ObjectStore:
    """A store that gives up an attempt after `whole`, or when nothing comes for `silent`, and begins none later.

    A call is over after twice that: when the last attempt that it may begin hangs as well.
    """
    return from_url(
        url,
        client_options={**_from_environment(), "timeout": whole, "connect_timeout": silent, "read_timeout": silent},
        retry_config={
            "max_retries": 5,
            "retry_timeout": silent,
            "backoff": {"init_backoff": timedelta(seconds=0.1), "max_backoff": timedelta(seconds=1), "base": 2},
        },
    )


def _from_environment() -> ClientConfig:
    """What obstore reads itself as long as no option is given: with one, it forgets AWS_ALLOW_HTTP and its like."""
    found: dict[str, object] = {}
    for name in ("allow_http", "allow_invalid_certificates", "proxy_url", "proxy_ca_certificate", "proxy_excludes"):
        for prefix in ("AWS", "GOOGLE", "AZURE"):
            value = os.environ.get(f"{prefix}_{name.upper()}")
            if value:
                found[name] = value.lower() in ("1", "true", "yes", "on") if name.startswith("allow") else value
    return cast("ClientConfig", found)


def _is_full(error: Exception) -> bool:
    """Whether there is no room: obstore tells it in words, with the number of the system's error."""
    if isinstance(error, OSError) and error.errno in _NO_ROOM:
        return True
    return any(f"(os error {number})" in str(error) for number in _NO_ROOM)


def _first_line(error: Exception) -> str:
    # obstore appends a page of debugging; it stays reachable as the cause
    return _TOOK.sub("", str(error).partition("\n")[0])  # without how long it took: the same failure reads the same


def _public(url: str) -> str:
    # a URL may carry credentials; messages and logs must not
    parts = urlsplit(url)
    return f"{parts.scheme}://{parts.netloc.rpartition('@')[2]}{parts.path}"
