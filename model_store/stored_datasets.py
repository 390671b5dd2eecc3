"""Datasets: named by the digest of their content, so publishing twice is publishing once."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime

from pydantic import ValidationError

from model_store import layout
from model_store.backend import Backend
from model_store.documents import read_document, render
from model_store.errors import (
    AlreadyExistsError,
    ConflictError,
    CorruptArtefactError,
    DatasetNameTakenError,
    DatasetNotFoundError,
    InvalidDraftError,
    InvalidReferenceError,
    NotFoundError,
    UnsupportedFormatError,
)
from model_store.files import MAX_FILE_BYTES, FileEntry, digest_files, read_verified, stream_verified
from model_store.records import DatasetDraft, DatasetName, DatasetRecord

MOST_NAMES = 64

_PREFIX = re.compile(r"[0-9a-f]{6,63}")


class Datasets:
    """The part of the store under `datasets`. `ModelStore` documents each method."""

    def __init__(self, backend: Backend) -> None:
        self._backend = backend

    def ids(self) -> list[str]:
        """Sorted ids of the published datasets."""
        published = (key.split("/") for key in self._backend.keys(layout.DATASETS_ROOT))
        return sorted(
            parts[0] for parts in published if parts[1:] == [layout.DATASET] and layout.is_dataset_id(parts[0])
        )

    def put(self, dataset_id: str, files: Mapping[str, bytes], draft: DatasetDraft) -> tuple[DatasetRecord, bool]:
        """Write the files, then the record; take up where a killed writer of the same dataset stopped.

        Also says whether the record is this call's.
        """
        prefix = layout.dataset_prefix(dataset_id)
        for file in files:
            layout.check_dataset_file(file)
        entries = digest_files(files)
        record = _complete(dataset_id, entries, draft)
        data = render(record)
        if (published := self._find(dataset_id)) is not None:
            return _same(published, entries), False
        for file in sorted(files):
            self._create_or_match(f"{prefix}/{file}", files[file], entries[file])
        created = self._backend.create_or_confirm(_record_key(dataset_id), data)
        for file in sorted(files):
            # a deletion that had begun before may have taken a file that was found to match
            if not self._backend.exists(f"{prefix}/{file}"):
                self._create_or_match(f"{prefix}/{file}", files[file], entries[file])
        return (record, True) if created else (_same(self._read(dataset_id), entries), False)

    def add_name(self, dataset_id: str, name: str, *, created_by: str) -> bool:
        """Give the dataset this name too; False when it has it."""
        place = layout.dataset_name(dataset_id, name)
        known = self.names(self._read(dataset_id))
        if name in known:
            return False
        if len(known) >= MOST_NAMES:
            raise ConflictError(f"dataset {dataset_id} has {MOST_NAMES} names, which is all it may: use one of them")
        try:
            document = DatasetName(name=name, created_at=datetime.now(UTC), created_by=created_by)
        except ValidationError as error:
            raise InvalidDraftError(f"name of a dataset: {error.errors(include_url=False)[0]['msg']}") from error
        return self._backend.create_or_confirm(place, render(document))

    def remove_name(self, dataset_id: str, name: str) -> None:
        """Take a name from the dataset again. The one that it was put with stays as long as the dataset."""
        place, record = layout.dataset_name(dataset_id, name), self._read(dataset_id)
        if name == record.name:
            raise ConflictError(
                f"dataset {dataset_id} was stored as {name!r}, which stays: delete the dataset, or use whole ids"
            )
        if name not in self.names(record):
            raise DatasetNotFoundError(
                f"dataset {dataset_id} has no name {name!r}; it has {', '.join(self.names(record))}"
            )
        self._backend.remove(place)

    def require_name(self, dataset_id: str, name: str) -> None:
        """Raises DatasetNameTakenError where anything but this dataset is found by the name (or start of an id)."""
        try:
            found = self.get(name)
        except DatasetNotFoundError:
            return
        except InvalidReferenceError as error:
            known = self._find(dataset_id)
            if known is None or name not in self.names(known):
                raise DatasetNameTakenError(f"the name cannot be given once more: {error}") from error
            return
        if found.id != dataset_id:
            raise DatasetNameTakenError(
                f"the name {name!r} already finds dataset {found.id}, which is not this one ({dataset_id}): choose "
                "another name, or take that one from it"
            )

    def names(self, record: DatasetRecord) -> list[str]:
        """The name that it was put with first, then the others, sorted."""
        found = self._backend.keys(f"{layout.dataset_prefix(record.id)}/{layout.NAMES}")
        return [record.name, *sorted({name for name in found if layout.is_dataset_name(name)} - {record.name})]

    def other_names(self) -> dict[str, list[str]]:
        """The names of all datasets, but the first of each; one listing."""
        others: dict[str, list[str]] = {}
        for key in sorted(self._backend.keys(layout.DATASETS_ROOT)):
            identity, _, name = key.partition(f"/{layout.NAMES}/")
            if layout.is_dataset_id(identity) and layout.is_dataset_name(name):
                others.setdefault(identity, []).append(name)
        return others

    def delete(self, dataset_id: str) -> None:
        """Remove the record, then the files; stop when somebody puts the dataset anew meanwhile."""
        prefix, record_key = layout.dataset_prefix(dataset_id), _record_key(dataset_id)
        there = self._backend.keys(prefix)
        if not there:
            raise DatasetNotFoundError(f"no dataset {dataset_id}; list the ids there are")
        self._backend.remove(record_key)
        for file in sorted(set(there) - {layout.DATASET}):
            key = f"{prefix}/{file}"
            content = self._backend.read(key, limit_bytes=MAX_FILE_BYTES)
            if self._backend.exists(record_key):
                return
            self._backend.remove(key)
            if self._backend.exists(record_key) and content is not None:
                # put anew in this very moment, and its files were found in place
                self._backend.create(key, content)
                return

    def get(self, reference: str) -> DatasetRecord:
        """Find a dataset by id, by a unique start of an id, or by its name."""
        if layout.is_dataset_id(reference):
            return self._read(reference)
        by_id = [one for one in self.ids() if _PREFIX.fullmatch(reference) and one.startswith(reference)]
        named, unreadable = self._named(reference)
        matches = sorted({*by_id, *named})
        if len(matches) > 1:
            raise InvalidReferenceError(f"dataset {reference!r} is ambiguous: {', '.join(matches)}; give the whole id")
        if not matches:
            skipped = f"; unreadable and skipped: {', '.join(unreadable)}" if unreadable else ""
            raise DatasetNotFoundError(
                f"no dataset {reference[:100]!r}; give an id, at least its first 6 digits, or a name{skipped}"
            )
        return self._read(matches[0])

    def read_file(self, dataset_id: str, file: str, limit_bytes: int = MAX_FILE_BYTES) -> bytes:
        """Read a file the record lists, verified."""
        entry = self._entry(dataset_id, file)
        key = f"{layout.dataset_prefix(dataset_id)}/{file}"
        return read_verified(self._backend, key, entry, limit_bytes=limit_bytes)

    def stream_file(self, dataset_id: str, file: str) -> tuple[FileEntry, Iterator[bytes]]:
        """A file the record lists: what it is, and its pieces."""
        entry = self._entry(dataset_id, file)
        return entry, stream_verified(self._backend, f"{layout.dataset_prefix(dataset_id)}/{file}", entry)

    def _entry(self, dataset_id: str, file: str) -> FileEntry:
        files = self._read(dataset_id).files
        if file not in files:
            known = ", ".join(sorted(files))
            raise NotFoundError(f"dataset {dataset_id} has no file {file[:100]!r}; it has {known}")
        return files[file]

    def _named(self, name: str) -> tuple[list[str], list[str]]:
        # one broken dataset must not hide the others
        named, unreadable, others = [], [], self.other_names()
        for dataset_id, record in self._records():
            if record is None:
                unreadable.append(dataset_id)
            elif name in (record.name, *others.get(dataset_id, ())):
                named.append(dataset_id)
        return named, unreadable

    def _records(self) -> Iterator[tuple[str, DatasetRecord | None]]:
        for dataset_id in self.ids():
            try:
                yield dataset_id, self._read(dataset_id)
            except (CorruptArtefactError, UnsupportedFormatError):
                yield dataset_id, None

    def _read(self, dataset_id: str) -> DatasetRecord:
        record = self._find(dataset_id)
        if record is None:
            raise DatasetNotFoundError(f"no dataset {dataset_id}; list the ids there are, or give a name")
        return record

    def _find(self, dataset_id: str) -> DatasetRecord | None:
        key = _record_key(dataset_id)
        record = read_document(self._backend, key, DatasetRecord)
        if record is not None and record.id != dataset_id:
            raise CorruptArtefactError(
                f"{key} says it is dataset {record.id}: it was moved here by hand; remove this folder and put it anew"
            )
        return record

    def _create_or_match(self, key: str, data: bytes, entry: FileEntry) -> None:
        if self._backend.create(key, data):
            return
        try:
            read_verified(self._backend, key, entry)
        except CorruptArtefactError as error:
            if self._backend.create(key, data):
                return  # it was there, and a deletion took it
            raise AlreadyExistsError(
                f"{key} is left from an unfinished put and differs from what is offered now; "
                "remove that object, then put the dataset again"
            ) from error


def _record_key(dataset_id: str) -> str:
    return f"{layout.dataset_prefix(dataset_id)}/{layout.DATASET}"


def _complete(dataset_id: str, files: dict[str, FileEntry], draft: DatasetDraft) -> DatasetRecord:
    said = {field: getattr(draft, field) for field in DatasetDraft.model_fields}
    return DatasetRecord(id=dataset_id, created_at=datetime.now(UTC), files=files, **said)


def _same(published: DatasetRecord, offered: Mapping[str, FileEntry]) -> DatasetRecord:
    same_names = published.files.keys() == offered.keys()
    if same_names and all(entry.same_bytes(offered[file]) for file, entry in published.files.items()):
        return published
    raise AlreadyExistsError(
        f"dataset {published.id} is published with other files ({', '.join(sorted(published.files))}); "
        "an id must be the digest of the content: give the changed content its own id"
    )
