"""What can go wrong with a request as such: the exceptions of this side. `errors` says how each is answered."""

from __future__ import annotations

from starlette.exceptions import HTTPException

from service.errors import RoverTwinError


class NotReadyError(RoverTwinError):
    """The default model cannot predict now."""


class UnsupportedMediaTypeError(RoverTwinError):
    """A body came that does not say it is JSON."""


class AdminOffError(RoverTwinError):
    """An admin address was asked for, and no token is configured: then nobody may."""

    def __init__(self) -> None:
        super().__init__(
            "the admin endpoints are off: neither ROVER_TWIN_ADMIN_TOKEN nor ROVER_TWIN_TOKENS_FILE is set"
        )


class UnauthorizedError(RoverTwinError):
    """The token is missing, or (`wrong`) one was sent that nobody has."""

    def __init__(self, message: str, *, wrong: bool) -> None:
        self.challenge = 'Bearer realm="rover-twin"' + (', error="invalid_token"' if wrong else "")
        super().__init__(message)


class ForbiddenError(RoverTwinError):
    """The token is known, but does not allow this."""

    challenge = 'Bearer realm="rover-twin", error="insufficient_scope", scope="admin"'

    def __init__(self, name: str) -> None:
        super().__init__(f"the token {name!r} has the scope read; this address wants one with the scope admin")


class TooManyAttemptsError(RoverTwinError):
    """Wrong tokens keep coming from this client."""

    def __init__(self, retry_after_s: int) -> None:
        self.retry_after_s = retry_after_s
        super().__init__(
            f"too many wrong tokens came from this address; try again in {retry_after_s} s, or send the right one"
        )


class MalformedUploadError(RoverTwinError):
    """The body of an upload cannot be taken apart, or ends before it should."""


class UploadStalledError(RoverTwinError):
    """An upload stopped coming in."""


class HeadTooLargeError(RoverTwinError):
    """The head of a request (address and headers) is over the limit."""

    def __init__(self, limit_bytes: int, limit_fields: int) -> None:
        super().__init__(
            f"the head of the request has more than {limit_bytes} bytes or {limit_fields} headers; a long query, such "
            "as one of many times_s, goes into the body of a POST"
        )


class HeadTooSlowError(RoverTwinError):
    """The head of a request did not come in time."""

    def __init__(self, limit_s: float) -> None:
        super().__init__(f"the head of the request did not come within {limit_s:g} s")


class MalformedHeadError(RoverTwinError):
    """What came is no HTTP request."""


class RepeatedHeaderError(RoverTwinError):
    """A header came several times that may come once."""

    def __init__(self, name: str) -> None:
        super().__init__(f"the header {name} was sent several times; send it once")


class PreconditionFailedError(RoverTwinError):
    """What `If-Match` or `If-None-Match` demands does not hold (any more)."""


class PreconditionRequiredError(RoverTwinError):
    """A change of something that others may change too came without `If-Match`."""


class BodyTooLargeError(HTTPException):
    """A request body is over the limit. A child of HTTPException: FastAPI hides all others that occur on reading."""

    def __init__(self, limit_bytes: int) -> None:
        super().__init__(413, f"the request body has more than {limit_bytes} bytes, which is the limit")
