"""How people name a model: `name`, `name@3` (a version) or `name@champion` (an alias)."""

from __future__ import annotations

from dataclasses import dataclass

from model_store import layout
from model_store.errors import InvalidReferenceError

DEFAULT_ALIAS = "champion"


@dataclass(frozen=True, slots=True)
class Reference:
    """A parsed model reference: exactly one of `version` and `alias` is set."""

    name: str
    version: int | None
    alias: str | None


@dataclass(frozen=True, slots=True)
class Resolved:
    """The version a reference means now; `alias` is None when the reference named the version itself."""

    name: str
    version: int
    alias: str | None


def parse_reference(reference: str) -> Reference:
    """Read a model reference; a bare name means `name@champion`.

    Raises:
        InvalidReferenceError: the text is none of `name`, `name@<version>`, `name@<alias>`.
    """
    name, at, selector = reference.partition("@")
    layout.check_name(name)
    if not at:
        return Reference(name, None, DEFAULT_ALIAS)
    version = layout.version_number(selector)
    if version is not None:
        return Reference(name, version, None)
    if not layout.is_alias(selector):
        raise InvalidReferenceError(
            f"model reference {reference[:100]!r} must be '{name}', '{name}@<version>' with a version such as 3 "
            f"(no leading zero), or '{name}@<alias>' with an alias such as {DEFAULT_ALIAS}"
        )
    return Reference(name, None, selector)
