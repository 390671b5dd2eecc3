"""The asynchronous client: the same words as `RoverTwin`, awaited. For event loops that must not block."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from rover_twin_client import calls
from rover_twin_client.answers import Frame, MobilityMap, ModelInfo, Prediction, Readiness, SuggestedRuns
from rover_twin_client.async_training_client import AsyncTrainingClient


class AsyncRoverTwin(AsyncTrainingClient):
    """Talks to one rover-twin service from one event loop; close it, or use it in an `async with`.

    The arguments are those of `RoverTwin`.
    """

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

    async def mobility(
        self,
        mass_kg: float,
        torque_min_nm: float,
        torque_max_nm: float | None = None,
        horizon_s: float = 10.0,
        *,
        torque_steps: int | None = None,
        slope_min_deg: float | None = None,
        slope_max_deg: float | None = None,
        slope_steps: int | None = None,
        confidence: float | None = None,
        model: str | None = None,
    ) -> MobilityMap:
        """Where a rover of this mass climbs: arguments, units and errors are those of `RoverTwin.mobility`."""
        return await self._answer(
            calls.mobility(
                mass_kg,
                torque_min_nm,
                torque_max_nm,
                horizon_s,
                torque_steps=torque_steps,
                slope_min_deg=slope_min_deg,
                slope_max_deg=slope_max_deg,
                slope_steps=slope_steps,
                confidence=confidence,
                model=model,
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

    async def suggested_runs(self, name: str, version: int, n: int | None = None) -> SuggestedRuns:
        """Which scenarios to simulate next: arguments and errors are those of `RoverTwin.suggested_runs`."""
        return await self._answer(calls.suggested_runs(name, version, n))

    async def ready(self) -> Readiness:
        """Which model answers by default; raises NotReadyError at once, without retrying, when none can."""
        return await self._answer(calls.ready())
