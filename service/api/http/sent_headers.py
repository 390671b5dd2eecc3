"""The headers that a request came with, read straight from its scope: most answers look at five of them."""

from __future__ import annotations

from starlette.types import Scope


def first_sent(scope: Scope, name: bytes) -> str | None:
    """The value of a header, the first if it was sent several times; `name` in small letters."""
    for each, value in scope["headers"]:
        if each == name:
            return str(value, "latin-1")
    return None


def all_sent(scope: Scope, name: bytes) -> list[str]:
    """All its values, in order."""
    return [str(value, "latin-1") for each, value in scope["headers"] if each == name]
