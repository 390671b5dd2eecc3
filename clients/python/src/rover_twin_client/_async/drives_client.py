"""Drives: whole tracks, many of them at once, and live steps."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, overload

from rover_twin_client import drive_calls as calls
from rover_twin_client._async.live import AsyncLive
from rover_twin_client._async.training_client import AsyncTrainingClient
from rover_twin_client.answers import Frame
from rover_twin_client.drives import Controls, Drive, FailedDrive, Track, Transport


class AsyncDrivesClient(AsyncTrainingClient):
    """Where a rover goes along a track whose slope changes, under torques that change."""

    @overload
    async def drive(
        self,
        mass_kg: float,
        track: Track,
        controls: Controls,
        *,
        start_speed_m_s: float | None = None,
        horizon_s: float | None = None,
        until_distance_m: float | None = None,
        dt_s: float | None = None,
        times_s: Sequence[float] | None = None,
        model: str | None = None,
        frame: Frame = "slope",
        include: Iterable[str] = (),
        band_level: float | None = None,
        strict: bool = False,
        form: None = None,
        save_to: None = None,
    ) -> Drive: ...

    @overload
    async def drive(
        self,
        mass_kg: float,
        track: Track,
        controls: Controls,
        *,
        start_speed_m_s: float | None = None,
        horizon_s: float | None = None,
        until_distance_m: float | None = None,
        dt_s: float | None = None,
        times_s: Sequence[float] | None = None,
        model: str | None = None,
        frame: Frame = "slope",
        include: Iterable[str] = (),
        band_level: float | None = None,
        strict: bool = False,
        form: str,
        save_to: None = None,
    ) -> bytes: ...

    @overload
    async def drive(
        self,
        mass_kg: float,
        track: Track,
        controls: Controls,
        *,
        start_speed_m_s: float | None = None,
        horizon_s: float | None = None,
        until_distance_m: float | None = None,
        dt_s: float | None = None,
        times_s: Sequence[float] | None = None,
        model: str | None = None,
        frame: Frame = "slope",
        include: Iterable[str] = (),
        band_level: float | None = None,
        strict: bool = False,
        form: str | None = None,
        save_to: str | os.PathLike[str],
    ) -> Path: ...

    async def drive(
        self,
        mass_kg: float,
        track: Track,
        controls: Controls,
        *,
        start_speed_m_s: float | None = None,
        horizon_s: float | None = None,
        until_distance_m: float | None = None,
        dt_s: float | None = None,
        times_s: Sequence[float] | None = None,
        model: str | None = None,
        frame: Frame = "slope",
        include: Iterable[str] = (),
        band_level: float | None = None,
        strict: bool = False,
        form: str | None = None,
        save_to: str | os.PathLike[str] | None = None,
    ) -> Drive | bytes | Path:
        """Predicts a drive along `track` under `controls`.

        `track` is `{"distance_m": [...], "slope_deg": [...]}`, slope over the distance along the surface, or
        `{"horizontal_m": [...], "elevation_m": [...]}`. `controls` is one stall torque per wheel (N m), or
        `{"time_s": [...], "torque_nm": [...], "brake": [...]}`, each from its time to the next. Lists and arrays will
        do. Without `start_speed_m_s` the rover is parked and let go. The drive ends after `horizon_s` (the service's
        default is 20 s), or where it reaches `until_distance_m`. `times_s` are the times to answer at, instead of
        `dt_s`. `include=["band"]` adds the interval, `include=["wheel_speed"]` how fast the wheels turn. `model`,
        `frame`, `band_level`, `strict`, `form` and `save_to` are those of `predict`.

        Raises what `predict` raises.
        """
        call = calls.drive(
            mass_kg,
            track,
            controls,
            start_speed_m_s=start_speed_m_s,
            horizon_s=horizon_s,
            until_distance_m=until_distance_m,
            dt_s=dt_s,
            times_s=times_s,
            model=model,
            frame=frame,
            include=include,
            band_level=band_level,
            strict=strict,
        )
        return await self._answer_as(call, form, save_to)

    async def drive_batch(
        self,
        drives: Iterable[Mapping[str, Any]],
        *,
        mass_kg: float | None = None,
        track: Track | None = None,
        controls: Controls | None = None,
        start_speed_m_s: float | None = None,
        horizon_s: float | None = None,
        until_distance_m: float | None = None,
        dt_s: float | None = None,
        times_s: Sequence[float] | None = None,
        model: str | None = None,
        frame: Frame = "slope",
        include: Iterable[str] = (),
        band_level: float | None = None,
        strict: bool = False,
    ) -> list[Drive | FailedDrive]:
        """Predicts many drives in one request, in the order given; a drive that is refused sinks no other.

        Each is a mapping with `mass_kg`, `track` and `controls`, and `start_speed_m_s`, `horizon_s` and
        `until_distance_m` where wanted. What is given as an argument holds for each drive that says nothing else: one
        track for many rovers, or the reverse. The other arguments are those of `drive`, for all of them.

        Raises what `drive` raises for what concerns all of them, and InvalidInputError for a drive that lacks a mass, a
        track or controls.
        """
        return await self._answer(
            calls.drive_batch(
                drives,
                mass_kg=mass_kg,
                track=track,
                controls=controls,
                start_speed_m_s=start_speed_m_s,
                horizon_s=horizon_s,
                until_distance_m=until_distance_m,
                dt_s=dt_s,
                times_s=times_s,
                model=model,
                frame=frame,
                include=include,
                band_level=band_level,
                strict=strict,
            )
        )

    def live(self, model: str | None = None, transport: Transport = "websocket") -> AsyncLive:
        """Steps rovers while a simulator drives them; use it in `async with`.

        `websocket` keeps one connection open and is the faster one, `http` sends a request for each step. A rover's
        first step decides its version: with `model` that one, without it the service's default.
        """
        return AsyncLive(self, model, transport)
