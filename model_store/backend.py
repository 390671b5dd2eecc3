"""The few things the store asks of a place for bytes, over `obstore`: a directory, memory, S3, GCS, Azure.

Only `Backend.open` knows URLs. Everything else sees keys such as `models/viper-lunar/versions/1/manifest.json`.

What a directory gives (obstore's LocalStore): a put is staged beside its target as `<file>#<n>` and hard-linked
into place, so of many processes creating one key exactly one wins, nobody sees a partial object, and what a killed
put leaves behind never shows up in a listing. It does not fsync: `ModelStore.publish` says what that means.

The runtime under obstore has threads: open a store after `fork`, not before.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

import obstore
from obstore.exceptions import AlreadyExistsError as ObjectExistsError
from obstore.exceptions import BaseError, PermissionDeniedError, PreconditionError, UnauthenticatedError
from obstore.store import LocalStore, from_url

from model_store.errors import ArtefactTooLargeError, StoreUnavailableError
from model_store.observing import observed

if TYPE_CHECKING:
    from obstore import BytesStream
    from obstore.store import ObjectStore

CHUNK_BYTES = 1 << 20

_URL = re.compile(r"[a-z][a-z0-9+.-]*://")
_SECRETS = re.compile(r"(?<=//)[^\s/]*@|\?[^\s\"]+")


class Backend:
    """Keys and bytes; every failure of the backend becomes a `StoreUnavailableError`."""

    def __init__(self, objects: ObjectStore, location: str) -> None:
        self._objects = objects
        self.location = location

    @classmethod
    def open(cls, url: str | os.PathLike[str], *, create: bool = False) -> Backend:
        """Open a plain path or a URL; `create` makes a missing directory (buckets are never made).

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
            return cls(from_url(text), location)
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
                found = obstore.get(self._objects, key)
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
                found = obstore.get(self._objects, key)
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
                obstore.put(self._objects, key, data, mode="create", use_multipart=False)
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
            obstore.put(self._objects, key, data, use_multipart=False)

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

    def folders(self, prefix: str) -> list[str]:
        """The names one level under a prefix that have something below them."""
        with self._translated("list", prefix):
            found = obstore.list_with_delimiter(self._objects, prefix)
            return [path.rpartition("/")[2] for path in found["common_prefixes"]]

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
            raise StoreUnavailableError(
                f"cannot {doing} {key} in the model store {self.location!r}: {_first_line(error)}"
            ) from error


def _first_line(error: Exception) -> str:
    # obstore appends a page of debugging; it stays reachable as the cause
    return str(error).partition("\n")[0]


def _public(url: str) -> str:
    # a URL may carry credentials; messages and logs must not
    parts = urlsplit(url)
    return f"{parts.scheme}://{parts.netloc.rpartition('@')[2]}{parts.path}"
