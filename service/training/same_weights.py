"""Whether another version has the very weights of this one: trained on the same, with the same seed, it often has."""

from __future__ import annotations

from model_store import WEIGHTS, CorruptArtefactError, Manifest, ModelStore, NotFoundError, UnsupportedFormatError


def version_with(store: ModelStore, sha256: str, *, but: Manifest | None = None) -> str | None:
    """The oldest other version whose weights have this digest, as `name@2`, deleted ones too; None when there is none.

    Reads every manifest; those that cannot be read are skipped. Raises StoreUnavailableError.
    """
    found: list[Manifest] = []
    for name in store.model_names():
        for version in store.versions(name, retired=True):
            if but is not None and (name, version) == (but.name, but.version):
                continue
            try:
                manifest = store.manifest(name, version)
            except (CorruptArtefactError, UnsupportedFormatError, NotFoundError):
                continue
            if WEIGHTS in manifest.files and manifest.files[WEIGHTS].sha256 == sha256:
                found.append(manifest)
    oldest = min(found, key=lambda each: each.created_at, default=None)
    return None if oldest is None else f"{oldest.name}@{oldest.version}"


def same_weights_as(store: ModelStore, published: Manifest) -> str | None:
    """What the version says of itself, else what is found now: two that were published at the same moment did not see
    each other, and at least one of them does so afterwards.
    """
    said = published.lineage.same_weights_as
    return said or version_with(store, published.files[WEIGHTS].sha256, but=published)
