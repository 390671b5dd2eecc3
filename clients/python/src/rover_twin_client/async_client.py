"""The asynchronous client: the same words as `RoverTwin`, awaited. For event loops that must not block."""

from __future__ import annotations

from collections.abc import Iterable
from types import TracebackType
from typing import Any, Self

import httpx

from rover_twin_client import calls
from rover_twin_client.answers import Frame, ModelInfo, Prediction, Readiness
from rover_twin_client.calls import Answer, Call
from rover_twin_client.network import (
    DEFAULT_RETRIES,
    DEFAULT_TIMEOUT,
    DEFAULT_URL,
    HEADERS,
    async_retrying,
    checked_retries,
    checked_url,
    named_failures,
)


class AsyncRoverTwin:
    """Talks to one rover-twin service from one event loop; close it, or use it in an `async with`.

    `timeout`, `retries` and `transport` are those of `RoverTwin`.
    """

    def __init__(
        self,
        base_url: str = DEFAULT_URL,
        *,
        timeout: float | httpx.Timeout = DEFAULT_TIMEOUT,
        retries: int = DEFAULT_RETRIES,
        transport: httpx.AsyncBaseTransport | None = None,
    ) -> None:
        self._url = checked_url(base_url)
        self._retries = checked_retries(retries)
        self._http = httpx.AsyncClient(base_url=self._url, headers=HEADERS, timeout=timeout, transport=transport)

    async def predict(
        self,
        slope_deg: float,
        mass_kg: float,
        torque_nm: float,
        horizon_s: float = 10.0,
        *,
        dt_s: float | None = None,
        model: str | None = None,
        frame: Frame = "slope",
        include: Iterable[str] = (),
        strict: bool = False,
        band_level: float | None = None,
    ) -> Prediction:
        """Where the rover goes: arguments, units and errors are those of `RoverTwin.predict`."""
        return await self._answer(
            calls.predict(
                slope_deg,
                mass_kg,
                torque_nm,
                horizon_s,
                dt_s=dt_s,
                model=model,
                frame=frame,
                include=include,
                strict=strict,
                band_level=band_level,
            )
        )

    async def models(self) -> list[ModelInfo]:
        """Every model of the service's store."""
        return await self._answer(calls.models())

    async def model(self, name: str) -> ModelInfo:
        """One model with its description; raises NotFoundError."""
        return await self._answer(calls.model(name))

    async def manifest(self, name: str, version: int) -> dict[str, Any]:
        """What was published with a version: files and digests, domain, metrics, lineage; raises NotFoundError."""
        return await self._answer(calls.manifest(name, version))

    async def ready(self) -> Readiness:
        """Which model answers by default; raises NotReadyError at once, without retrying, when none can."""
        return await self._answer(calls.ready())

    async def aclose(self) -> None:
        """Closes the connections; the client cannot be used afterwards."""
        await self._http.aclose()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, fault: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.aclose()

    async def _answer(self, call: Call[Answer]) -> Answer:
        return await async_retrying(self._retries if call.retried else 0)(self._attempt, call)

    async def _attempt(self, call: Call[Answer]) -> Answer:
        with named_failures(self._url):
            response = await self._http.get(call.path, params=dict(call.query))
        return call.read(response.status_code, response.headers, response.content)
