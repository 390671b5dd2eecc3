"""Which form of the answer a client gets: `?format=` first, then the `Accept` header, else the first on offer."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import TypeVar

import mimeparse

from service import parts
from service.errors import RoverTwinError

_PAGE = "text/html"
Form = TypeVar("Form", bound=str)


class NotAcceptableError(RoverTwinError):
    """The `Accept` header lists nothing that is available."""


def choose(offered: Mapping[Form, str], asked: Form | None, accept: str | None) -> Form:
    """The form to answer in, one of those `offered` with their media types; of equal wishes the first one wins.

    A browser's address bar asks for `text/html` before anything else, so it gets the page where there is one.

    Raises NotAcceptableError when `accept` rules out all of them or cannot be read.
    """
    if asked is not None:
        return asked
    if not accept or accept.isspace() or accept == "*/*":
        return next(iter(offered))
    if not parts.has(parts.PICTURES):  # a browser gets the numbers, not a refusal of the page that it prefers
        offered = {form: media_type for form, media_type in offered.items() if media_type != _PAGE}
    best = _best(accept.lower(), tuple(offered.values()))
    for form, media_type in offered.items():
        if media_type == best:
            return form
    raise NotAcceptableError(f"Accept is '{accept[:100]}', available are {', '.join(offered.values())}")


@lru_cache(maxsize=256)
def _best(accept: str, media_types: tuple[str, ...]) -> str:
    """Empty where nothing fits."""
    try:
        # mimeparse wants increasing desirability: of equal wishes the last one wins
        return str(mimeparse.best_match(list(reversed(media_types)), accept))
    except mimeparse.MimeTypeParseException:
        return ""
