"""Takes an upload off the wire, a multipart form or a raw body, into a file. Nothing large is ever held in memory."""

from __future__ import annotations

import fcntl
import os
import shutil
import tempfile
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import anyio
import anyio.to_thread
from fastapi import Request
from python_multipart.exceptions import FormParserError
from python_multipart.multipart import MultipartParser, parse_options_header

from service.api.http.exceptions import MalformedUploadError, UploadStalledError
from service.api.http.limits.worker_threads import ClientGoneError, OverloadedError
from service.datasets.file_names import printable
from service.errors import NO_ROOM, StorageFullError
from service.wire.faults import InvalidInputError, fault

FILE_PART = "file"
MOST_FIELDS = 20
MAX_FIELD_BYTES = 1 << 20  # a passport is the largest of them
MAX_NAME_CHARACTERS = 200
IDLE_S = 30.0
_CHUNK_BYTES = 1 << 20
_FOLDER_PREFIX = "rover-twin-upload-"
_UNNAMED = "upload"
_TRIES = 5  # whoever removes what is forgotten may find a folder before it is locked


@dataclass(frozen=True, slots=True)
class Upload:
    """What came: a file in our own folder, what its sender called it, and the form's fields in their order."""

    path: Path
    filename: str
    fields: tuple[tuple[str, str], ...]


@contextmanager
def upload_folder(places: anyio.CapacityLimiter) -> Iterator[Path]:
    """A folder for one upload, gone afterwards, whatever happens. Raises OverloadedError when there are enough."""
    place = object()
    try:
        places.acquire_on_behalf_of_nowait(place)
    except anyio.WouldBlock:
        raise OverloadedError(
            f"{round(places.total_tokens)} uploads are in work already, no more are taken at once"
        ) from None
    try:
        with _locked_folder() as folder:
            yield folder
    finally:
        places.release_on_behalf_of(place)


@contextmanager
def _locked_folder() -> Iterator[Path]:
    """A temporary folder that is locked: the system drops the lock when this process dies, however that happens."""
    with ExitStack() as opened:
        for _ in range(_TRIES):
            made = tempfile.TemporaryDirectory(prefix=_FOLDER_PREFIX, ignore_cleanup_errors=True)
            folder = Path(opened.enter_context(made))
            if (lock := _lock(folder)) is not None:
                opened.callback(os.close, lock)
                break
        # where nothing can be locked, nobody finds it forgotten either
        yield folder


def remove_forgotten_uploads() -> None:
    """Remove what processes that were killed during an upload left behind: folders of ours that nobody locks."""
    for folder in Path(tempfile.gettempdir()).glob(f"{_FOLDER_PREFIX}*"):
        lock = _lock(folder)
        if lock is not None:
            shutil.rmtree(folder, ignore_errors=True)
            os.close(lock)


def _lock(folder: Path) -> int | None:
    """The lock of a folder that is there; None when it is another's, gone, or no folder."""
    try:
        opened = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
    except OSError:
        return None
    try:
        fcntl.flock(opened, fcntl.LOCK_EX | fcntl.LOCK_NB)
        # it may have been removed between the two, by somebody who found it without a lock
        if folder.is_dir():
            return opened
    except OSError:
        pass
    os.close(opened)
    return None


async def receive_upload(request: Request, folder: Path, filename: str | None) -> Upload:
    """Write the upload to `folder`. `filename` is the name of a raw body; a form's part says its own.

    Raises ClientGoneError, MalformedUploadError (no multipart, or it ends early), UploadStalledError (nothing came for
    `IDLE_S`),
    InvalidInputError (no file, two files, a field that is no text or too long), BodyTooLargeError and StorageFullError.
    """
    kind, options = parse_options_header(request.headers.get("content-type", ""))
    path = folder / "body"
    with _room_for(path), path.open("wb") as sink:
        if kind != b"multipart/form-data":
            await _write_raw(request, sink)
            return Upload(path, base_name(filename or _UNNAMED), ())
        form = _Form(options.get(b"boundary", b""))
        async for chunk in _chunks(request):
            form.feed(chunk)
            if len(form.pending) >= _CHUNK_BYTES:
                await _flush(form.pending, sink)
        await _flush(form.pending, sink)
    return Upload(path, form.finished(), tuple(form.fields))


@contextmanager
def _room_for(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        if error.errno not in NO_ROOM:
            raise
        raise StorageFullError(f"the upload cannot be written to {path.parent.parent}: {error.strerror}") from error


def base_name(filename: str) -> str:
    """The last part of a path in either style, in one printable line; it never becomes a path of ours."""
    name = printable(filename.replace("\\", "/").rpartition("/")[2].strip())
    return name[-MAX_NAME_CHARACTERS:] or _UNNAMED


async def _write_raw(request: Request, sink: BinaryIO) -> None:
    pending = bytearray()
    async for chunk in _chunks(request):
        pending += chunk
        if len(pending) >= _CHUNK_BYTES:
            await _flush(pending, sink)
    await _flush(pending, sink)


async def _flush(pending: bytearray, sink: BinaryIO) -> None:
    if pending:
        await anyio.to_thread.run_sync(sink.write, bytes(pending))
        pending.clear()


async def _chunks(request: Request) -> AsyncIterator[bytes]:
    """What `request.stream()` gives, but a sender that stops is not waited for."""
    while True:
        try:
            with anyio.fail_after(IDLE_S):
                message = await request.receive()
        except TimeoutError:
            raise UploadStalledError(f"no byte of the body came for {IDLE_S:g} s; send it again") from None
        if message["type"] == "http.disconnect":
            raise ClientGoneError
        yield message.get("body", b"")
        if not message.get("more_body"):
            return


class _Form:
    """Takes a multipart body apart, piece by piece: the bytes of `file` to `pending`, small fields to `fields`."""

    def __init__(self, boundary: bytes) -> None:
        if not boundary:
            raise MalformedUploadError("Content-Type says multipart/form-data without a boundary")
        self.pending = bytearray()
        self.fields: list[tuple[str, str]] = []
        self._filename: str | None = None
        self._disposition = bytearray()
        self._header = bytearray()
        self._name = ""
        self._value = bytearray()
        self._whole = False
        callbacks: dict[str, Callable[..., None]] = {
            "on_part_begin": self._begin_part,
            "on_header_field": self._header_name,
            "on_header_value": self._header_value,
            "on_header_end": self._header_end,
            "on_headers_finished": self._headers_finished,
            "on_part_data": self._part_data,
            "on_part_end": self._end_part,
            "on_end": self._end,
        }
        try:
            self._parser = MultipartParser(boundary, callbacks)  # type: ignore[arg-type] # a TypedDict of these
        except FormParserError as error:
            raise MalformedUploadError(f"the multipart body cannot be read: {error}") from error

    def feed(self, chunk: bytes) -> None:
        """Take the next bytes. Raises MalformedUploadError and InvalidInputError."""
        try:
            self._parser.write(chunk)
        except FormParserError as error:
            raise MalformedUploadError(f"the multipart body cannot be read: {error}") from error

    def finished(self) -> str:
        """The file's name. Raises MalformedUploadError before the last boundary, InvalidInputError without a file."""
        if not self._whole:
            raise MalformedUploadError("the multipart body ends before its last boundary")
        if self._filename is None:
            raise InvalidInputError(fault(FILE_PART, None, "one part of this name with the dataset"))
        return self._filename

    def _begin_part(self) -> None:
        self._disposition.clear()
        self._header.clear()
        self._value.clear()

    def _header_name(self, data: bytes, start: int, end: int) -> None:
        self._header += data[start:end].lower()

    def _header_value(self, data: bytes, start: int, end: int) -> None:
        if self._header == b"content-disposition":
            self._disposition += data[start:end]

    def _header_end(self) -> None:
        self._header.clear()

    def _headers_finished(self) -> None:
        _, options = parse_options_header(bytes(self._disposition))
        if b"name" not in options:
            raise MalformedUploadError("a part of the multipart body has no name")
        self._name = _text("a part's name", options[b"name"])
        if self._name == FILE_PART:
            if self._filename is not None:
                raise InvalidInputError(fault(FILE_PART, "two parts", "one part; several files go into one archive"))
            self._filename = base_name(options.get(b"filename", b"").decode("utf-8", "replace"))
        elif len(self.fields) >= MOST_FIELDS:
            raise MalformedUploadError(f"the form has more than {MOST_FIELDS} fields, which is the limit")

    def _part_data(self, data: bytes, start: int, end: int) -> None:
        if self._name == FILE_PART:
            self.pending += data[start:end]
        elif len(self._value) + end - start > MAX_FIELD_BYTES:
            allowed = f"at most {MAX_FIELD_BYTES} bytes"
            raise InvalidInputError(fault(self._name, f"more than {MAX_FIELD_BYTES} bytes", allowed))
        else:
            self._value += data[start:end]

    def _end_part(self) -> None:
        if self._name != FILE_PART:
            self.fields.append((self._name, _text(self._name, bytes(self._value))))

    def _end(self) -> None:
        self._whole = True


def _text(what: str, data: bytes) -> str:
    try:
        return data.decode()
    except UnicodeDecodeError:
        raise InvalidInputError(fault(what, repr(data[:50]), "text in UTF-8")) from None
