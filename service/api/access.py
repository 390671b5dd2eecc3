"""Who is asking: from a request to the holder of its token. Wrong tokens are counted, logged and slowed."""

from __future__ import annotations

import math

import structlog
from starlette.datastructures import Headers
from starlette.types import Scope as AsgiScope

from service.access.addresses import UNKNOWN
from service.access.failed_logins import FailedLogins
from service.access.tokens import Identity, Scope, Tokens
from service.api.http.exceptions import (
    AdminOffError,
    ForbiddenError,
    RepeatedHeaderError,
    TooManyAttemptsError,
    UnauthorizedError,
)
from service.api.http.instruments import Instruments
from service.api.http.request_log import CLIENT

_IDENTITY = "service.identity"  # in the scope of a request, once it is known

_log = structlog.get_logger(__name__)


class Access:
    """Lets in who has a token. To be used on the event loop."""

    def __init__(self, tokens: Tokens, instruments: Instruments, failed: FailedLogins | None = None) -> None:
        self.tokens = tokens
        self._instruments = instruments
        self._failed = FailedLogins() if failed is None else failed

    def require(self, scope: AsgiScope, wanted: Scope) -> Identity:
        """Who sends this request.

        Raises AdminOffError when there is no token at all, UnauthorizedError when none or a wrong one was sent,
        TooManyAttemptsError when wrong ones keep coming, ForbiddenError when the token does not allow this, and
        RepeatedHeaderError when there are several.
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
        except (AdminOffError, UnauthorizedError, TooManyAttemptsError, RepeatedHeaderError):
            return False

    def still_holds(self, scope: AsgiScope, wanted: Scope) -> bool:
        """Whether the token of a request that was let in is in force still: for answers that go on for long."""
        sent = _token_of(scope)
        holder = None if sent is None else self.tokens.holder(sent)
        return holder is not None and holder.scope.covers(wanted)

    def _known(self, scope: AsgiScope) -> Identity | None:
        """None when no token was sent."""
        if not self.tokens.configured:
            raise AdminOffError
        known: Identity | None = scope.get(_IDENTITY)
        if known is not None:
            return known
        sent = _token_of(scope)
        if sent is None:
            return None
        holder = self.tokens.holder(sent)  # first of all: who has the right one never waits
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


def _token_of(scope: AsgiScope) -> bytes | None:
    """Raises RepeatedHeaderError: which of several counts, a proxy may see otherwise than we do."""
    said = Headers(scope=scope).getlist("authorization")
    if len(said) > 1:
        raise RepeatedHeaderError("Authorization")
    scheme, _, sent = (said[0] if said else "").strip().partition(" ")
    token = sent.strip()
    # headers come decoded as latin-1
    return token.encode("latin-1", "replace") if scheme.lower() == "bearer" and token else None


def _client(scope: AsgiScope) -> str:
    return str(scope.get(CLIENT, UNKNOWN))
