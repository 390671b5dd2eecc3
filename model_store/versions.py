"""Model versions: published once, whole, and never changed.

A version with a `once_key` is decided before it is published. Every publisher of the key writes its files under a
number of its own, then offers its manifest as `once/<key>.json`. That record is created if absent, so exactly one offer
ever stands; only it, byte for byte, is then copied to its place as the manifest, by whoever gets there. What lost, or
was killed before its offer, stays behind as files without a manifest, which no reader sees.
"""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime

from model_store import layout
from model_store.backend import Backend
from model_store.documents import MAX_DOCUMENT_BYTES, parse_document, read_document, render
from model_store.errors import (
    ConflictError,
    CorruptArtefactError,
    InvalidDraftError,
    ModelNotFoundError,
    NotFoundError,
    VersionNotFoundError,
)
from model_store.files import MAX_FILE_BYTES, FileEntry, digest_files, read_verified
from model_store.manifest import Manifest, ManifestDraft

PUBLISH_ATTEMPTS = 100
"""How many numbers a publisher tries: each lost race costs one, so this bounds publishers at one moment."""


class Versions:
    """The part of the store under `models/<name>/versions`. `ModelStore` documents each method."""

    def __init__(self, backend: Backend) -> None:
        self._backend = backend

    def model_names(self) -> list[str]:
        """Sorted names of the models with at least one published version."""
        names = filter(layout.is_name, self._backend.folders(layout.MODELS_ROOT))
        return sorted(name for name in names if self._published(name))

    def numbers(self, name: str) -> list[int]:
        """Sorted published version numbers."""
        numbers = self._published(name)
        if not numbers:
            raise self._no_model(name)
        return numbers

    def exists(self, name: str, version: int) -> bool:
        """Whether the version is published."""
        return self._backend.exists(_manifest_key(name, version))

    def require(self, name: str, version: int) -> None:
        """Raise ModelNotFoundError or VersionNotFoundError unless the version is published."""
        if not self.exists(name, version):
            raise self._no_version(name, version)

    def manifest(self, name: str, version: int) -> Manifest:
        """Read a manifest and check that it is the one of this place."""
        key = _manifest_key(name, version)
        manifest = read_document(self._backend, key, Manifest)
        if manifest is None:
            raise self._no_version(name, version)
        if (manifest.name, manifest.version) != (name, version):
            raise CorruptArtefactError(
                f"{key} says it is {manifest.name[:80]}@{manifest.version}: it was moved here by hand; "
                "remove this folder and publish the version anew"
            )
        return manifest

    def read_file(self, manifest: Manifest, file: str, limit_bytes: int = MAX_FILE_BYTES) -> bytes:
        """Read a file the manifest lists, verified."""
        place = f"{manifest.name}@{manifest.version}"
        entry = manifest.files.get(file)
        if entry is None:
            raise NotFoundError(f"{place} has no file {file[:100]!r}; it has {', '.join(sorted(manifest.files))}")
        key = f"{layout.version_prefix(manifest.name, manifest.version)}/{file}"
        return read_verified(self._backend, key, entry, limit_bytes=limit_bytes)

    def verify(self, name: str, version: int) -> Manifest:
        """Compare every file with its digest."""
        manifest = self.manifest(name, version)
        for file in manifest.files:
            self.read_file(manifest, file)
        return manifest

    def publish(
        self, name: str, files: Mapping[str, bytes], draft: ManifestDraft, once_key: str | None = None
    ) -> Manifest:
        """Write the files, then the manifest, under the first number nobody has used."""
        entries = self._check(name, files, draft)
        once = None if once_key is None else layout.once_record(name, once_key)
        if once is not None and self._backend.exists(once):
            return self._publish_decided(name, once)
        first = self._highest_used(name) + 1
        for number in range(first, min(first + PUBLISH_ATTEMPTS, layout.MAX_VERSION + 1)):
            if self._write_files(name, number, files):
                manifest = _complete(name, number, entries, draft)
                data = render(manifest)
                if once is not None and not self._backend.create_or_confirm(once, data):
                    return self._publish_decided(name, once)
                if self._backend.create_or_confirm(_manifest_key(name, number), data):
                    return manifest
        raise ConflictError(
            f"no free version number for {name!r} in {PUBLISH_ATTEMPTS} attempts from {first}: "
            "too many publishers at once; publish again"
        )

    def published_once(self, name: str, once_key: str) -> Manifest | None:
        """The version published under a key."""
        decided = read_document(self._backend, layout.once_record(name, once_key), Manifest)
        if decided is None or not self.exists(name, decided.version):
            return None
        return self._as_decided(name, decided, layout.once_record(name, once_key))

    def _publish_decided(self, name: str, once: str) -> Manifest:
        """Put the manifest that `once` holds into its place, unless it is there already."""
        data = self._backend.read(once, limit_bytes=MAX_DOCUMENT_BYTES)
        if data is None:
            raise CorruptArtefactError(f"{once} was there a moment ago and is gone: somebody removes it; publish again")
        decided = parse_document(data, once, Manifest)
        if not self.exists(name, decided.version):
            prefix = layout.version_prefix(name, decided.version)
            gone = [file for file in decided.files if not self._backend.exists(f"{prefix}/{file}")]
            if gone:
                raise CorruptArtefactError(
                    f"{once} stands for {name}@{decided.version}, whose {gone[0]} is gone: it was removed by hand; "
                    "restore it, or publish under another key"
                )
            self._backend.create(_manifest_key(name, decided.version), data)
        return self._as_decided(name, decided, once)

    def _as_decided(self, name: str, decided: Manifest, once: str) -> Manifest:
        published = self.manifest(name, decided.version)
        if published != decided:
            raise CorruptArtefactError(
                f"{once} and the manifest of {name}@{decided.version} differ: one was altered by hand; restore it"
            )
        return published

    def _check(self, name: str, files: Mapping[str, bytes], draft: ManifestDraft) -> dict[str, FileEntry]:
        for file in files:
            layout.check_version_file(file)
        if layout.WEIGHTS not in files:
            raise InvalidDraftError(f"files must include {layout.WEIGHTS!r}; offered are {sorted(files)}")
        entries = digest_files(files)
        # rendered once with the longest number: whatever cannot be written fails here, before the first byte
        render(_complete(layout.check_name(name), layout.MAX_VERSION, entries, draft))
        return entries

    def _write_files(self, name: str, number: int, files: Mapping[str, bytes]) -> bool:
        # weights first: creating them claims the number, and whoever loses has written nothing
        ordered = sorted(files, key=lambda file: (file != layout.WEIGHTS, file))
        prefix = layout.version_prefix(name, number)
        return all(self._backend.create(f"{prefix}/{file}", files[file]) for file in ordered)

    def _highest_used(self, name: str) -> int:
        # folders without a manifest count too: another publisher is at work there, or was killed there
        folders = self._backend.folders(layout.versions_prefix(name))
        return max((layout.version_number(folder) or 0 for folder in folders), default=0)

    def _published(self, name: str) -> list[int]:
        keys = self._backend.keys(layout.versions_prefix(name))
        folders = (key.removesuffix(f"/{layout.MANIFEST}") for key in keys if key.endswith(f"/{layout.MANIFEST}"))
        numbers = (layout.version_number(folder) for folder in folders)
        return sorted(number for number in numbers if number is not None)

    def _no_model(self, name: str) -> ModelNotFoundError:
        others = sorted(filter(layout.is_name, set(self._backend.folders(layout.MODELS_ROOT)) - {name}))
        has = f"there are {', '.join(others[:20])}" if others else "the store has none: publish a version first"
        return ModelNotFoundError(f"no model {name!r}; {has}")

    def _no_version(self, name: str, version: int) -> NotFoundError:
        published = self._published(name)
        if not published:
            return self._no_model(name)
        newest = ", ".join(str(number) for number in published[-20:])
        return VersionNotFoundError(f"model {name!r} has no version {version}; published are {newest}")


def _manifest_key(name: str, version: int) -> str:
    return f"{layout.version_prefix(name, version)}/{layout.MANIFEST}"


def _complete(name: str, number: int, files: dict[str, FileEntry], draft: ManifestDraft) -> Manifest:
    said = {field: getattr(draft, field) for field in ManifestDraft.model_fields}
    return Manifest(name=name, version=number, created_at=datetime.now(UTC), files=files, **said)
