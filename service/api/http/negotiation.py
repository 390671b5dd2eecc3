"""Which form of the answer a client gets: `?format=` first, then the `Accept` header, else JSON."""

from __future__ import annotations

from enum import StrEnum
from functools import lru_cache
from typing import TypeVar

import mimeparse

from service.errors import RoverTwinError
from service.wire.batch_forms import BATCH_ENCODERS, BatchFormat
from service.wire.forms import MEDIA_TYPES

Form = TypeVar("Form", bound=StrEnum)


class NotAcceptableError(RoverTwinError):
    """The `Accept` header lists nothing that is available."""


def choose_format(asked: Form | None, accept: str | None, forms: type[Form]) -> Form:
    """The form to answer in, one of `forms`: without a wish their first, JSON.

    Raises NotAcceptableError when `accept` rules out all of them or cannot be read.
    """
    if asked is not None:
        return asked
    if not accept or accept.isspace() or accept == "*/*":
        return next(iter(forms))
    best = _best(accept.lower(), tuple(forms))
    if best is None:
        available = ", ".join(MEDIA_TYPES[form] for form in forms)
        raise NotAcceptableError(f"Accept is '{accept[:100]}', available are {available}")
    return forms(best)


@lru_cache(maxsize=256)
def _best(accept: str, forms: tuple[str, ...]) -> str | None:
    # mimeparse wants increasing desirability: of equal wishes the last one wins
    names = {MEDIA_TYPES[form]: form for form in reversed(forms)}
    try:
        return names.get(mimeparse.best_match(list(names), accept))
    except mimeparse.MimeTypeParseException:
        return None


# mimeparse wants increasing desirability: of equal wishes the last one wins
_FORMS = {BATCH_ENCODERS[form].media_type: form for form in reversed(BatchFormat)}


def choose_batch_format(asked: BatchFormat | None, accept: str | None) -> BatchFormat:
    """The form to answer in; without a wish JSON.

    Raises NotAcceptableError when `accept` rules out all of them or cannot be read.
    """
    if asked is not None or not accept or accept.isspace():
        return asked or BatchFormat.JSON
    try:
        best: str = mimeparse.best_match(list(_FORMS), accept.lower())
    except mimeparse.MimeTypeParseException:
        best = ""
    if best not in _FORMS:
        raise NotAcceptableError(f"Accept is '{accept[:100]}', available are {', '.join(reversed(_FORMS))}")
    return _FORMS[best]
