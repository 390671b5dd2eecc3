"""Writes a file completely or not at all."""

from __future__ import annotations

import hashlib
import re
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from rover_twin_client.errors import UnexpectedAnswerError

_DIGEST = re.compile(r'"([0-9a-f]{64})"')


@contextmanager
def whole_file(path: Path, headers: Mapping[str, str]) -> Iterator[Callable[[bytes], None]]:
    """Gives a function that takes the pieces of a body. At the end the body becomes the file `path`.

    Raises UnexpectedAnswerError when the body does not have the digest in `headers`. After a failure of any kind an
    older file at `path` is unchanged, and nothing else is left.
    """
    digest = hashlib.sha256()
    with tempfile.NamedTemporaryFile(dir=path.parent, prefix=f".{path.name}.", delete=False) as part:

        def take(piece: bytes) -> None:
            part.write(piece)
            digest.update(piece)

        try:
            yield take
            part.close()
            _require(digest.hexdigest(), headers, path)
            Path(part.name).chmod(0o644)
            Path(part.name).replace(path)
        except BaseException:
            part.close()
            Path(part.name).unlink(missing_ok=True)
            raise


def _require(digest: str, headers: Mapping[str, str], path: Path) -> None:
    told = _DIGEST.fullmatch(headers.get("etag", ""))
    if told and told[1] != digest:
        raise UnexpectedAnswerError(f"the download of {path} is damaged: its SHA-256 digest is {digest}, not {told[1]}")
