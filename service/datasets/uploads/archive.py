"""Unpacking a zip or tar that a stranger made: only plain files with plain names, and never more than allowed.

Nothing of the archive decides where or how a file is written but its checked name: no links, no owners, no modes.
One member that is not as it should be refuses the whole archive: honest programs do not write such.
"""

from __future__ import annotations

import stat
import struct
import tarfile
import unicodedata
import zipfile
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import IO, BinaryIO

from service.datasets.file_names import folded, is_of_desktop, name_fault, shown
from service.datasets.findings import MAX_LOCATED, Code, Finding, UnusableFileError, reject, warn
from service.datasets.readers.folder import of_desktop
from service.datasets.readers.sniff import HEAD_BYTES, Kind, is_archive
from service.datasets.uploads.unpacking import BROKEN, Meter, reraise_system_error
from service.datasets.uploads.upload_form import UploadLimits

_VOLUME_LABEL = b"V"  # tar -V
_UTF8 = 0x800  # bit 11 of a member's flags
_WINDOWS = {0, 6, 10, 11, 14}  # MS-DOS, OS/2, NTFS (APPNOTE and Info-ZIP differ), VFAT
_METHODS = {zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2}
_BROKEN = (*BROKEN, zipfile.BadZipFile, tarfile.TarError, NotImplementedError, RuntimeError, struct.error, LookupError)
_LONGEST_READ = 32 << 10
"""Long enough for headers with attributes, short enough for the patterns that tarfile searches in them."""


@dataclass(frozen=True, slots=True)
class _Member:
    """A member: `name` is how it is read, `written` what its archive says, `fault` why it must not be unpacked."""

    name: str
    written: str
    size: int
    is_folder: bool
    fault: tuple[Code, str] | None
    open: Callable[[], IO[bytes]]


def unpack_archive(
    source: Path, kind: Kind, target: Path, *, file: str, limits: UploadLimits, meter: Meter
) -> list[Finding]:
    """Write the plain files of the archive below `target`, an empty folder that exists, with names in composed letters
    (NFC) and / between folders. Returns what was left out or renamed.

    Raises UnusableFileError with the reasons, up to `MAX_LOCATED` of them; `target` may then hold some files.
    """
    try:
        with source.open("rb") as stream:
            members = _zip_members(stream, file, limits) if kind is Kind.ZIP else _tar_members(stream)
            noticed = _Unpacker(target, file, limits, meter).unpack(members)
            return [*noticed, *(_before_zip(stream, file) if kind is Kind.ZIP else _after_tar(stream, file))]
    except _BROKEN as error:
        reraise_system_error(error)
        message = f"broken {kind} archive ({shown(str(error)) or type(error).__name__}); pack and upload it again"
        raise UnusableFileError([reject(file, Code.BROKEN_ARCHIVE, message)]) from error


class _Unpacker:
    """Writes members one by one and remembers what was written."""

    def __init__(self, target: Path, file: str, limits: UploadLimits, meter: Meter) -> None:
        self._target, self._file, self._limits, self._meter = target, file, limits, meter
        self._files: set[str] = set()
        self._folders: set[str] = set()

    def unpack(self, members: Iterator[_Member]) -> list[Finding]:
        """Write them all. Returns what was left out or renamed."""
        faults: list[Finding] = []
        left_out: list[str] = []
        renamed: list[_Member] = []
        for count, member in enumerate(members, start=1):
            if count > self._limits.members:
                faults.append(_too_many(self._file, self._limits))
                break
            fault = self._fault(member)
            if fault is not None:
                faults.append(reject(self._file, fault[0], f"member {shown(member.name)!r} {fault[1]}"))
            elif is_of_desktop(member.name):
                left_out.append(shown(member.name))
            elif not faults and not member.is_folder:
                renamed += [member] if member.name != member.written else []
                self._write(member)
            if len(faults) >= MAX_LOCATED:
                break
        if faults:
            raise UnusableFileError(faults)
        return [*of_desktop(left_out, self._file), *_renamed(renamed, self._file)]

    def _fault(self, member: _Member) -> tuple[Code, str] | None:
        unsafe = name_fault(member.name, path_length=self._limits.path_length, depth=self._limits.depth)
        if unsafe is not None and not (member.is_folder and PurePosixPath(member.name) == PurePosixPath()):
            return Code.UNSAFE_PATH, unsafe
        return member.fault or (None if member.is_folder else self._clash(member.name))

    def _clash(self, name: str) -> tuple[Code, str] | None:
        """Two members of one name, or one that is a file here and a folder there."""
        path, above = folded(name), [folded(str(parent)) for parent in PurePosixPath(name).parents]
        if path in self._files or path in self._folders or not self._files.isdisjoint(above):
            return Code.DUPLICATE_NAME, "is there twice (upper and lower case are one)"
        self._files.add(path)
        self._folders.update(above)
        return None

    def _write(self, member: _Member) -> None:
        name = shown(member.name)
        self._meter.next_member()
        path = self._target.joinpath(*PurePosixPath(member.name).parts)
        path.parent.mkdir(parents=True, exist_ok=True)
        with member.open() as content, path.open("xb") as sink:
            head = content.read(HEAD_BYTES)
            if is_archive(head):
                message = "is itself an archive; put its files straight into the upload"
                raise UnusableFileError([reject(name, Code.NESTED_ARCHIVE, message)])
            while head:
                self._meter.count(len(head), name)
                sink.write(head)
                head = content.read(_LONGEST_READ)
        if path.stat().st_size != member.size:
            raise EOFError(f"member {name} has {path.stat().st_size} bytes, its header says {member.size}")


def _renamed(members: list[_Member], file: str) -> list[Finding]:
    listed = ", ".join(f"{each.written!a} as {each.name!a}" for each in members[:3])
    message = (
        f"{len(members)} names are written in another way (\\ between folders, another form or coding of letters): "
        f"read is {listed}"
    )
    return [warn(file, Code.RENAMED, message)] if members else []


def _too_many(file: str, limits: UploadLimits) -> Finding:
    return reject(file, Code.TOO_MANY_FILES, f"more than {limits.members} members, allowed are at most that")


def _zip_members(stream: BinaryIO, file: str, limits: UploadLimits) -> Iterator[_Member]:
    _bound_directory(stream, file, limits)
    with zipfile.ZipFile(stream) as archive:
        if len(archive.infolist()) > limits.members:
            raise UnusableFileError([_too_many(file, limits)])
        for info in archive.infolist():
            # `filename` is cut at a NUL, `orig_filename` is what the archive says
            name = _zip_name(info)
            is_folder = name.endswith("/")
            yield _Member(name, info.orig_filename, info.file_size, is_folder, _zip_fault(info), _opener(archive, info))


def _zip_name(info: zipfile.ZipInfo) -> str:
    r"""The name of a member in composed letters, with / between folders.

    Without bit 11 of its flags a name is in the code page of a PC, unless it is valid UTF-8 (as macOS, and zips made by
    Python 2, have it) or an extra field says it in UTF-8 (APPNOTE 4.6.9). What MS-DOS and Windows write may have \.
    """
    name = info.orig_filename
    if not info.flag_bits & _UTF8:
        raw = name.encode("cp437")
        name = _unicode_path(info.extra, raw) or _as_utf8(raw) or name
    if info.create_system in _WINDOWS:
        name = name.replace("\\", "/")
    return unicodedata.normalize("NFC", name)


def _as_utf8(raw: bytes) -> str | None:
    try:
        return raw.decode()
    except UnicodeDecodeError:
        return None


def _unicode_path(extra: bytes, raw: bytes) -> str | None:
    """The name in the extra field 0x7075, if it is about this very name."""
    while len(extra) >= 4:
        kind, size = struct.unpack_from("<HH", extra)
        if kind == 0x7075 and size > 5 and struct.unpack_from("<BI", extra, 4) == (1, zlib.crc32(raw)):
            return _as_utf8(extra[9 : 4 + size])
        extra = extra[4 + size :]
    return None


def _opener(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> Callable[[], IO[bytes]]:
    return lambda: archive.open(info)


def _zip_fault(info: zipfile.ZipInfo) -> tuple[Code, str] | None:
    if info.flag_bits & 0x1:
        return Code.ENCRYPTED, "is encrypted; pack it without a password"
    kind = stat.S_IFMT(info.external_attr >> 16)
    if kind == stat.S_IFLNK:
        return Code.LINK, "is a link; put the file itself into the archive"
    if kind not in {0, stat.S_IFREG, stat.S_IFDIR}:
        return Code.SPECIAL_FILE, "is no plain file"
    if info.compress_type not in _METHODS:
        return Code.UNSUPPORTED_FORMAT, f"is packed by method {info.compress_type}; pack it with deflate"
    return None


def _bound_directory(stream: BinaryIO, file: str, limits: UploadLimits) -> None:
    """Refuse a zip whose directory is larger than the allowed members need, before it is read into memory.

    The directory's end record is within the last 65,557 bytes; its 64-bit form, if any, is pointed to by the 20
    bytes before it (APPNOTE 4.3.14 to 4.3.16).
    """
    end = stream.seek(0, 2)
    start = max(0, end - 65_557)
    stream.seek(start)
    tail = stream.read(65_557)
    at = tail.rfind(b"PK\x05\x06")
    sizes = [0]
    if 0 <= at <= len(tail) - 22:
        sizes.append(struct.unpack_from("<I", tail, at + 12)[0])
        # 64-bit directory: its size is in the record that lies just before the locator, wherever that says
        if tail[max(0, at - 20) :][:4] == b"PK\x06\x07":
            stream.seek(struct.unpack_from("<Q", tail, at - 20 + 8)[0])
            records = (stream.read(56), tail[max(0, at - 76) : max(0, at - 20)])
            whole = (record for record in records if record[:4] == b"PK\x06\x06" and len(record) == 56)
            sizes += [struct.unpack_from("<Q", record, 40)[0] for record in whole]
            sizes[1] = 0 if sizes[1] == 0xFFFFFFFF else sizes[1]
    stream.seek(0)
    most = limits.members * (46 + limits.path_length + 128)
    if max(sizes) > most:
        message = f"its directory has {max(sizes)} bytes: more than {limits.members} members, allowed are at most that"
        raise UnusableFileError([reject(file, Code.TOO_MANY_FILES, message)])


class _ShortReads:
    """A file that is never read whole: headers of a tar say how many bytes to read, be it a gigabyte or minus one."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self.seek, self.tell, self.seekable = stream.seek, stream.tell, stream.seekable

    def read(self, size: int = -1) -> bytes:
        if not 0 <= size <= _LONGEST_READ:
            raise tarfile.ReadError(f"a header wants {size} bytes")
        return self._stream.read(size)


def _tar_members(stream: BinaryIO) -> Iterator[_Member]:
    with tarfile.TarFile(fileobj=_ShortReads(stream), mode="r", errorlevel=2) as archive:  # type: ignore[arg-type]
        position = -1
        while (info := archive.next()) is not None:
            if info.size < 0 or info.offset <= position:
                raise tarfile.ReadError("its members do not follow each other")
            position = info.offset
            if info.type == _VOLUME_LABEL:
                archive.members = []  # type: ignore[attr-defined]
                continue
            name = unicodedata.normalize("NFC", info.name)
            yield _Member(name, info.name, info.size, info.isdir(), _tar_fault(info), _extractor(archive, info))
            archive.members = []  # type: ignore[attr-defined]  # it would remember each one
        stream.seek(archive.offset)
        if stream.read(512).strip(b"\0"):
            # tarfile takes a broken header for the end
            raise tarfile.ReadError("a header in the middle of it is broken")


def _after_tar(stream: BinaryIO, file: str) -> list[Finding]:
    """A word about what follows the end of the archive; `stream` stands there."""
    while chunk := stream.read(_LONGEST_READ):
        if chunk.strip(b"\0"):
            return [_not_read(file, "follows the end of the archive")]
    return []


def _before_zip(stream: BinaryIO, file: str) -> list[Finding]:
    """A word about another archive above the one that the directory at the end is about."""
    with zipfile.ZipFile(stream) as archive:
        first = min((info.header_offset for info in archive.infolist()), default=0)
    return [_not_read(file, f"lies in the {first} bytes before the archive")] if first > 0 else []


def _not_read(file: str, what: str) -> Finding:
    message = f"not read is what {what}: are these several archives in one file? Upload each by itself"
    return warn(file, Code.UNLISTED_FILE, message)


def _extractor(archive: tarfile.TarFile, info: tarfile.TarInfo) -> Callable[[], IO[bytes]]:
    def opened() -> IO[bytes]:
        content = archive.extractfile(info)
        if content is None:
            raise tarfile.ReadError("no content")
        return content

    return opened


def _tar_fault(info: tarfile.TarInfo) -> tuple[Code, str] | None:
    if info.issym() or info.islnk():
        return Code.LINK, "is a link; put the file itself into the archive"
    if info.issparse():
        return Code.SPECIAL_FILE, "is a sparse file; pack it without --sparse (-S)"
    if not (info.isreg() or info.isdir()):
        return Code.SPECIAL_FILE, "is no plain file"
    return None
