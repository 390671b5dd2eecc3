"""Who may change things: tokens are checked before anything of a body is read, and calls are put on record."""

from __future__ import annotations

from collections.abc import Callable
from contextvars import ContextVar
from typing import Annotated, TypeVar
from urllib.parse import quote

import structlog
from fastapi import Depends, Request, Security
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer
from starlette.types import ASGIApp, Receive, Send
from starlette.types import Scope as AsgiScope

from service.access.tokens import Identity, Scope
from service.api import page
from service.api.http.connections.connection import HEALTH_PATHS
from service.api.http.errors import ErrorAnswers, own_path
from service.api.http.exceptions import (
    AdminOffError,
    ForbiddenError,
    RepeatedHeaderError,
    TooManyAttemptsError,
    UnauthorizedError,
)
from service.api.http.problems import Slug
from service.api.http.reading import Answer, Route
from service.api.http.request_log import ANSWERED, CLIENT
from service.api.services import Services, services_of
from service.datasets.file_names import printable
from service.errors import AuditUnavailableError
from service.jobs.audit import Attempt
from service.log import request_id
from service.wire.faults import InvalidInputError, fault

ADMIN_PROBLEMS = (
    Slug.UNAUTHORIZED,
    Slug.INSUFFICIENT_SCOPE,
    Slug.TOO_MANY_ATTEMPTS,
    Slug.ADMIN_OFF,
    Slug.INVALID_INPUT,
    Slug.AUDIT_UNAVAILABLE,
    Slug.MALFORMED_HEAD,
)
"""What every admin route can answer besides its own problems."""

_PREFIX = "/v1/admin"
_OPEN = HEALTH_PATHS | page.PATHS
_SAFE = frozenset({"GET", "HEAD", "OPTIONS"})
_OLD_ACTOR = "X-Actor"
_REFUSALS = (AdminOffError, UnauthorizedError, ForbiddenError, TooManyAttemptsError, RepeatedHeaderError)
_bearer = HTTPBearer(
    scheme_name="admin",
    description="A token of the operator: `ROVER_TWIN_ADMIN_TOKEN`, or one of `ROVER_TWIN_TOKENS_FILE`. Its scope is "
    "`read` or `admin`; what changes something wants `admin`. Without these settings the admin endpoints are off.",
    auto_error=False,
)
Result = TypeVar("Result")
_subject: ContextVar[list[str] | None] = ContextVar("subject", default=None)
_log = structlog.get_logger(__name__)


class Gate:
    """ASGI middleware: under `/v1/admin` nothing is told without a token, not even which addresses there are.

    With `ROVER_TWIN_REQUIRE_TOKEN` nothing but health is told anywhere, and the page is shown, which asks for a token.
    """

    def __init__(self, app: ASGIApp, answer_to: ErrorAnswers) -> None:
        self.app = app
        self.answer_to = answer_to

    async def __call__(self, scope: AsgiScope, receive: Receive, send: Send) -> None:
        """ASGI."""
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
            return
        services: Services = scope["state"]["services"]
        if services.settings.require_token or _PREFIX in scope["path"]:
            path = own_path(scope)
            under_admin = path == _PREFIX or path.startswith(_PREFIX + "/")
            if under_admin or (services.settings.require_token and path not in _OPEN):
                try:
                    services.access.require(scope, _wanted(scope) if under_admin else Scope.READ)
                except _REFUSALS as error:
                    await self._refuse(error, path, scope, receive, send)
                    return
        await self.app(scope, receive, send)

    async def _refuse(self, error: Exception, path: str, scope: AsgiScope, receive: Receive, send: Send) -> None:
        response = self.answer_to(error, path)
        if scope["type"] != "websocket":
            await response(scope, receive, send)
            return
        await receive()  # that it connects
        start = {"type": "websocket.http.response.start", "status": response.status_code}
        await send({**start, "headers": response.raw_headers})
        await send({"type": "websocket.http.response.body", "body": bytes(response.body)})


class AdminRoute(Route):
    """A route that needs a token: to read, one of scope `reading`, else one of scope admin. Audited unless it reads."""

    reading = Scope.READ

    def get_route_handler(self) -> Answer:
        """As `Route`'s, once the caller is admitted, and the call is on record."""
        handle = super().get_route_handler()

        async def admitted(request: Request) -> None:
            services: Services = request.scope["state"]["services"]
            reads = request.method in _SAFE
            identity = services.access.require(request.scope, self.reading if reads else Scope.ADMIN)
            if not reads:
                _require_no_actor(request)
                await _put_on_record(request, services, identity)

        async def handle_admitted(request: Request):  # type: ignore[no-untyped-def] # noqa: ANN202 - as `Answer`
            await admitted(request)
            return await handle(request)

        return handle_admitted


class SecretRoute(AdminRoute):
    """A route that only a token of scope admin may read."""

    reading = Scope.ADMIN


async def require_admin(
    request: Request, _credentials: Annotated[HTTPAuthorizationCredentials | None, Security(_bearer)]
) -> str:
    """The name of the caller's token, for records of who did what. Raises what `Access.require` raises."""
    services = await services_of(request)
    return services.access.require(request.scope, _wanted(request.scope)).name


Admin = Annotated[str, Depends(require_admin)]
"""Declares that a route needs a token; its value is the actor. For routes of class `AdminRoute`."""


def about(subject: str) -> None:
    """Put on record what this call is about: a version, an alias, a dataset or a job; never a secret or a reason."""
    if (said := _subject.get()) is not None:
        said.append(printable(subject))


def _wanted(scope: AsgiScope) -> Scope:
    return Scope.READ if scope.get("method", "GET") in _SAFE else Scope.ADMIN


def _require_no_actor(request: Request) -> None:
    """Raises InvalidInputError for the header by which a caller once named himself: it must not seem to count."""
    if (said := request.headers.get(_OLD_ACTOR)) is not None:
        raise InvalidInputError(fault(_OLD_ACTOR, said, "no such header: the actor is the name of the token"))


async def _put_on_record(request: Request, services: Services, identity: Identity) -> None:
    """Raises AuditUnavailableError: what cannot be recorded is not done."""
    audit = services.audit
    if audit is None:
        raise AuditUnavailableError("this service was started without a database")
    scope = request.scope
    attempt = Attempt(
        actor=identity.name,
        client=scope[CLIENT],
        method=request.method,
        route=scope["route"].path,
        path=quote(own_path(scope)[:300], safe="/:@!$&'()*+,;=~-._"),
        request_id=request_id.get(""),
    )
    number = await audit_call(services, lambda: audit.begin(attempt))

    subject: list[str] = []
    _subject.set(subject)

    async def answered(status: int) -> None:
        said = "; ".join(subject) or None
        try:
            await audit_call(services, lambda: audit.complete(number, status, said))
        except Exception as error:
            # it is done: to answer anything else now would only be wrong
            _log.error(
                "the outcome of an admin call could not be recorded", row=number, status=status, reason=str(error)
            )

    scope[ANSWERED] = answered


async def audit_call(services: Services, call: Callable[[], Result]) -> Result:
    """What a call of the audit log returns. Raises AuditUnavailableError, after `jobs_timeout_s` at the latest."""
    patience_s = services.settings.jobs_timeout_s
    try:
        return await services.job_calls.run(call, give_up_s=patience_s)
    except TimeoutError:
        raise AuditUnavailableError(f"no answer in {patience_s:g} s") from None
