"""What a file is, by its first bytes: names and content types are what senders say."""

from __future__ import annotations

from enum import StrEnum

from service.datasets.readers.foreign import format_of, is_tar


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


HEAD_BYTES = 520
_MAGIC: tuple[tuple[bytes, Kind], ...] = (
    (b"PK\x03\x04", Kind.ZIP),
    (b"PK\x05\x06", Kind.ZIP),
    (b"\x1f\x8b", Kind.GZIP),
    (b"BZh", Kind.BZIP2),
    (b"\xfd7zXZ\x00", Kind.XZ),
    (b"PAR1", Kind.PARQUET),
)


def kind_of(head: bytes) -> Kind:
    """The format of a file that starts with `head` (its first `HEAD_BYTES`)."""
    if not head:
        return Kind.EMPTY
    if format_of(head) is not None:
        return Kind.FOREIGN
    for magic, kind in _MAGIC:
        if head.startswith(magic):
            return kind
    return Kind.TAR if is_tar(head) else Kind.TEXT


def is_archive(head: bytes) -> bool:
    """Whether it is packed or an archive of any kind, other than plain gzip."""
    foreign = format_of(head)
    return foreign.is_packed if foreign else kind_of(head) in {Kind.ZIP, Kind.TAR, Kind.BZIP2, Kind.XZ}
