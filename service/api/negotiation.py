"""Which form of the answer a client gets: `?format=` first, then the `Accept` header, else JSON."""

from __future__ import annotations

import mimeparse

from service.api.encoders import ENCODERS, Format
from service.errors import RoverTwinError

# in order of increasing desirability: of equal wishes the last one wins
_MEDIA_TYPES = {ENCODERS[form].media_type: form for form in reversed(Format)}


class NotAcceptableError(RoverTwinError):
    """The `Accept` header lists nothing that is available."""


def choose_format(asked: Format | None, accept: str | None) -> Format:
    """The form to answer in. Raises NotAcceptableError when `accept` rules out all of them or cannot be read."""
    if asked is not None:
        return asked
    if not accept or not accept.strip():
        return Format.JSON
    try:
        best = mimeparse.best_match(list(_MEDIA_TYPES), accept.lower())
    except mimeparse.MimeTypeParseException:
        best = ""
    if not best:
        available = ", ".join(encoder.media_type for encoder in ENCODERS.values())
        raise NotAcceptableError(f"Accept is '{accept[:100]}', available are {available}")
    return _MEDIA_TYPES[best]
