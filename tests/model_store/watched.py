"""A store that tells what was read of it: the real backend, with a list of the keys it was asked for."""

from __future__ import annotations

import os
from collections.abc import Iterator

from model_store import ModelStore
from model_store.backend import Backend


class Watched(Backend):
    def __init__(self, *parts) -> None:
        super().__init__(*parts)
        self.read_keys: list[str] = []

    def read(self, key: str, *, limit_bytes: int) -> bytes | None:
        self.read_keys.append(key)
        return super().read(key, limit_bytes=limit_bytes)

    def chunks(self, key: str) -> Iterator[bytes] | None:
        self.read_keys.append(key)
        return super().chunks(key)


def watched(folder: str | os.PathLike[str]) -> tuple[ModelStore, list[str]]:
    """The store in a folder, and the keys that were read of it so far."""
    backend = Watched.open(folder)
    return ModelStore(backend), backend.read_keys
