"""Builds the calls about drives: whole ones, many at once, and steps. Both clients send these calls. No I/O."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from rover_twin_client import drive_parsing as parsing
from rover_twin_client.calls import Call, column, finite, flag, inclusions, refused, require_band, said
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
    optional = said(start_speed_m_s=start_speed_m_s, horizon_s=horizon_s, until_distance_m=until_distance_m)
    body = members({"mass_kg": mass_kg, "track": track, "controls": controls, **optional})
    body |= shared | ({"strict": True} if flag("strict", strict) else {})
    # The same question has the same answer: a POST only because a track does not fit an address.
    return Call("/v1/drives", parsing.drive, method="POST", json=body, read_s=LONGEST_DRIVE_READ_S)


def drive_batch(
    drives: Iterable[Mapping[str, Any]],
    *,
    mass_kg: float | None,
    track: Track | None,
    controls: Controls | None,
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
) -> Call[list[Drive | FailedDrive]]:
    """POST /v1/drives/batch?format=ndjson. Each drive is a mapping with the arguments of `drive` that are its own."""
    usual: dict[str, object] = said(mass_kg=mass_kg, track=track, controls=controls)
    usual |= said(start_speed_m_s=start_speed_m_s, horizon_s=horizon_s, until_distance_m=until_distance_m)
    body: dict[str, Any] = {"drives": [_own(at, given, usual) for at, given in enumerate(drives)], **members(usual)}
    body |= options(dt_s=dt_s, times_s=times_s, model=model, frame=frame, include=include, band_level=band_level)
    body |= {"strict": True} if flag("strict", strict) else {}
    return Call(
        "/v1/drives/batch",
        parsing.drive_lines,
        {"format": "ndjson"},
        method="POST",
        json=body,
        read_s=LONGEST_DRIVE_READ_S,
        is_document=False,
    )


def members(given: Mapping[str, object]) -> dict[str, Any]:
    """Members of the body that say what is driven; raises InvalidInputError for a value that cannot be one."""
    return {name: _MEMBERS[name](name, value) for name, value in given.items()}


def _own(at: int, given: object, usual: Mapping[str, object]) -> dict[str, Any]:
    """The members of one drive of a batch, whose drives share those that are `usual`."""
    if not isinstance(given, Mapping):
        raise refused(f"drives[{at}]", given, "a mapping with mass_kg, track and controls")
    own = {name: value for name, value in given.items() if value is not None}
    if not own.keys() <= _MEMBERS.keys() or not own.keys() | usual.keys() >= _NEEDED:
        allowed = (
            "mass_kg, track, controls, each unless all drives share it, and start_speed_m_s, horizon_s, "
            "until_distance_m where wanted"
        )
        raise refused(f"drives[{at}]", sorted(map(str, given)), allowed)
    return members(own)


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
    body: dict[str, Any] = {name: finite(name, value) for name, value in said(dt_s=dt_s, band_level=band_level).items()}
    wanted = inclusions(include)
    require_band(wanted, band_level)
    if times_s is not None:
        body["times_s"] = column("times_s", times_s)
    return body | said(model=model) | {"frame": frame} | ({"include": list(wanted)} if wanted else {})


def columns(name: str, given: Mapping[str, Any]) -> dict[str, list[Any]]:
    """Columns of numbers or flags as lists; raises InvalidInputError for anything else."""
    return {str(key): column(f"{name}.{key}", values) for key, values in given.items()}


def _track(name: str, given: object) -> dict[str, list[Any]]:
    if not isinstance(given, Mapping):
        raise refused(name, given, "a mapping: distance_m and slope_deg, or horizontal_m and elevation_m")
    return columns(name, given)


def _controls(name: str, given: object) -> dict[str, list[Any]] | float:
    return columns(name, given) if isinstance(given, Mapping) else finite(name, given)


_MEMBERS: Mapping[str, Callable[[str, object], Any]] = {
    "mass_kg": finite,
    "track": _track,
    "controls": _controls,
    "start_speed_m_s": finite,
    "horizon_s": finite,
    "until_distance_m": finite,
}
_NEEDED = {"mass_kg", "track", "controls"}
