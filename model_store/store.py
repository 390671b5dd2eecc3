"""The one object everybody holds: models with versions and aliases, and the datasets they came from."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping

from model_store import layout
from model_store.aliases import Aliases
from model_store.backend import PATIENCE_S, Backend
from model_store.copying import copy
from model_store.errors import CorruptArtefactError, NotFoundError, UnsupportedFormatError
from model_store.files import MAX_FILE_BYTES, FileEntry
from model_store.lifecycle import Lifecycle, State
from model_store.manifest import Manifest, ManifestDraft
from model_store.records import AliasRecord, DatasetDraft, DatasetRecord, LifecycleRecord, Retired
from model_store.references import Resolved
from model_store.retirement import Retirement
from model_store.stored_datasets import Datasets
from model_store.versions import Versions
from model_store.work import WorkFiles


class ModelStore:
    """A store of immutable artefacts on any obstore backend.

    Holds no state of its own: safe to share between threads, and any number of processes may read and write the same
    place. Every method may raise `StoreUnavailableError` (the backend fails) and `InvalidReferenceError` (a malformed
    name, alias, version or id) besides the errors it names.
    """

    def __init__(self, backend: Backend) -> None:
        self._backend = backend
        self._versions = Versions(backend)
        self._lifecycle = Lifecycle(backend)
        self._aliases = Aliases(backend, self._versions, self._lifecycle)
        self._retirement = Retirement(backend, self._versions, self._aliases, self._lifecycle)
        self._datasets = Datasets(backend)
        self._work = WorkFiles(backend)

    @classmethod
    def open(cls, url: str | os.PathLike[str], *, create: bool = False, patience_s: float = PATIENCE_S) -> ModelStore:
        """Open a store: a plain path, or a file://, memory://, s3://, gs:// or az:// URL.

        `create` makes a missing directory. An empty place is a good, empty store. Each `memory://` is a store of its
        own, gone with the object. Calls to a remote store that does not answer fail within `patience_s`, those
        for objects over 8 MiB after a pause of 20 s. Open after `fork`, not before: the backend's runtime has threads.

        Raises:
            StoreUnavailableError: the directory is missing or the URL unknown.
        """
        return cls(Backend.open(url, create=create, patience_s=patience_s))

    @property
    def remote(self) -> bool:
        """Whether every look is a request over a network: those who look often then look less often."""
        return self._backend.remote

    def fingerprint(self) -> str:
        """A digest that changes with every version, alias and file of any model; costs one listing."""
        return self._backend.fingerprint(layout.MODELS_ROOT)

    @property
    def location(self) -> str:
        """Where the store is, without credentials, for messages and logs."""
        return self._backend.location

    def copy_to(self, other: ModelStore) -> tuple[int, int]:
        """Copy models and datasets that another store lacks; how many objects were copied, and how many were there.

        Nothing is overwritten, and the copy is whole at any moment: see `model_store.copying`.
        """
        return copy(self._backend, other._backend)

    def model_names(self) -> list[str]:
        """Sorted names of the models with at least one published version."""
        return self._versions.model_names()

    def versions(self, name: str, *, retired: bool = False) -> list[int]:
        """Versions of a model that can be used, ascending; with `retired` the archived and deleted ones too.

        Only versions with a manifest: what a running or killed publisher has written so far does not show. Empty only
        where all of them are retired.

        Raises:
            ModelNotFoundError: nothing is published under this name.
        """
        numbers = self._versions.numbers(name)
        if retired:
            return numbers
        gone = self._lifecycle.retired(name)
        return [number for number in numbers if number not in gone]

    def retired(self, name: str) -> dict[int, Retired]:
        """The versions of a model that are archived or deleted: one listing, and a small read when that has changed.

        Raises CorruptArtefactError, UnsupportedFormatError: the newest record of it cannot be read.
        """
        return self._lifecycle.retired(name)

    def version_state(self, name: str, version: int) -> tuple[State, LifecycleRecord | None]:
        """Whether a version is published, archived or deleted, and the record that says since when, by whom and why.

        Raises:
            ModelNotFoundError, VersionNotFoundError: it was never published.
            CorruptArtefactError, UnsupportedFormatError: the record cannot be read.
        """
        self._versions.require(name, version)
        return self._lifecycle.state(name, version)

    def require_usable(self, name: str, version: int) -> None:
        """Raises VersionArchivedError or VersionDeletedError for a version that is not to be used any more."""
        self._lifecycle.require_usable(name, version)

    def archive_version(
        self, name: str, version: int, *, actor: str, reason: str, expected_seq: int | None = None
    ) -> LifecycleRecord:
        """Take a version out of use; everything of it stays, and `restore_version` brings it back.

        Archiving it again changes nothing and returns the first record. A move of an alias to it at the same moment
        either comes first, and this is refused, or is refused itself. With `expected_seq` it happens only if the record
        of the version's present state still has that number (0: it is published).

        Raises:
            ModelNotFoundError, VersionNotFoundError: it was never published.
            VersionInUseError: aliases name it.
            VersionDeletedError: it was deleted.
            ConflictError: `expected_seq` is another, or others kept changing versions and aliases of this model.
            InvalidDraftError: `actor` is empty or over 200 characters, or `reason` over 4,000.
            CorruptArtefactError, UnsupportedFormatError: an alias of the model cannot be read.
        """
        return self._retirement.archive(name, version, actor=actor, reason=reason, expected_seq=expected_seq)

    def restore_version(
        self, name: str, version: int, *, actor: str, reason: str, expected_seq: int | None = None
    ) -> LifecycleRecord | None:
        """Bring an archived version back into use; None, and nothing changed, where it was not archived.

        Raises what `archive_version` raises, but for VersionInUseError.
        """
        return self._retirement.restore(name, version, actor=actor, reason=reason, expected_seq=expected_seq)

    def delete_version(
        self, name: str, version: int, *, actor: str, reason: str, expected_seq: int | None = None
    ) -> LifecycleRecord:
        """Remove what a version predicts with, for good. Its number, manifest and report stay, so whatever names it
        (the history of an alias, a job, the lineage of others) still finds out what it was.

        From the moment of the record nobody predicts with it; a killed deletion is finished by deleting again.
        Raises what `archive_version` raises.
        """
        return self._retirement.delete(name, version, actor=actor, reason=reason, expected_seq=expected_seq)

    def publish(
        self, name: str, files: Mapping[str, bytes], draft: ManifestDraft, once_key: str | None = None
    ) -> Manifest:
        """Publish a new version and return its manifest; it never touches an older one.

        `files` holds `weights.safetensors` and any `report/<plain name>`. The number is one above the highest in use,
        folders of killed publishers included, so numbers can have gaps. Publishers at the same moment get different
        numbers. The manifest is written last and is the publication: before it no reader sees anything, after it the
        version is whole. Everything is checked before the first byte is written.

        On return the version survives a kill of any process. A power cut is another matter: object stores have it
        safe by then, but obstore writes local files without fsync, so a directory may lose or tear the last seconds
        on disk. Torn files are detected by their digests and refused, never served; publish again then.

        With a `once_key` (a job's id: a-z, 0-9, '.', '_', '-', at most 128) the model gets at most one version for this
        key, ever: of any number of publishers, at once or one after another was killed, the first to have written all
        its files wins. The others return the manifest of that version, whatever they offered.

        Raises:
            InvalidDraftError: files missing, too many or too large, or a manifest over 8 MiB; nothing was written.
            ConflictError: a hundred other publishers were faster.
            CorruptArtefactError, UnsupportedFormatError: the version of this `once_key` was damaged or removed.
        """
        return self._versions.publish(name, files, draft, once_key)

    def published_once(self, name: str, once_key: str) -> Manifest | None:
        """The version of a model published with this `once_key`, or None while there is none; reads only.

        Raises:
            CorruptArtefactError, UnsupportedFormatError: the version of this `once_key` was damaged.
        """
        return self._versions.published_once(name, once_key)

    def manifest(self, name: str, version: int) -> Manifest:
        """Read the manifest of a version (at most 8 MiB).

        Raises:
            ModelNotFoundError, VersionNotFoundError: it is not published.
            CorruptArtefactError: truncated, not JSON, wrong fields, or moved here from another place.
            UnsupportedFormatError: written by a newer major format.
        """
        return self._versions.manifest(name, version)

    def read_file(self, manifest: Manifest, file: str, *, limit_bytes: int = MAX_FILE_BYTES) -> bytes:
        """Read one file of a version, its size and sha256 compared with the manifest, which `manifest` has read.

        Raises:
            NotFoundError: the manifest lists no such file.
            VersionDeletedError: the version was deleted, and this file went with it.
            CorruptArtefactError: the file is missing, truncated or altered.
            ArtefactTooLargeError: it is larger than `limit_bytes`; nothing of it was read.
        """
        try:
            return self._versions.read_file(manifest, file, limit_bytes)
        except CorruptArtefactError:
            self._require_kept(manifest.name, manifest.version)
            raise

    def verify(self, name: str, version: int) -> Manifest:
        """Read every file of a version and compare it with the manifest; raises what both of them raise."""
        try:
            return self._versions.verify(name, version)
        except CorruptArtefactError:
            self._require_kept(name, version)
            raise

    def _require_kept(self, name: str, version: int) -> None:
        """Raises VersionDeletedError."""
        retired = self._lifecycle.retired(name).get(version)
        if retired is not None and retired.state == "deleted":
            self._lifecycle.require_usable(name, version)

    def resolve(self, reference: str) -> Resolved:
        """Say which version `name`, `name@3` or `name@champion` means now; a bare name means `name@champion`.

        Costs one listing of the alias's records, one small read and one existence check; made to be polled.

        Raises:
            ModelNotFoundError, AliasNotFoundError: there is none.
            VersionNotFoundError: the version, or the one the alias points to, is not in the store.
            CorruptArtefactError, UnsupportedFormatError: the alias's newest record cannot be read.
        """
        return self._aliases.resolve(reference)

    def aliases(self, name: str) -> dict[str, AliasRecord]:
        """The record that holds for every alias of a model; empty when it has none.

        Raises:
            ModelNotFoundError: nothing is published under this name.
            CorruptArtefactError, UnsupportedFormatError: a newest record cannot be read.
        """
        return self._aliases.all(name)

    def alias(self, name: str, alias: str) -> AliasRecord:
        """The record that holds for one alias: one listing and one small read.

        Raises:
            ModelNotFoundError, AliasNotFoundError: there is none.
            CorruptArtefactError, UnsupportedFormatError: the newest record cannot be read; older ones are never
                served in its place. Moving the alias repairs it.
        """
        return self._aliases.current(name, alias)

    def alias_history(self, name: str, alias: str) -> list[AliasRecord]:
        """Every record of an alias, oldest first; raises what `alias` raises, for any record."""
        return self._aliases.history(name, alias)

    def move_alias(
        self, name: str, alias: str, version: int, *, actor: str, reason: str, expected_seq: int | None = None
    ) -> AliasRecord:
        """Point an alias (new or not) to a published version, by adding a record.

        With `expected_seq` the move happens only if the newest record still has that number (0: the alias is new);
        without it, a mover who loses a race looks again and moves after the winner. Moving to the version it already
        has is recorded too, and changes nothing for a rollback.

        Raises:
            ModelNotFoundError, VersionNotFoundError: the version is not published.
            VersionArchivedError, VersionDeletedError: it is retired.
            ConflictError: the alias moved meanwhile; of movers with the same `expected_seq` exactly one wins.
            InvalidDraftError: `actor` is empty or over 200 characters, or `reason` over 4,000.
            UnsupportedFormatError: the newest record is of a newer major format. A corrupt one is moved away from.
        """
        return self._aliases.move(name, alias, version, actor=actor, reason=reason, expected_seq=expected_seq)

    def rollback(
        self, name: str, alias: str, *, actor: str, reason: str, expected_seq: int | None = None
    ) -> AliasRecord:
        """Take the last version change of an alias back, by adding one more record.

        Works like undo: after moves to 1, 2, 3 a rollback gives 2, a second one gives 1 (not 3 again: a version rolled
        back from is left behind), a third one has nothing left. A move after a rollback starts from there.
        A rollback is never retried; when somebody moved the alias in between, look again.

        Raises:
            ModelNotFoundError, AliasNotFoundError: there is none.
            VersionNotFoundError: the version to return to is no longer in the store; move the alias by number.
            VersionArchivedError, VersionDeletedError: it is retired; move the alias by number.
            ConflictError: nothing to return to, `expected_seq` is not the newest, or the alias moved meanwhile.
            CorruptArtefactError, UnsupportedFormatError: a record needed for it cannot be read.
        """
        return self._aliases.rollback(name, alias, actor=actor, reason=reason, expected_seq=expected_seq)

    def put_dataset(self, dataset_id: str, files: Mapping[str, bytes], record: DatasetDraft) -> DatasetRecord:
        """Publish a dataset under the sha256 of its content; the same id and files again return the first record.

        The id is the caller's: it must be computed from the content of all files. `dataset.json` is written last
        and is the publication; what a killed put left behind is completed by the next one. Durable as in `publish`.

        Raises:
            AlreadyExistsError: the id is published, or half written, with other files.
            InvalidDraftError: no or too many files, one too large, or a record over 8 MiB; nothing was written.
            CorruptArtefactError, UnsupportedFormatError: a record is there and cannot be read.
        """
        return self._datasets.put(dataset_id, files, record)[0]

    def offer_dataset(
        self, dataset_id: str, files: Mapping[str, bytes], record: DatasetDraft
    ) -> tuple[DatasetRecord, bool]:
        """`put_dataset` that also says whether it was this call that published the dataset."""
        return self._datasets.put(dataset_id, files, record)

    def name_dataset(self, dataset_id: str, name: str, *, created_by: str) -> bool:
        """Give a dataset, given by its whole id, one more name to be found by; False when it has it already.

        Raises:
            DatasetNotFoundError: there is none.
            InvalidReferenceError, InvalidDraftError: the name, or who gives it, is not allowed.
            ConflictError: it has 64 names.
            CorruptArtefactError, UnsupportedFormatError: its record cannot be read.
        """
        return self._datasets.add_name(dataset_id, name, created_by=created_by)

    def forget_dataset_name(self, dataset_id: str, name: str) -> None:
        """Take a name from a dataset, given by its whole id.

        Raises DatasetNotFoundError where it has none of this name, ConflictError for the one that it was put with.
        """
        self._datasets.remove_name(dataset_id, name)

    def require_dataset_name(self, dataset_id: str, name: str) -> None:
        """Raises DatasetNameTakenError where another dataset is found by this name: then both would be ambiguous.

        Nothing is locked: of two who put two datasets under one name at the same moment, both may pass.
        """
        self._datasets.require_name(dataset_id, name)

    def dataset_names(self, record: DatasetRecord) -> list[str]:
        """Every name of a dataset: the one that it was put with, then the others, sorted."""
        return self._datasets.names(record)

    def other_dataset_names(self) -> dict[str, list[str]]:
        """The names beside the first one, by id, of all datasets that have any: one listing."""
        return self._datasets.other_names()

    def delete_dataset(self, dataset_id: str) -> None:
        """Remove a dataset, given by its whole id. Its record goes first, so that it vanishes at once; deleting again
        removes what a killed deletion left. Nothing here asks whether it is in use: see `datasets_in_use`.

        Raises:
            DatasetNotFoundError: there is none, and nothing is left of one.
        """
        self._datasets.delete(dataset_id)

    def datasets_in_use(self) -> dict[str, list[str]]:
        """For each dataset that some published version was trained on: those versions, as `name@2`.

        Reads every manifest. Versions whose manifest cannot be read are skipped: nothing tells what they are made of.
        """
        used: dict[str, list[str]] = {}
        for name in self.model_names():
            for version in self.versions(name, retired=True):
                try:
                    datasets = self.manifest(name, version).lineage.datasets
                except (CorruptArtefactError, UnsupportedFormatError, NotFoundError):
                    continue
                for dataset_id in dict.fromkeys(datasets):
                    used.setdefault(dataset_id, []).append(f"{name}@{version}")
        return used

    def dataset_ids(self) -> list[str]:
        """Sorted ids of the published datasets."""
        return self._datasets.ids()

    def dataset(self, reference: str) -> DatasetRecord:
        """Find a dataset by its id, a unique start of it (6 digits or more), or its name.

        Raises:
            DatasetNotFoundError: there is none.
            InvalidReferenceError: several fit; the message lists their ids.
            CorruptArtefactError, UnsupportedFormatError: its record cannot be read.
        """
        return self._datasets.get(reference)

    def read_dataset_file(self, dataset_id: str, file: str, *, limit_bytes: int = MAX_FILE_BYTES) -> bytes:
        """Read one file of a dataset, its size and sha256 compared with the record.

        Raises:
            DatasetNotFoundError, NotFoundError: no such dataset, or the record lists no such file.
            CorruptArtefactError: the record or the file is missing, truncated or altered.
            ArtefactTooLargeError: it is larger than `limit_bytes`; nothing of it was read.
        """
        return self._datasets.read_file(dataset_id, file, limit_bytes)

    def stream_dataset_file(self, dataset_id: str, file: str) -> tuple[FileEntry, Iterator[bytes]]:
        """One file of a dataset piece by piece: its size and digest, and an iterator over its bytes.

        The bytes are compared with the record before the last piece is given. Raises what `read_dataset_file` raises
        (the size has no limit here); CorruptArtefactError comes while iterating.
        """
        return self._datasets.stream_file(dataset_id, file)

    def put_work(self, job: str, file: str, data: bytes) -> FileEntry:
        """Keep a work file of a job, in place of the one that may be there; returns its digest, to be read with.

        Work files are no artefacts: nobody lists or serves them, and they go when the job ends.
        """
        return self._work.put(job, file, data)

    def read_work(self, job: str, file: str, entry: FileEntry) -> bytes:
        """Read a work file, compared with the digest from when it was put.

        Raises:
            CorruptArtefactError: it is missing, truncated or altered.
        """
        return self._work.read(job, file, entry)

    def work_names(self, job: str) -> list[str]:
        """Sorted names of a job's work files."""
        return self._work.names(job)

    def remove_work(self, job: str, file: str | None = None) -> None:
        """Remove one work file of a job, or all; that there is none is as good."""
        self._work.remove(job, file)

    def jobs_with_work(self) -> list[str]:
        """Sorted ids of the jobs that have work files."""
        return self._work.jobs()
