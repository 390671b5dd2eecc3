"""How an answer travels: compressed or not, whole or in part, how long a cache may keep it, 304 for who has it."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from fastapi import Request, Response

import service
from service.api.http.answers.compression import IDENTITY, SMALLEST_BYTES, Coding, choose_coding, compressed
from service.api.http.answers.ranges import NO_RANGE, PARTIAL, Range, content_range
from service.api.http.answers.written import Written, content_type
from service.api.http.sent_headers import all_sent, first_sent
from service.pictures import report
from service.twin import Loaded

# A version never changes, the service that computes with it may: a day is how long an upgrade can stay unseen.
_FIXED = "max-age=86400, immutable"
_MOVING = "no-cache"  # keep it, but ask each time: an alias moves

_TAG_BYTES = 16
_CONDITIONS = frozenset({b"if-none-match", b"range"})

CACHE_HEADERS: dict[str, Any] = {
    "ETag": {"schema": {"type": "string"}, "description": "Changes with the answer; for `If-None-Match`."},
    "Cache-Control": {
        "schema": {"type": "string"},
        "description": f"`{_FIXED}` for a version asked for by number, `{_MOVING}` for one asked for by alias.",
    },
    "Accept-Ranges": {
        "schema": {"type": "string", "enum": ["bytes"]},
        "description": "A `Range` of bytes gets a 206 with that part, on `If-Range` only while the `ETag` is that one.",
    },
}
"""Response headers of what can be cached, for the OpenAPI document."""

NOT_MODIFIED: dict[int | str, dict[str, Any]] = {
    304: {"description": "The client has this answer already: `If-None-Match` names its `ETag`."}
}
"""The response of a GET to who has the answer already, for the OpenAPI document."""


@dataclass(slots=True, eq=False)
class Delivery:
    """What one request's headers want, and what its answer's say. `cached` are the headers of the cache.

    Only what can be cached comes in parts: its bytes are the same each time. Nobody changes one.
    It is not frozen, since to make a frozen one takes three times as long.
    """

    media_type: str
    coding: Coding
    vary: str
    cached: Mapping[str, str] = field(default_factory=dict)
    known: str = ""
    range: Range = NO_RANGE

    @classmethod
    def of(cls, request: Request, media_type: str, *, text: bool, negotiated: bool = True) -> Delivery:
        """An answer that no cache keeps. `text` is worth compressing; `negotiated` by `Accept` as well."""
        coding = choose_coding(first_sent(request.scope, b"accept-encoding")) if text else IDENTITY
        return cls(media_type, coding, "Accept, Accept-Encoding" if negotiated else "Accept-Encoding")

    def cacheable(self, request: Request, loaded: Loaded, asked_for: str, question: bytes) -> Delivery:
        """The same for a GET whose answer follows from the version and the alias it was `asked_for` by, and `question`.

        Its ETag is known before the answer is: it is made from these, the form and the release of this service.
        """
        fixed = bool(asked_for) and loaded.alias is None  # the default may be a number today, another one tomorrow
        return self.tagged(request, _version(loaded.twin.fingerprint, loaded.alias) + question, fixed=fixed)

    def tagged(self, request: Request, content: bytes, *, fixed: bool) -> Delivery:
        """The same for a GET whose answer follows from `content` alone; `fixed` if its address never has another."""
        tag = hashlib.blake2b(_form(self.media_type, self.coding) + content, digest_size=_TAG_BYTES).hexdigest()
        cached = {"ETag": f'"{tag}"', "Cache-Control": _FIXED if fixed else _MOVING}
        known, part = "", NO_RANGE
        for name, _ in request.scope["headers"]:
            if name in _CONDITIONS:  # few requests have any
                known, part = ",".join(all_sent(request.scope, b"if-none-match")), Range.of(request.scope)
                break
        return Delivery(self.media_type, self.coding, self.vary, cached, known, part)

    def not_modified(self) -> Response | None:
        """The 304 for who has the answer already, else None."""
        if not self.known:
            return None
        tags = {each.strip().removeprefix("W/") for each in self.known.split(",")}
        if "*" not in tags and self.cached.get("ETag") not in tags:
            return None
        return Written(b"", {**self.cached, "Vary": self.vary}, status=304)

    def response(self, body: bytes, headers: Mapping[str, str] | None = None) -> Response:
        """The answer. Compresses: call it where that may take its time."""
        sent = {"Vary": self.vary, **self.cached, **(headers or {}), "Content-Type": content_type(self.media_type)}
        if self.media_type == report.MEDIA_TYPE:
            sent["Content-Security-Policy"] = report.POLICY
        if self.coding is not IDENTITY and len(body) >= SMALLEST_BYTES:
            body = compressed(body, self.coding)
            sent["Content-Encoding"] = self.coding
        if not self.cached:
            return Written(body, sent)
        sent["Accept-Ranges"] = "bytes"
        part = self.range.part(len(body), self.cached["ETag"]) if self.range.wanted else None
        if part is None:
            return Written(body, sent)
        sent["Content-Range"] = content_range(part, len(body))
        return Written(body[part], sent, status=PARTIAL)


@lru_cache(maxsize=64)
def _form(media_type: str, coding: Coding) -> bytes:
    """What of a tag follows from the form of an answer."""
    return f"{service.__version__}\n{media_type}\n{coding}\n".encode()


@lru_cache(maxsize=256)
def _version(fingerprint: str, alias: str | None) -> bytes:
    """What of a tag follows from who answers."""
    return f"{fingerprint} {alias}".encode()
