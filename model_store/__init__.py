"""Versioned artefacts of the rover twin: trained models and the datasets they came from.

`ModelStore` is the way in. The package imports nothing else of the project; beside its modules it holds the models
and datasets that ship with it.
"""

from __future__ import annotations

from model_store.errors import (
    AliasNotFoundError,
    AlreadyExistsError,
    ArtefactTooLargeError,
    ConflictError,
    CorruptArtefactError,
    DatasetNameTakenError,
    DatasetNotFoundError,
    InvalidDraftError,
    InvalidReferenceError,
    ModelNotFoundError,
    NotFoundError,
    StoreError,
    StoreFullError,
    StoreUnavailableError,
    UnsupportedFormatError,
    VersionArchivedError,
    VersionDeletedError,
    VersionInUseError,
    VersionNotFoundError,
    VersionRetiredError,
)
from model_store.files import FileEntry
from model_store.layout import WEIGHTS
from model_store.manifest import Lineage, Manifest, ManifestDraft
from model_store.observing import observe_calls
from model_store.records import AliasRecord, DatasetDraft, DatasetRecord, LifecycleRecord
from model_store.references import DEFAULT_ALIAS, Reference, Resolved, parse_reference
from model_store.store import ModelStore

__all__ = [
    "DEFAULT_ALIAS",
    "WEIGHTS",
    "AliasNotFoundError",
    "AliasRecord",
    "AlreadyExistsError",
    "ArtefactTooLargeError",
    "ConflictError",
    "CorruptArtefactError",
    "DatasetDraft",
    "DatasetNameTakenError",
    "DatasetNotFoundError",
    "DatasetRecord",
    "FileEntry",
    "InvalidDraftError",
    "InvalidReferenceError",
    "LifecycleRecord",
    "Lineage",
    "Manifest",
    "ManifestDraft",
    "ModelNotFoundError",
    "ModelStore",
    "NotFoundError",
    "Reference",
    "Resolved",
    "StoreError",
    "StoreFullError",
    "StoreUnavailableError",
    "UnsupportedFormatError",
    "VersionArchivedError",
    "VersionDeletedError",
    "VersionInUseError",
    "VersionNotFoundError",
    "VersionRetiredError",
    "observe_calls",
    "parse_reference",
]
