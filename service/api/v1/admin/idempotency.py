"""The `Idempotency-Key` header: the same key and the same request are the same job, however often they are sent."""

from __future__ import annotations

import re
from typing import Annotated

from fastapi import Header, Request

from service.errors import InvalidValueError

HEADER = "Idempotency-Key"
MOST_CHARACTERS = 255
ALLOWED = f'1 to {MOST_CHARACTERS} visible ASCII characters, sent once, bare or as a quoted string such as "8e03978e"'

# RFC 9651: printable ASCII in quotes, where quote and backslash are escaped
_QUOTED = re.compile(r'"((?:[\x20-\x21\x23-\x5b\x5d-\x7e]|\\["\\])*)"')
_BARE = re.compile(r"[\x21\x23-\x5b\x5d-\x7e]+")


def parse_key(text: str) -> str:
    """The key that a header's text stands for. Raises InvalidValueError."""
    if quoted := _QUOTED.fullmatch(text.strip()):
        key = re.sub(r"\\(.)", r"\1", quoted[1])
    else:
        key = text.strip() if _BARE.fullmatch(text.strip()) else ""
    if not 1 <= len(key) <= MOST_CHARACTERS:
        raise InvalidValueError(HEADER, text[: MOST_CHARACTERS + 3], ALLOWED)
    return key


async def idempotency_key(
    request: Request,
    _described: Annotated[
        str | None,
        Header(
            alias=HEADER,
            description="Makes it safe to repeat the request: the same key with the same body answers the same job. "
            f"With another body it is refused. {ALLOWED[0].upper()}{ALLOWED[1:]}.",
            examples=['"8e03978e-40d5-43dd-bc93-6894a57f9324"'],
        ),
    ] = None,
) -> str | None:
    """The key of a request, None without one. Raises InvalidValueError for one that is malformed or comes twice."""
    sent = request.headers.getlist(HEADER)
    if len(sent) > 1:
        raise InvalidValueError(HEADER, ", ".join(sent), ALLOWED)
    return parse_key(sent[0]) if sent else None
