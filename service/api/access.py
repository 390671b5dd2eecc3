"""Who is asking: from a request to the holder of its token. Wrong tokens are counted, logged and slowed."""

from __future__ import annotations

import math

import structlog
from starlette.datastructures import Headers
from starlette.types import Scope as AsgiScope

from service.access.addresses import UNKNOWN
from service.access.failed_logins import FailedLogins
from service.access.tokens import Identity, Scope, Tokens
from service.api.http.exceptions import AdminOffError, ForbiddenError, TooManyAttemptsError, UnauthorizedError
from service.api.http.instruments import Instruments
from service.api.http.request_log import CLIENT

_IDENTITY = "service.identity"  # in the scope of a request, once it is known

_log = structlog.get_logger(__name__)


class Access:
    """Lets in who has a token. To be used on the event loop."""

    def __init__(self, tokens: Tokens, instruments: Instruments) -> None:
        self.tokens = tokens
        self._instruments = instruments
        self._failed = FailedLogins()

    def require(self, scope: AsgiScope, wanted: Scope) -> Identity:
        """Who sends this request.

        Raises AdminOffError when there is no token at all, UnauthorizedError when none or a wrong one was sent,
        TooManyAttemptsError when wrong ones keep coming, and ForbiddenError when the token does not allow this.
        """
        identity = self._known(scope)
        if identity is None:
            raise UnauthorizedError("send a token of this service as 'Authorization: Bearer <token>'", wrong=False)
        if not identity.scope.covers(wanted):
            self._instruments.login_failed("scope")
            _log.warning("a token of too small a scope was sent", token=identity.name, client=_client(scope))
            raise ForbiddenError(identity.name)
        return identity

    def is_known(self, scope: AsgiScope) -> bool:
        """Whether whoever asks has a token, where nobody needs one. A wrong token counts as one all the same."""
        try:
            return self._known(scope) is not None
        except (AdminOffError, UnauthorizedError, TooManyAttemptsError):
            return False

    def _known(self, scope: AsgiScope) -> Identity | None:
        """None when no token was sent."""
        if not self.tokens.configured:
            raise AdminOffError
        known: Identity | None = scope.get(_IDENTITY)
        if known is not None:
            return known
        scheme, _, sent = Headers(scope=scope).get("authorization", "").strip().partition(" ")
        if scheme.lower() != "bearer" or not sent.strip():
            return None
        # headers come decoded as latin-1; and first of all the token: who has the right one never waits
        holder = self.tokens.holder(sent.strip().encode("latin-1", "replace"))
        if holder is None:
            self._refuse(_client(scope))
        scope[_IDENTITY] = holder
        return holder

    def _refuse(self, client: str) -> None:
        wait_s = self._failed.failed(client)
        if wait_s > 0:  # the request's own line has it; one more for each would fill the log
            self._instruments.login_failed("slowed")
            raise TooManyAttemptsError(math.ceil(wait_s))
        self._instruments.login_failed("wrong")
        _log.warning("a wrong token was sent", client=client)
        raise UnauthorizedError("the token that was sent is not one of this service", wrong=True)


def _client(scope: AsgiScope) -> str:
    return str(scope.get(CLIENT, UNKNOWN))
