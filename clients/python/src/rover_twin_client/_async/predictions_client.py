"""Predictions: one, and many at once."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import overload

from rover_twin_client import calls
from rover_twin_client._async.drives_client import AsyncDrivesClient
from rover_twin_client.answers import Frame, Prediction
from rover_twin_client.batch import calls as batch_calls
from rover_twin_client.batch import parsing as batch_parsing
from rover_twin_client.batch.answers import Batch
from rover_twin_client.batch.calls import BatchWork
from rover_twin_client.batch.columns import Numbers, Scenarios
from rover_twin_client.concurrency.together_async import together
from rover_twin_client.errors import RefusedError
from rover_twin_client.progress import Progress, reporting


class AsyncPredictionsClient(AsyncDrivesClient):
    """Where a rover goes on one slope, under one torque."""

    @overload
    async def predict(
        self,
        slope_deg: float,
        mass_kg: float,
        torque_nm: float,
        horizon_s: float | None = None,
        *,
        dt_s: float | None = None,
        times_s: Iterable[float] | None = None,
        model: str | None = None,
        frame: Frame = "slope",
        include: Iterable[str] = (),
        strict: bool = False,
        band_level: float | None = None,
        form: None = None,
        save_to: None = None,
    ) -> Prediction: ...

    @overload
    async def predict(
        self,
        slope_deg: float,
        mass_kg: float,
        torque_nm: float,
        horizon_s: float | None = None,
        *,
        dt_s: float | None = None,
        times_s: Iterable[float] | None = None,
        model: str | None = None,
        frame: Frame = "slope",
        include: Iterable[str] = (),
        strict: bool = False,
        band_level: float | None = None,
        form: str,
        save_to: None = None,
    ) -> bytes: ...

    @overload
    async def predict(
        self,
        slope_deg: float,
        mass_kg: float,
        torque_nm: float,
        horizon_s: float | None = None,
        *,
        dt_s: float | None = None,
        times_s: Iterable[float] | None = None,
        model: str | None = None,
        frame: Frame = "slope",
        include: Iterable[str] = (),
        strict: bool = False,
        band_level: float | None = None,
        form: str | None = None,
        save_to: str | os.PathLike[str],
    ) -> Path: ...

    async def predict(
        self,
        slope_deg: float,
        mass_kg: float,
        torque_nm: float,
        horizon_s: float | None = None,
        *,
        dt_s: float | None = None,
        times_s: Iterable[float] | None = None,
        model: str | None = None,
        frame: Frame = "slope",
        include: Iterable[str] = (),
        strict: bool = False,
        band_level: float | None = None,
        form: str | None = None,
        save_to: str | os.PathLike[str] | None = None,
    ) -> Prediction | bytes | Path:
        """Predicts where the rover goes on this slope, with this mass and this motor stall torque per wheel.

        `horizon_s` is how long the rover drives, in seconds, by default 10. `dt_s` is the spacing of the predicted
        times, in seconds; the service chooses it when it is None. `times_s` are the times themselves, rising, instead
        of both: the last one is the horizon. `model` is `name`, `name@3` or `name@alias`. `frame` is `slope` or
        `world`.

        `include=["prior"]` adds the closed-form trajectory. `include=["band"]` adds lower and upper bounds of x and y,
        in the slope frame only. `band_level` (0.5 to 0.99) is the pointwise coverage of that band; the service chooses
        it when it is None. `include=["speed"]` adds the speed along the slope, `include=["wheel_speed"]` how fast rear
        and front wheels turn; a version that does not know that refuses it. `strict` refuses a scenario outside the
        validated domain. Without it, the answer marks such a scenario in `domain`.

        With `form` (csv, npz, arrow, usda, svg, png, json and what else the service has) the answer is that file, as
        bytes. With `save_to` it is written there, completely or not at all, and its path is returned; without `form`
        the ending of the name says which one. An older file keeps its mode, a symbolic link stays one, and a pipe is
        written into. A place that cannot be written raises an OSError with that path.

        Raises InvalidInputError for a value out of range, OutsideDomainError with `strict`, NotFoundError for an
        unknown model. Failures of the network and of the service raise the other errors of `rover_twin_client.errors`.
        """
        call = calls.predict(
            slope_deg,
            mass_kg,
            torque_nm,
            horizon_s,
            dt_s=dt_s,
            times_s=times_s,
            model=model,
            frame=frame,
            include=include,
            strict=strict,
            band_level=band_level,
        )
        return await self._answer_as(call, form, save_to)

    async def predict_batch(
        self,
        scenarios: Scenarios | None = None,
        *,
        slope_deg: Numbers | None = None,
        mass_kg: Numbers | None = None,
        torque_nm: Numbers | None = None,
        horizon_s: Numbers | None = None,
        dt_s: float | None = None,
        times_s: Iterable[float] | None = None,
        model: str | None = None,
        frame: Frame = "slope",
        include: Iterable[str] = (),
        strict: bool = False,
        band_level: float | None = None,
        progress: Progress = False,
    ) -> Batch:
        """Predicts any number of scenarios, in the order given; one that is refused sinks no other.

        `scenarios` are mappings with `slope_deg`, `mass_kg`, `torque_nm`, and `horizon_s` where wanted; or these as
        columns: a mapping of arrays, a table of pandas or polars (that of a `Batch` too). What is given as an argument
        is not in them: a number holds for all, an array has one for each. Arrays alone do too:
        `predict_batch(slope_deg=[10, 20], mass_kg=430, torque_nm=60)`. The other arguments are those of `predict`, for
        all of them.

        A scenario that cannot be read, with a text for a mass or a field that there is not, is a failure like one that
        the service refuses. So is a `horizon_s` of NaN; where it is None or missing, the service chooses.

        The scenarios go in several requests, some at once; all are answered by one version. `progress=True` counts on
        standard error, with a bar where tqdm or rich is installed and as a line of text elsewhere; a function is called
        with how many are done, and of how many.

        Raises what `predict` raises for what concerns all of them, and InvalidInputError when not one can be read.
        """
        own = {"slope_deg": slope_deg, "mass_kg": mass_kg, "torque_nm": torque_nm, "horizon_s": horizon_s}
        question = batch_calls.question(
            scenarios,
            own,
            dt_s=dt_s,
            times_s=times_s,
            model=model,
            frame=frame,
            include=include,
            strict=strict,
            band_level=band_level,
        )
        with reporting(progress, question.count, "scenarios") as report:
            work = BatchWork(question, report)
            await self._work(work, first=True)
            if work.workers():
                await together(lambda: self._work(work), work.workers(), work.abandon)
        return batch_parsing.batch(question.columns, work.pieces, question.unreadable)

    async def _work(self, work: BatchWork, *, first: bool = False) -> None:
        while (span := work.take_first() if first else work.take()) is not None:
            try:
                piece = await self._answer(work.call(span))
            except RefusedError as error:
                work.refused(span, error)
            else:
                work.answered(span, piece)
