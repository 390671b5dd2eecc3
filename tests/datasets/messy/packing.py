"""The ways in which files are packed: streams, zips of several systems, flavours of tar."""

from __future__ import annotations

import bz2
import gzip
import io
import lzma
import tarfile
import zipfile

_STREAMS = {
    "none": lambda data: data,
    "gz": lambda data: gzip.compress(data, mtime=0),
    "gz of two members": lambda data: gzip.compress(data[:700], mtime=0) + gzip.compress(data[700:], mtime=0),
    "bz2": bz2.compress,
    "xz": lzma.compress,
}
_DATE = (2026, 11, 28, 9, 0, 0)


def packed_file(data, wrap):
    """One file, perhaps as a packed stream."""
    return _STREAMS[wrap](data)


def packed_files(members, wrap):
    """Several files, {name: bytes}, as an archive."""
    return _zip(members, wrap) if wrap.startswith("zip") else _tar(members, wrap)


def _zip(members, wrap):
    system, names = (0 if wrap == "zip by DOS" else 3), dict(members)
    if wrap == "zip, with a folder":
        names = {"my runs/": b"", **{f"my runs/{name}": data for name, data in members.items()}}
    elif wrap == "zip by DOS":
        names = {f"runs\\{name}": data for name, data in members.items()}
    elif wrap == "zip by macOS":
        names |= {"__MACOSX/": b"", **{f"__MACOSX/._{name}": b"\0\5\x16\7" for name in members}, ".DS_Store": b"\0"}
    elif wrap == "zip in a zip":
        names = {"inner.zip": _zip(members, "zip")}
    elif wrap == "zip, members gz":
        names = {name: gzip.compress(data, mtime=0) if name.endswith(".gz") else data for name, data in members.items()}
    sink = io.BytesIO()
    with zipfile.ZipFile(sink, "w") as archive:
        for at, (name, data) in enumerate(names.items()):
            info = zipfile.ZipInfo(f"{at}" * len(name) if "\\" in name else name, _DATE)
            info.create_system = system
            info.compress_type = zipfile.ZIP_STORED if wrap == "zip, stored" else zipfile.ZIP_DEFLATED
            archive.writestr(info, data)
    content = sink.getvalue()
    for at, name in enumerate(names):
        # Python's own writer would make / of \
        content = content.replace(f"{at}".encode() * len(name), name.encode()) if "\\" in name else content
    return _encrypted(content) if wrap == "zip, encrypted" else content


def _encrypted(content):
    """The flag of encryption set in each header; nobody gets as far as the bytes."""
    data = bytearray(content)
    for magic, at in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        found = data.find(magic)
        while found >= 0:
            data[found + at] |= 1
            found = data.find(magic, found + 4)
    return bytes(data)


def _tar(members, wrap):
    sink = io.BytesIO()
    flavour = {"tar, pax": tarfile.PAX_FORMAT, "tar, gnu": tarfile.GNU_FORMAT}.get(wrap, tarfile.USTAR_FORMAT)
    mode = {"tar.gz": "w:gz", "tar.bz2": "w:bz2", "tar.xz": "w:xz"}.get(wrap, "w")
    front = {"tar, ./ in front": "./", "tar, with folders": "my/runs/"}.get(wrap, "")
    with tarfile.open(fileobj=sink, mode=mode, format=flavour) as archive:
        for folder in {"tar, ./ in front": ["."], "tar, with folders": ["my", "my/runs"]}.get(wrap, []):
            info = tarfile.TarInfo(folder)
            info.type, info.mode = tarfile.DIRTYPE, 0o755
            archive.addfile(info)
        for name, data in members.items():
            info = tarfile.TarInfo(front + name)
            info.size, info.mtime = len(data), 1_795_856_400.5 if wrap == "tar, pax" else 1_795_856_400
            archive.addfile(info, io.BytesIO(data))
        if wrap == "tar, with a link":
            info = tarfile.TarInfo("latest.csv")
            info.type, info.linkname = tarfile.SYMTYPE, next(iter(members))
            archive.addfile(info)
    return sink.getvalue()
