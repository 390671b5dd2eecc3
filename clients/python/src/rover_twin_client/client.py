"""The synchronous client."""

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
    checked_retries,
    checked_url,
    named_failures,
    retrying,
)


class RoverTwin:
    """Talks to one rover-twin service. Safe to share between threads; close it, or use it in a `with`.

    `timeout` is in seconds for each of connecting, sending and reading (or an httpx.Timeout naming them one by
    one). `retries` is how many further tries a broken connection or a 503 with Retry-After gets. `transport`
    replaces the network, for instance by a proxy or a test's own.
    """

    def __init__(
        self,
        base_url: str = DEFAULT_URL,
        *,
        timeout: float | httpx.Timeout = DEFAULT_TIMEOUT,
        retries: int = DEFAULT_RETRIES,
        transport: httpx.BaseTransport | None = None,
    ) -> None:
        self._url = checked_url(base_url)
        self._retries = checked_retries(retries)
        self._http = httpx.Client(base_url=self._url, headers=HEADERS, timeout=timeout, transport=transport)

    def predict(
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
        """Where the rover goes on this slope, with this mass and motor stall torque per wheel, for this long.

        `dt_s` is the spacing of the answer's times in seconds (the service's default without it). `model` is
        `name`, `name@3` or `name@alias`. `frame` is `slope` or `world`. `include=["prior"]` adds the closed-form
        trajectory; `include=["band"]` adds bounds of x and y that hold the truth a share `band_level` of all times
        (0.5 to 0.99, the service's default without it; slope frame only). `strict` refuses scenarios outside the
        validated domain instead of flagging them.

        Raises InvalidInputError for values out of range (OutsideDomainError with `strict`), NotFoundError for an
        unknown model, and the network's and service's own failures (see `rover_twin_client.errors`).
        """
        return self._answer(
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

    def models(self) -> list[ModelInfo]:
        """Every model of the service's store."""
        return self._answer(calls.models())

    def model(self, name: str) -> ModelInfo:
        """One model with its description; raises NotFoundError."""
        return self._answer(calls.model(name))

    def manifest(self, name: str, version: int) -> dict[str, Any]:
        """What was published with a version: files and digests, domain, metrics, lineage; raises NotFoundError."""
        return self._answer(calls.manifest(name, version))

    def ready(self) -> Readiness:
        """Which model answers by default; raises NotReadyError at once, without retrying, when none can."""
        return self._answer(calls.ready())

    def close(self) -> None:
        """Closes the connections; the client cannot be used afterwards."""
        self._http.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, fault: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _answer(self, call: Call[Answer]) -> Answer:
        answer: Answer = retrying(self._retries if call.retried else 0)(self._attempt, call)
        return answer

    def _attempt(self, call: Call[Answer]) -> Answer:
        with named_failures(self._url):
            response = self._http.get(call.path, params=dict(call.query))
        return call.read(response.status_code, response.headers, response.content)
