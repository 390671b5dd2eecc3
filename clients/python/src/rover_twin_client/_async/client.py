"""Mobility maps and models, asked over the network."""

from __future__ import annotations

from typing import Any

from rover_twin_client import calls
from rover_twin_client._async.predictions_client import AsyncPredictionsClient
from rover_twin_client.answers import MobilityMap, ModelInfo, Readiness, SuggestedRuns


class AsyncRoverTwin(AsyncPredictionsClient):
    """A client of one rover-twin service. Use it from one event loop. Close it, or use it in `async with`.

    It maps mobility and describes models; `AsyncPredictionsClient` predicts, `AsyncDrivesClient` adds drives and steps,
    `AsyncTrainingClient` datasets, training jobs and aliases. `AsyncConnection` explains the arguments.
    """

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
        """Maps where a rover of this mass climbs, stalls or slides: a row for each torque, a column for each slope.

        `torque_min_nm` and `torque_max_nm` are the first and the last motor stall torque per wheel. Without
        `torque_max_nm` the map has one row. `slope_min_deg` and `slope_max_deg` are the first and the last slope.
        `torque_steps` and `slope_steps` (2 to 64) are the numbers of rows and columns. The service's defaults are 10
        torques, and 36 slopes from 0 to 35 degrees.

        `confidence` (0.75 to 0.995, by default 0.9) is the required confidence that the rover climbs the steepest slope
        of each torque. A version without a band uses its central estimate instead. `model` is that of `predict`.

        Raises InvalidInputError for a value out of range, for a range that ends before it starts, and for a map that
        costs too much (torques x slopes x `horizon_s`). Otherwise it raises what `predict` raises.
        """
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
        """Lists every model of the service's store."""
        return await self._answer(calls.models())

    async def model(self, name: str) -> ModelInfo:
        """Describes one model; raises NotFoundError."""
        return await self._answer(calls.model(name))

    async def manifest(self, name: str, version: int) -> dict[str, Any]:
        """Returns what a version was published with: files, digests, domain, metrics, lineage; raises NotFoundError."""
        return await self._answer(calls.manifest(name, version))

    async def suggested_runs(self, name: str, version: int, n: int | None = None) -> SuggestedRuns:
        """Suggests `n` scenarios (1 to 64, by default 8) to simulate next: those that lower the error the most.

        Raises NotFoundError for an unknown version, InvalidInputError for one that does not list its training runs.
        """
        return await self._answer(calls.suggested_runs(name, version, n))

    async def ready(self) -> Readiness:
        """Tells which model answers by default. Raises NotReadyError at once when none can; it is never retried."""
        return await self._answer(calls.ready())
