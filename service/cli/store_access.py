"""Opening the store that the user means, and refusing impossible names before any work is done."""

from __future__ import annotations

from typing import TYPE_CHECKING

from service.cli.failures import UsageError

if TYPE_CHECKING:
    from model_store import ModelStore


def open_store(url: str | None, *, create: bool = False) -> ModelStore:
    """The store at `url`, else where the settings say. Commands that write pass `create`: a missing directory is made.

    Raises SettingsError and StoreUnavailableError.
    """
    from model_store import ModelStore
    from service.settings import load_settings

    return ModelStore.open(load_settings(store_url=url).store_url, create=create)


def check_names(model: str, alias: str | None) -> None:
    """Refuse a model name or an alias that the store would refuse later. Raises InvalidReferenceError or UsageError."""
    from model_store import DEFAULT_ALIAS, parse_reference

    if parse_reference(f"{model}@{alias or DEFAULT_ALIAS}").alias is None:
        raise UsageError(f"alias is {alias!r}, allowed is a-z, 0-9 and -, starting with a letter")
