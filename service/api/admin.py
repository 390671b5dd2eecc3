"""Who may change things: the bearer token of the admin endpoints, checked before anything of a body is read."""

from __future__ import annotations

import hashlib
import hmac
import re
from typing import Annotated

from fastapi import Depends, Header, Request, Security
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer
from pydantic.json_schema import SkipJsonSchema
from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from service.api.http.errors import ErrorAnswers, own_path
from service.api.http.exceptions import AdminOffError, UnauthorizedError
from service.api.http.problems import Slug
from service.api.http.reading import Route
from service.api.services import Services, services_of
from service.wire.faults import InvalidInputError, fault

ACTOR_HEADER = "X-Actor"
ADMIN = "admin"
ADMIN_PROBLEMS = (Slug.UNAUTHORIZED, Slug.ADMIN_OFF, Slug.INVALID_INPUT)
"""What every route with `Admin` can answer besides its own problems."""

_PREFIX = "/v1/admin"
_ACTOR = re.compile(r"[A-Za-z0-9][A-Za-z0-9 ._@+-]{0,99}")
_ACTOR_ALLOWED = "1 to 100 of A-Z a-z 0-9 space . _ @ + -, starting with a letter or digit"
_bearer = HTTPBearer(
    scheme_name="admin",
    description="The operator's `ROVER_TWIN_ADMIN_TOKEN`. Without that setting the admin endpoints are off.",
    auto_error=False,
)


def check_token(services: Services, headers: Headers) -> None:
    """Raises AdminOffError when no token is configured, UnauthorizedError when another one, or none, was sent."""
    token = services.settings.admin_token
    if token is None:
        raise AdminOffError
    scheme, _, sent = headers.get("authorization", "").strip().partition(" ")
    if scheme.lower() != "bearer" or not sent.strip():
        raise UnauthorizedError("send the admin token as 'Authorization: Bearer <token>'", wrong=False)
    # digests have one length, so the comparison tells nothing about the token's; headers come decoded as latin-1
    ours, theirs = (_digest(token.get_secret_value().encode()), _digest(sent.strip().encode("latin-1", "replace")))
    if not hmac.compare_digest(ours, theirs):
        raise UnauthorizedError("the token that was sent is not the admin token of this service", wrong=True)


def _digest(text: bytes) -> bytes:
    return hashlib.sha256(text).digest()


async def require_admin(
    request: Request,
    _credentials: Annotated[HTTPAuthorizationCredentials | None, Security(_bearer)],
    said: Annotated[
        str | SkipJsonSchema[None],
        Header(
            alias=ACTOR_HEADER,
            description="Name of the caller for the audit trail. It is not checked.",
            json_schema_extra={"pattern": f"^{_ACTOR.pattern}$"},
        ),
    ] = None,
) -> str:
    """The actor for the audit trail: "admin", or "admin:<X-Actor>".

    Raises what `check_token` raises, and InvalidInputError for an X-Actor that no record could show safely.
    """
    check_token(await services_of(request), request.headers)
    if said is None:
        return ADMIN
    if _ACTOR.fullmatch(said) is None:
        raise InvalidInputError(fault(ACTOR_HEADER, said, _ACTOR_ALLOWED))
    return f"{ADMIN}:{said}"


Admin = Annotated[str, Depends(require_admin)]
"""Declares that a route needs the token; its value is the actor."""


class AdminGate:
    """ASGI middleware: under `/v1/admin` nothing is told without the token, not even which addresses there are."""

    def __init__(self, app: ASGIApp, answer_to: ErrorAnswers) -> None:
        self.app = app
        self.answer_to = answer_to

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI."""
        path = own_path(scope) if scope["type"] == "http" and _PREFIX in scope["path"] else ""
        if path == _PREFIX or path.startswith(_PREFIX + "/"):
            try:
                check_token(scope["state"]["services"], Headers(scope=scope))
            except (AdminOffError, UnauthorizedError) as error:
                await self.answer_to(error, path)(scope, receive, send)
                return
        await self.app(scope, receive, send)


class AdminRoute(Route):
    """A route that needs the token: checked before query and body are read."""

    def admit(self, request: Request) -> None:
        """Raises what `check_token` raises."""
        check_token(request.scope["state"]["services"], request.headers)
