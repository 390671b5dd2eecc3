"""One store copied to another: for backups, for restoring them, and to fill a bucket with the shipped models.

Nothing is ever overwritten. What names something is copied after it: files, then the documents that list them, then
other records of a model, then its aliases. So the copy can be read at any moment, also while it is made and where it
was broken off. It is looked for in the other order, so that a source which is written to meanwhile gives a whole copy
of what was there at the beginning. Work files of jobs stay behind: a job without them fits again, to the same weights.
"""

from __future__ import annotations

from model_store import layout
from model_store.backend import Backend
from model_store.files import MAX_FILE_BYTES

_ROOTS = (layout.DATASETS_ROOT, layout.MODELS_ROOT)


def copy(source: Backend, target: Backend) -> tuple[int, int]:
    """Copy what the target lacks; how many objects were copied, and how many were there.

    Raises StoreUnavailableError; then a second call goes on.
    """
    last_first = [[key for root in _ROOTS for key in _found(source, root, rank)] for rank in (3, 2, 1, 0)]
    copied = present = 0
    for key in (key for keys in reversed(last_first) for key in keys):
        data = None if target.exists(key) else source.read(key, limit_bytes=MAX_FILE_BYTES)
        if data is not None and target.create(key, data):
            copied += 1
        else:
            present += 1
    return copied, present


def _found(backend: Backend, root: str, rank: int) -> list[str]:
    return sorted(f"{root}/{key}" for key in backend.keys(root) if _rank(root, key) == rank)


def _rank(root: str, key: str) -> int:
    """0 for a file, 1 for a document that lists files, 3 for a record of an alias, 2 for all else of a model."""
    parts = key.split("/")
    if root == layout.MODELS_ROOT and parts[1:2] != ["versions"]:
        return 3 if parts[1:2] == ["aliases"] else 2
    return int(parts[-1] in (layout.MANIFEST, layout.DATASET))
