"""What a file is, by its first bytes: names and content types are what senders say."""

from __future__ import annotations

from enum import StrEnum


class Kind(StrEnum):
    """Formats that are told apart. TEXT is whatever is none of the others."""

    ZIP = "zip"
    TAR = "tar"
    GZIP = "gzip"
    BZIP2 = "bzip2"
    XZ = "xz"
    PARQUET = "Parquet"
    FOREIGN = "another format"
    TEXT = "text"
    EMPTY = "empty"

    @property
    def is_compressed(self) -> bool:
        """Whether it is one stream, packed."""
        return self in {Kind.GZIP, Kind.BZIP2, Kind.XZ}


HEAD_BYTES = 512
_TAR_MAGIC_AT, _TAR_MAGIC = 257, b"ustar"
_MAGIC: tuple[tuple[bytes, Kind], ...] = (
    (b"PK\x03\x04", Kind.ZIP),
    (b"PK\x05\x06", Kind.ZIP),
    (b"\x1f\x8b", Kind.GZIP),
    (b"BZh", Kind.BZIP2),
    (b"\xfd7zXZ\x00", Kind.XZ),
    (b"PAR1", Kind.PARQUET),
)
_FOREIGN: tuple[tuple[bytes, str], ...] = (
    (b"\x89HDF\r\n\x1a\n", "HDF5"),
    (b"7z\xbc\xaf\x27\x1c", "7-Zip"),
    (b"Rar!\x1a\x07", "RAR"),
    (b"\x28\xb5\x2f\xfd", "Zstandard"),
    (b"\x04\x22\x4d\x18", "LZ4"),
    (b"LZIP", "lzip"),
    (b"\x1f\x9d", "compress (.Z)"),
    (b"PK\x07\x08", "a zip in several parts"),
    (b"ARROW1", "Arrow"),
    (b"SQLite format 3\x00", "SQLite"),
    (b"\x93NUMPY", "NumPy"),
    (b"%PDF", "PDF"),
    (b"\x89PNG", "PNG"),
    (b"\x7fELF", "an ELF program"),
    (b"\x80\x04\x95", "pickle"),
    (b"\x80\x05\x95", "pickle"),
)


def kind_of(head: bytes) -> Kind:
    """The format of a file that starts with `head` (its first `HEAD_BYTES`)."""
    if not head:
        return Kind.EMPTY
    for magic, kind in _MAGIC:
        if head.startswith(magic):
            return kind
    if head[_TAR_MAGIC_AT:].startswith(_TAR_MAGIC):
        return Kind.TAR
    return Kind.FOREIGN if foreign_name(head) else Kind.TEXT


def foreign_name(head: bytes) -> str | None:
    """The name of a known format that cannot be read here."""
    return next((name for magic, name in _FOREIGN if head.startswith(magic)), None)


def is_archive(head: bytes) -> bool:
    """Whether it is packed or an archive of any kind, other than plain gzip."""
    kind = kind_of(head)
    if kind in {Kind.ZIP, Kind.TAR, Kind.BZIP2, Kind.XZ}:
        return True
    return foreign_name(head) in {"7-Zip", "RAR", "Zstandard", "LZ4", "lzip", "compress (.Z)", "a zip in several parts"}
