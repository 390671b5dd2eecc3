"""The synchronous client."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from rover_twin_client import calls
from rover_twin_client.answers import Frame, MobilityMap, ModelInfo, Prediction, Readiness, SuggestedRuns
from rover_twin_client.training_client import TrainingClient


class RoverTwin(TrainingClient):
    """Talks to one rover-twin service: predictions and models here, datasets and training in `TrainingClient`.

    Safe to share between threads; close it, or use it in a `with`. The arguments are those of `Connection`.
    """

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

    def mobility(
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
        """Where a rover of this mass climbs, stalls and slides, over torques (rows) and slopes (columns).

        `torque_min_nm` and `torque_max_nm` are the motor stall torques per wheel at the ends of the rows, both
        included; without the latter there is one row. `torque_steps` and `slope_steps` (2 to 64) say how many there
        are, `slope_min_deg` and `slope_max_deg` which slopes; the service's defaults are 10 torques, and 36 slopes
        from 0 to 35 degrees. `confidence` (0.75 to 0.995, 0.9 without it) is how sure the steepest slope must be
        climbed; versions without a band go by their central estimate. `model` is that of `predict`.

        Raises InvalidInputError for values out of range, for a range that ends before it starts and for a map that
        costs too much (torques x slopes x `horizon_s`); otherwise what `predict` raises.
        """
        return self._answer(
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

    def models(self) -> list[ModelInfo]:
        """Every model of the service's store."""
        return self._answer(calls.models())

    def model(self, name: str) -> ModelInfo:
        """One model with its description; raises NotFoundError."""
        return self._answer(calls.model(name))

    def manifest(self, name: str, version: int) -> dict[str, Any]:
        """What was published with a version: files and digests, domain, metrics, lineage; raises NotFoundError."""
        return self._answer(calls.manifest(name, version))

    def suggested_runs(self, name: str, version: int, n: int | None = None) -> SuggestedRuns:
        """Which scenarios to simulate next (`n` of them, 1 to 64; 8 without it) to lower this version's error the most.

        Raises NotFoundError, and InvalidInputError for a version whose manifest does not list its training runs.
        """
        return self._answer(calls.suggested_runs(name, version, n))

    def ready(self) -> Readiness:
        """Which model answers by default; raises NotReadyError at once, without retrying, when none can."""
        return self._answer(calls.ready())
