"""A file that appears whole or not at all."""

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
    """Takes pieces of a body; at the end, when they have the digest of `headers`, they take the place of `path`.

    Raises UnexpectedAnswerError when the digest is another one; then, as after any other failure, nothing is left.
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
        raise UnexpectedAnswerError(f"what came for {path} has the digest {digest}, the service told {told[1]}")
