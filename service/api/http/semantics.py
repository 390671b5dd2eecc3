"""What HTTP asks of every address alike: HEAD wherever there is GET."""

from __future__ import annotations

import anyio
from starlette.types import ASGIApp, Message, Receive, Scope, Send


class Semantics:
    """ASGI middleware. A HEAD is answered as the GET is, with its headers and without its body."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI."""
        if scope["type"] != "http" or scope["method"] != "HEAD":
            await self.app(scope, receive, send)
            return
        with anyio.CancelScope() as enough:

            async def without_body(message: Message) -> None:
                if message["type"] == "http.response.start":
                    await send(message)
                    # a stream of events would go on for hours
                    await send({"type": "http.response.body", "body": b"", "more_body": False})
                    enough.cancel()

            # of a HEAD no part is asked: whoever asks wants to know the whole
            headers = [each for each in scope["headers"] if each[0] != b"range"]
            await self.app({**scope, "method": "GET", "headers": headers}, receive, without_body)
