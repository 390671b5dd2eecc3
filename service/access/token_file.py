"""The file of tokens: one on a line, `NAME SCOPE sha256:DIGEST`. Empty lines and those that begin with # do not count.

Strict: a file with one line that is not understood is refused as a whole, for a typing error must neither let somebody
in nor lock somebody out. No message shows a digest.
"""

from __future__ import annotations

import fcntl
import os
import re
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from service.errors import RoverTwinError

MOST_BYTES = 256 << 10
MOST_TOKENS = 1000
NAME_ALLOWED = "1 to 63 of A-Z a-z 0-9 . _ @ + -, starting with a letter or digit; `admin` is taken"
NAME_PATTERN = "^[A-Za-z0-9][A-Za-z0-9._@+-]{0,62}$"
_NAME = re.compile(NAME_PATTERN)
_DIGEST = re.compile(r"sha256:([0-9a-f]{64})")
_SCOPES = ("read", "admin")
_RESERVED = "admin"  # the token of the environment
_FOR_OWNER = 0o600
_ACCESS_LIST = "system.posix_acl_access"
# what is no file must be found out without waiting for whoever writes into it
_READING = os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC | os.O_NOCTTY


class TokenFileError(RoverTwinError, ValueError):
    """A tokens file, or a token for it, cannot be used; the message says which line and why, and shows no digest."""


@dataclass(frozen=True, slots=True)
class StoredToken:
    """One line."""

    name: str
    scope: str
    digest: bytes


def parse(content: bytes) -> list[StoredToken]:
    """The tokens of a file. Raises TokenFileError."""
    if len(content) > MOST_BYTES:
        raise TokenFileError(f"the tokens file has more than {MOST_BYTES} bytes")
    try:
        text = content.decode("ascii")
    except UnicodeDecodeError as error:
        place = content.count(b"\n", 0, error.start) + 1
        raise TokenFileError(f"line {place} of the tokens file has a byte that is not ASCII") from None
    found: dict[str, StoredToken] = {}
    digests: dict[bytes, str] = {}
    for number, line in enumerate(text.split("\n"), 1):
        if not line.strip() or line.startswith("#"):
            continue
        where = f"line {number} of the tokens file"
        token = _token_of(line.removesuffix("\r"), where)
        if token.name in found:
            raise TokenFileError(f"{where} has the name {token.name!r} a second time")
        if token.digest in digests:
            raise TokenFileError(f"{where} has the token of {digests[token.digest]!r} under another name")
        found[token.name], digests[token.digest] = token, token.name
    if len(found) > MOST_TOKENS:
        raise TokenFileError(f"the tokens file has more than {MOST_TOKENS} tokens")
    return list(found.values())


def require_name(name: str) -> None:
    """Raises TokenFileError for a name that no token can have."""
    if not _NAME.fullmatch(name) or name == _RESERVED:
        raise TokenFileError(f"the name is {name[:100]!r}, allowed is {NAME_ALLOWED}")


def _token_of(line: str, place: str) -> StoredToken:
    fields = line.split(" ")
    if len(fields) != 3:
        raise TokenFileError(f"{place} has {len(fields)} fields between single spaces, not NAME SCOPE sha256:DIGEST")
    name, scope, kept = fields
    if not _NAME.fullmatch(name) or name == _RESERVED:
        raise TokenFileError(f"{place} has a name that is not allowed; allowed is {NAME_ALLOWED}")
    if scope not in _SCOPES:
        raise TokenFileError(f"{place} has a scope that is not allowed; allowed is {' or '.join(_SCOPES)}")
    digest = _DIGEST.fullmatch(kept)
    if digest is None:
        raise TokenFileError(f"{place} does not end in sha256: and 64 digits 0-9 a-f; `tokens create` makes such lines")
    return StoredToken(name, scope, bytes.fromhex(digest[1]))


def stored(path: Path) -> list[StoredToken]:
    """The tokens of the file at `path`, none if there is no file. Raises TokenFileError."""
    return parse(_content(path))


def add(path: Path, token: StoredToken) -> None:
    """Append a token; the file is replaced as a whole. Raises TokenFileError when there is one of that name."""
    require_name(token.name)
    with _alone(path) as real:
        content = _content(real)
        if any(each.name == token.name for each in parse(content)):
            raise TokenFileError(f"there is a token named {token.name!r} already; revoke it first")
        ended = content if not content or content.endswith(b"\n") else content + b"\n"
        whole = ended + f"{token.name} {token.scope} sha256:{token.digest.hex()}\n".encode()
        parse(whole)  # what would not be read again is not written
        _replace(real, whole)


def remove(path: Path, name: str) -> bool:
    """Take a token out; all other lines, comments too, stay as they are. False when there is none of that name."""
    with _alone(path) as real:
        content = _content(real)
        if not any(each.name == name for each in parse(content)):
            return False
        start = f"{name} ".encode()
        _replace(real, b"".join(line for line in content.splitlines(keepends=True) if not line.startswith(start)))
        return True


@contextmanager
def _alone(path: Path) -> Iterator[Path]:
    """No two commands change the file at once. Gives the file itself where `path` is a link."""
    real = Path(os.path.realpath(path))
    try:
        folder = os.open(real.parent, os.O_RDONLY)
    except OSError as error:
        raise TokenFileError(f"the folder of the tokens file cannot be opened: {error.strerror}") from error
    try:
        fcntl.flock(folder, fcntl.LOCK_EX)
        yield real
    finally:
        os.close(folder)


def _content(path: Path) -> bytes:
    try:
        return content_of(path)[0]
    except FileNotFoundError:
        return b""
    except OSError as error:
        raise TokenFileError(f"the tokens file cannot be read: {error.strerror}") from error


def content_of(path: Path) -> tuple[bytes, os.stat_result]:
    """At most a byte more than there may be, and the status of just that file.

    Raises OSError, and TokenFileError for what is no regular file: a pipe would be waited for without end.
    """
    with open(os.open(path, _READING), "rb") as file:  # noqa: PTH123 - which Path cannot do
        status = os.fstat(file.fileno())
        if not stat.S_ISREG(status.st_mode):
            raise TokenFileError("the tokens file cannot be read: it is no regular file")
        return file.read(MOST_BYTES + 1), status


def _replace(path: Path, content: bytes) -> None:
    """Whoever reads the file sees the old one or the new one, also after a power cut.

    The new one belongs to whom the old one did, or the service could not read it any more. Where that cannot be,
    nothing is changed.
    """
    try:
        old = path.stat() if path.exists() else None
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}-")
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(content)
                file.flush()
                _make_as(file.fileno(), path, old)
                os.fsync(file.fileno())
            Path(name).replace(path)
        except BaseException:
            with suppress(OSError):
                Path(name).unlink()
            raise
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)
    except OSError as error:
        raise TokenFileError(f"the tokens file cannot be written: {error.strerror}") from error


def _make_as(handle: int, path: Path, old: os.stat_result | None) -> None:
    """Give an open file the owner, the mode and the access list of the one at `path`. Raises TokenFileError."""
    if old is None:
        os.fchmod(handle, _FOR_OWNER)
        return
    new = os.fstat(handle)
    try:
        if (new.st_uid, new.st_gid) != (old.st_uid, old.st_gid):
            os.fchown(handle, old.st_uid, old.st_gid)
        os.fchmod(handle, old.st_mode & 0o777)
        if hasattr(os, "listxattr") and _ACCESS_LIST in os.listxattr(path):
            os.setxattr(handle, _ACCESS_LIST, os.getxattr(path, _ACCESS_LIST))
    except OSError as error:
        raise TokenFileError(
            f"the tokens file was not changed: it belongs to user {old.st_uid} and group {old.st_gid}, and a new one "
            f"cannot be made so ({error.strerror}); do this as that user or as root"
        ) from error
