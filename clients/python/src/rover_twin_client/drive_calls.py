"""Builds the calls about drives: whole ones, many at once, and steps. Both clients send these calls. No I/O."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from rover_twin_client import drive_parsing as parsing
from rover_twin_client.calls import Call, number, refused, said
from rover_twin_client.drives import Controls, Drive, FailedDrive, Track

LONGEST_DRIVE_READ_S = 60.0


def drive(
    mass_kg: float,
    track: Track,
    controls: Controls,
    *,
    start_speed_m_s: float | None,
    horizon_s: float | None,
    until_distance_m: float | None,
    dt_s: float | None,
    times_s: Sequence[float] | None,
    model: str | None,
    frame: str,
    include: Iterable[str],
    band_level: float | None,
    strict: bool,
) -> Call[Drive]:
    """POST /v1/drives. The service checks the ranges; this refuses only what is not a number, a track or controls."""
    shared = options(dt_s=dt_s, times_s=times_s, model=model, frame=frame, include=include, band_level=band_level)
    body = one(
        mass_kg,
        track,
        controls,
        start_speed_m_s=start_speed_m_s,
        horizon_s=horizon_s,
        until_distance_m=until_distance_m,
    )
    body |= shared | ({"strict": True} if strict else {})
    # The same question has the same answer: a POST only because a track does not fit an address.
    return Call("/v1/drives", parsing.drive, method="POST", json=body, read_s=LONGEST_DRIVE_READ_S)


def drive_batch(
    drives: Iterable[Mapping[str, Any]],
    *,
    dt_s: float | None,
    times_s: Sequence[float] | None,
    model: str | None,
    frame: str,
    include: Iterable[str],
    band_level: float | None,
    strict: bool,
) -> Call[list[Drive | FailedDrive]]:
    """POST /v1/drives/batch?format=ndjson. Each drive is a mapping with the arguments of `drive` that are its own."""
    each = []
    for at, given in enumerate(drives):
        if not isinstance(given, Mapping):
            raise refused(f"drives[{at}]", given, "a mapping with mass_kg, track and controls")
        try:
            each.append(one(**given))
        except TypeError as fault:
            allowed = "mass_kg, track, controls, and start_speed_m_s, horizon_s, until_distance_m where wanted"
            raise refused(f"drives[{at}]", sorted(map(str, given)), allowed) from fault
    body: dict[str, Any] = {"drives": each}
    body |= options(dt_s=dt_s, times_s=times_s, model=model, frame=frame, include=include, band_level=band_level)
    body |= {"strict": True} if strict else {}
    return Call(
        "/v1/drives/batch",
        parsing.drive_lines,
        {"format": "ndjson"},
        method="POST",
        json=body,
        read_s=LONGEST_DRIVE_READ_S,
        is_document=False,
    )


def one(
    mass_kg: float,
    track: Track,
    controls: Controls,
    *,
    start_speed_m_s: float | None = None,
    horizon_s: float | None = None,
    until_distance_m: float | None = None,
) -> dict[str, Any]:
    """The members of the body that say what is driven."""
    if not isinstance(track, Mapping):
        raise refused("track", track, "a mapping: distance_m and slope_deg, or horizontal_m and elevation_m")
    told: Any = columns("controls", controls) if isinstance(controls, Mapping) else number("controls", controls)
    numbers = said(start_speed_m_s=start_speed_m_s, horizon_s=horizon_s, until_distance_m=until_distance_m)
    return {
        "mass_kg": number("mass_kg", mass_kg),
        "track": columns("track", track),
        "controls": told,
        **{name: number(name, value) for name, value in numbers.items()},
    }


def options(
    *,
    dt_s: float | None,
    times_s: Sequence[float] | None,
    model: str | None,
    frame: str,
    include: Iterable[str],
    band_level: float | None,
) -> dict[str, Any]:
    """The members of the body that say how to answer."""
    body: dict[str, Any] = {name: number(name, value) for name, value in said(dt_s=dt_s, band_level=band_level).items()}
    if times_s is not None:
        body["times_s"] = column("times_s", times_s)
    wanted = [include] if isinstance(include, str) else list(include)
    return body | said(model=model) | {"frame": frame} | ({"include": wanted} if wanted else {})


def columns(name: str, given: Mapping[str, Any]) -> dict[str, list[Any]]:
    """Columns of numbers or flags as lists; raises InvalidInputError for anything else."""
    return {str(key): column(f"{name}.{key}", values) for key, values in given.items()}


def column(name: str, values: object) -> list[Any]:
    """One column as a list; raises InvalidInputError unless it is a flat list of numbers or flags."""
    try:
        found = np.asarray(values)
    except ValueError as ragged:
        raise refused(name, "a ragged list", "a flat list of numbers") from ragged
    if found.ndim != 1 or (found.size and found.dtype.kind not in "fiub"):
        raise refused(name, values, "a flat list of numbers")
    if found.dtype.kind == "f" and not np.isfinite(found).all():
        raise refused(name, float(found[~np.isfinite(found)][0]), "finite numbers")
    listed: list[Any] = found.tolist()
    return listed
