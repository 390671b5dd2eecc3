"""What `rover-twin models` reads and how it is laid out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from rich.console import RenderableType
from rich.table import Table

from model_store import (
    WEIGHTS,
    AliasNotFoundError,
    CorruptArtefactError,
    Manifest,
    ModelStore,
    NotFoundError,
    StoreError,
    UnsupportedFormatError,
    parse_reference,
)
from service.cli.output import make_table, titled
from service.cli.views.errors import error_table


def list_all(store: ModelStore) -> tuple[list[dict[str, Any]], list[str]]:
    """Every model as (name, versions, archived, deleted, aliases, description), and why others cannot be read."""
    models: list[dict[str, Any]] = []
    unreadable: list[str] = []
    for name in store.model_names():
        try:
            aliases = {alias: record.version for alias, record in store.aliases(name).items()}
            manifest = find_version(store, name)
        except StoreError as error:
            unreadable.append(f"{name}: {error}")
            continue
        states = {number: each.state for number, each in store.retired(name).items()}
        lists = {
            "versions": [number for number in store.versions(name, retired=True) if number not in states],
            "archived": sorted(number for number, state in states.items() if state == "archived"),
            "deleted": sorted(number for number, state in states.items() if state == "deleted"),
        }
        models.append({"name": name, **lists, "aliases": aliases, "description": manifest.description})
    return models, unreadable


def find_version(store: ModelStore, reference: str) -> Manifest:
    """The manifest of a reference; a bare name without a champion means its newest version."""
    try:
        resolved = store.resolve(reference)
    except AliasNotFoundError:
        if "@" in reference:
            raise
        versions = store.versions(reference) or store.versions(reference, retired=True)
        return store.manifest(reference, versions[-1])
    return store.manifest(resolved.name, resolved.version)


def verify(store: ModelStore, reference: str | None) -> list[tuple[str, str | None]]:
    """(name@version, damage or None) of the version asked for, or of every version.

    Raises NotFoundError when what was asked for is not there.
    """
    if reference is None:
        places = [(name, version) for name in store.model_names() for version in _kept(store, name)]
    elif "@" in reference:
        resolved = store.resolve(reference)
        places = [(resolved.name, resolved.version)]
    else:
        name = parse_reference(reference).name
        places = [(name, version) for version in _kept(store, name)]
    return [(f"{name}@{version}", _damage(store, name, version)) for name, version in places]


def _kept(store: ModelStore, name: str) -> list[int]:
    """All versions but those that were deleted, of which no files are left to verify."""
    retired = store.retired(name)
    versions = store.versions(name, retired=True)
    return [version for version in versions if version not in retired or retired[version].state != "deleted"]


def _damage(store: ModelStore, name: str, version: int) -> str | None:
    try:
        store.verify(name, version)
    except StoreError as error:
        return str(error)
    return None


def dataset_names(store: ModelStore, manifest: Manifest) -> dict[str, str]:
    """What each dataset of a version's lineage is called, or why that cannot be said."""
    names = {}
    for dataset in manifest.lineage.datasets:
        try:
            names[dataset] = store.dataset(dataset).name
        except NotFoundError:
            names[dataset] = "no longer in the store"
        except (CorruptArtefactError, UnsupportedFormatError):
            names[dataset] = "its record is damaged"
    return names


def describe(manifest: Manifest, datasets: Mapping[str, str]) -> Iterator[RenderableType]:
    """The parts of a manifest that people ask for first; `--json` has all of it. `datasets` maps ids to names."""
    yield _facts(manifest)
    yield ""
    yield _lineage(manifest, datasets)
    yield ""
    yield _domain(manifest.domain)
    parts = {
        "test": "test runs, never seen in training",
        "left_out": "training runs, each predicted without it",
        "train": "runs it was trained on",
    }
    for key, title in parts.items():
        found = manifest.metrics.get(key)
        summary = found.get("summary", found) if isinstance(found, dict) else None
        if isinstance(summary, dict) and "model" in summary:
            yield ""
            yield error_table(f"{title} ({summary.get('runs')})", summary)


def _facts(manifest: Manifest) -> RenderableType:
    checkpoint = manifest.checkpoint
    table = make_table("version", f"{manifest.name}@{manifest.version}", left=2)
    facts = {
        "description": manifest.description,
        "published": f"{manifest.created_at.isoformat(timespec='seconds')} by {manifest.created_by}",
        "prior": _name_in(checkpoint.get("prior")),
        "architecture": _name_in(checkpoint.get("architecture")),
        "inputs": _names_in(checkpoint.get("inputs")),
        "files": ", ".join(f"{path} ({entry.size_bytes} bytes)" for path, entry in manifest.files.items()),
    }
    _add_rows(table, facts)
    return table


def _lineage(manifest: Manifest, datasets: Mapping[str, str]) -> RenderableType:
    lineage = manifest.lineage
    split = lineage.split if isinstance(lineage.split, dict) else {}
    counts = [f"{len(runs)} to {part} on" for part, runs in split.items() if isinstance(runs, list)]
    table = make_table("", "", left=2)
    _add_rows(table, {"job": lineage.job or "none: not trained by a job"})
    for number, (dataset, name) in enumerate(datasets.items()):
        table.add_row("" if number else "datasets", f"{dataset} ({name})")
    facts = {
        "runs": ", ".join([*counts, str(split.get("validation", ""))]).strip(", "),
        "seed": lineage.seed,
        "config": _config_words(lineage.config),
        "code": lineage.code_version,
        "libraries": ", ".join(f"{name} {version}" for name, version in lineage.libraries.items()),
        "command": lineage.command,
        "weights sha256": manifest.files[WEIGHTS].sha256 if WEIGHTS in manifest.files else None,
        "same weights as": lineage.same_weights_as,
        "made again by": f"rover-twin train --like {manifest.name}@{manifest.version} --no-publish",
    }
    _add_rows(table, facts)
    return titled("lineage: what it was made from", table)


def _config_words(config: Mapping[str, Any]) -> str:
    # what has a line of its own is left out
    shown = {name: value for name, value in config.items() if name not in ("model", "datasets", "description", "fit")}
    fit = config.get("fit")
    shown |= fit if isinstance(fit, dict) else {}
    return ", ".join(f"{name} {_plain(value)}" for name, value in shown.items() if value not in (None, "", []))


def _plain(value: object) -> str:
    return " ".join(map(str, value)) if isinstance(value, list) else str(value)


def _add_rows(table: Table, facts: Mapping[str, object]) -> None:
    for what, value in facts.items():
        table.add_row(what, "-" if value in (None, "") else str(value))


def _domain(domain: Mapping[str, Any]) -> RenderableType:
    table = make_table("", "lowest", "highest")
    for field, span in domain.items():
        if isinstance(span, list) and len(span) == 2:
            table.add_row(field, *(f"{value:.6g}" for value in span))
    return titled("domain: what the training runs cover", table)


def _name_in(part: object) -> object:
    return part.get("name") if isinstance(part, Mapping) else None


def _names_in(part: object) -> str:
    return ", ".join(str(_name_in(each)) for each in part) if isinstance(part, list) else ""
