"""What can go wrong in the store, one class per answer a caller gives.

StoreError
├── NotFoundError (also LookupError)
│   ├── ModelNotFoundError
│   ├── VersionNotFoundError
│   ├── AliasNotFoundError
│   └── DatasetNotFoundError
├── CorruptArtefactError
│   └── ArtefactTooLargeError
├── UnsupportedFormatError
├── AlreadyExistsError
├── VersionRetiredError
│   ├── VersionArchivedError
│   └── VersionDeletedError
├── ConflictError
│   └── VersionInUseError
├── InvalidReferenceError (also ValueError)
├── InvalidDraftError (also ValueError)
└── StoreUnavailableError
    └── StoreFullError

Every message says what, where and what to do about it. "Where" is a path inside the store; only StoreUnavailableError,
which is for the operator, tells where the store is and what the backend said.
"""

from __future__ import annotations

from collections.abc import Sequence


class StoreError(Exception):
    """Anything the store refuses or cannot do."""


class NotFoundError(StoreError, LookupError):
    """The store works, and what was asked for is not in it."""


class ModelNotFoundError(NotFoundError):
    """No model of this name has a published version."""


class VersionNotFoundError(NotFoundError):
    """The model has no published version of this number."""


class AliasNotFoundError(NotFoundError):
    """The model has no alias of this name."""


class DatasetNotFoundError(NotFoundError):
    """No published dataset has this id, prefix of an id, or name."""


class CorruptArtefactError(StoreError):
    """Stored bytes are not what was published: missing, truncated, altered or unreadable."""


class ArtefactTooLargeError(CorruptArtefactError):
    """A stored object is larger than the reader agreed to read."""


class UnsupportedFormatError(StoreError):
    """A document was written by a newer major format than this reader knows."""


class AlreadyExistsError(StoreError):
    """Something else is already published under this identity; nothing is ever overwritten."""


class ConflictError(StoreError):
    """Somebody else changed the same thing first; look again, then decide again."""


class DatasetNameTakenError(ConflictError):
    """Another dataset is found by this name; with both, neither would be."""


class VersionInUseError(ConflictError):
    """A version cannot be archived or deleted: `aliases` name it, or it is what a service answers with by default."""

    def __init__(self, name: str, version: int, aliases: Sequence[str]) -> None:
        self.aliases = list(aliases)
        named = ", ".join(self.aliases) or "the setting of the default model"
        super().__init__(f"{name}@{version} is named by {named}: point that elsewhere first")


class VersionRetiredError(StoreError):
    """The version is published, and is not to be used any more."""


class VersionArchivedError(VersionRetiredError):
    """Somebody archived the version; it can be restored."""


class VersionDeletedError(VersionRetiredError):
    """Somebody deleted the version: its manifest stays, its weights are gone."""


class InvalidReferenceError(StoreError, ValueError):
    """A name, alias, version, file name, id or reference is malformed or ambiguous."""


class InvalidDraftError(StoreError, ValueError):
    """What was offered for publishing is incomplete or out of bounds; nothing was written."""


class StoreUnavailableError(StoreError):
    """The backend fails: not there, not permitted, not answering."""


class StoreFullError(StoreUnavailableError):
    """There is no room left for what was to be written; nothing half-written is ever shown."""
