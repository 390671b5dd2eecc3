"""`rover-twin models archive` and `delete`: versions taken out of use."""

from __future__ import annotations

from typing import Any, Literal

from model_store import ModelStore, VersionInUseError, parse_reference
from service.settings import load_settings


def retire(
    store: ModelStore, state: Literal["archived", "deleted"], name: str, version: int, *, actor: str, reason: str
) -> None:
    """Raises VersionInUseError for what an alias or the default model's setting names, and what the store raises."""
    default = parse_reference(load_settings().default_model)
    if (default.name, default.version) == (name, version):
        raise VersionInUseError(name, version, [])
    change = store.archive_version if state == "archived" else store.delete_version
    change(name, version, actor=actor, reason=reason)


def describe_state(store: ModelStore, name: str, version: int) -> dict[str, Any]:
    """What the service answers about the state of a version."""
    state, record = store.version_state(name, version)
    return {
        "name": name,
        "version": version,
        "state": state,
        "since": record and record.time.isoformat(),
        "actor": record and record.actor,
        "reason": record and record.reason,
    }
