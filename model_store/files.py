"""Digests of artefact files: taken when published, compared whenever read."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, StringConstraints

from model_store.backend import Backend
from model_store.errors import ArtefactTooLargeError, CorruptArtefactError, InvalidDraftError

MAX_FILE_BYTES = 2 << 30
MAX_FILES = 256
_REMEDY = "restore this file from a backup, or go back to another version"

Sha256 = Annotated[str, StringConstraints(pattern=r"^[0-9a-f]{64}$")]

StoredPath = Annotated[str, StringConstraints(pattern=r"^(?:[a-z]{1,32}/)?[A-Za-z0-9][A-Za-z0-9._-]{0,127}$")]
"""A file path found in a document. Wider than what is written today, so that a later minor format may add files, and
still without a way out of the artefact's own folder."""


class FileEntry(BaseModel):
    """What one file must be: its sha256 (lower-case hexadecimal) and its size."""

    model_config = ConfigDict(extra="allow", frozen=True)

    sha256: Sha256
    size_bytes: Annotated[int, Field(ge=0)]

    @classmethod
    def of(cls, data: bytes) -> FileEntry:
        """Take the digest of a file's bytes."""
        return cls(sha256=hashlib.sha256(data).hexdigest(), size_bytes=len(data))

    def same_bytes(self, other: FileEntry) -> bool:
        """Whether both describe the same content."""
        return (self.sha256, self.size_bytes) == (other.sha256, other.size_bytes)


Files = Annotated[dict[StoredPath, FileEntry], Field(min_length=1, max_length=MAX_FILES)]


def digest_files(files: Mapping[str, bytes]) -> dict[str, FileEntry]:
    """Take the digests of what is about to be published.

    Raises:
        InvalidDraftError: none or more than 256 files, one over 2 GiB, one that is not bytes, or two names that a
            file system without upper and lower case would take for one.
    """
    if not 1 <= len(files) <= MAX_FILES:
        raise InvalidDraftError(f"{len(files)} files offered, allowed are 1 to {MAX_FILES}")
    if len({file.casefold() for file in files}) < len(files):
        raise InvalidDraftError(f"files {sorted(files)} differ in upper and lower case only; rename one")
    for file, data in files.items():
        if not isinstance(data, bytes):
            raise InvalidDraftError(f"file {file!r} is a {type(data).__name__}, it must be bytes")
        if len(data) > MAX_FILE_BYTES:
            raise InvalidDraftError(f"file {file!r} has {len(data)} bytes, at most {MAX_FILE_BYTES} are allowed")
    return {file: FileEntry.of(data) for file, data in files.items()}


def read_verified(backend: Backend, key: str, entry: FileEntry, *, limit_bytes: int = MAX_FILE_BYTES) -> bytes:
    """Read a file and compare it with what was published.

    Raises:
        ArtefactTooLargeError: the published size is over the limit; nothing was read.
        CorruptArtefactError: it is missing, or its size or sha256 differs.
        StoreUnavailableError: the backend fails.
    """
    if entry.size_bytes > limit_bytes:
        raise ArtefactTooLargeError(f"{key} has {entry.size_bytes} bytes, this reader accepts {limit_bytes}")
    try:
        data = backend.read(key, limit_bytes=entry.size_bytes)
    except ArtefactTooLargeError as error:
        raise CorruptArtefactError(
            f"{key} is larger than the {entry.size_bytes} bytes published: it was altered; {_REMEDY}"
        ) from error
    if data is None:
        raise CorruptArtefactError(f"{key} was published with {entry.size_bytes} bytes and is gone; {_REMEDY}")
    if len(data) != entry.size_bytes:
        raise CorruptArtefactError(
            f"{key} has {len(data)} bytes, published were {entry.size_bytes}: it is truncated; {_REMEDY}"
        )
    found = hashlib.sha256(data).hexdigest()
    if found != entry.sha256:
        raise CorruptArtefactError(
            f"{key} has sha256 {found[:12]}..., published was {entry.sha256[:12]}...: it was altered; {_REMEDY}"
        )
    return data


def stream_verified(backend: Backend, key: str, entry: FileEntry) -> Iterator[bytes]:
    """The pieces of a file, compared with what was published before the last one is given: a reader never has a whole
    file that is not the published one.

    Raises CorruptArtefactError at the first piece when the file is gone, at the last when it differs;
    StoreUnavailableError when the backend fails.
    """
    pieces = backend.chunks(key)
    if pieces is None:
        raise CorruptArtefactError(f"{key} was published with {entry.size_bytes} bytes and is gone; {_REMEDY}")
    digest, size, held = hashlib.sha256(), 0, b""
    for piece in pieces:
        digest.update(piece)
        size += len(piece)
        if size > entry.size_bytes:
            break
        yield held
        held = piece
    if (size, digest.hexdigest()) != (entry.size_bytes, entry.sha256):
        raise CorruptArtefactError(f"{key} is not the {entry.size_bytes} bytes that were published; {_REMEDY}")
    yield held
