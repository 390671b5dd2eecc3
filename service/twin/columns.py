"""From what a model says to the columns of an answer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from service.physics.frames import slope_to_world
from service.physics.scenario import Array, Motion, Positions, Scenarios
from service.twin.one import Asked
from service.twin.prediction import Frame, PredictionBand


def first_row(columns: Mapping[str, Array]) -> dict[str, Array]:
    """Columns (scenario, time) of the first scenario alone."""
    return {name: column[0] for name, column in columns.items()}


def first_prior(prior: Positions | None, physics: Scenarios, frame: Frame) -> Mapping[str, Array] | None:
    """The first scenario's prior in a frame, (time,)."""
    return None if prior is None else first_row(in_frame(prior, physics, frame))


def first_band(band: PredictionBand | None) -> PredictionBand | None:
    """The first scenario's band."""
    return None if band is None else PredictionBand(band.level, **first_row(band.columns()))


def positions_of(prior: Positions | None) -> Sequence[Array]:
    """The arrays of a prior, if there is one."""
    return () if prior is None else (prior.x_m, prior.y_m)


def bounds_of(band: PredictionBand | None) -> Sequence[Array]:
    """The arrays of a band, if there is one."""
    return () if band is None else tuple(band.columns().values())


def in_frame(positions: Positions, physics: Scenarios, frame: Frame) -> Mapping[str, Array]:
    """Positions as columns of the frame, shape (scenario, time)."""
    if frame is Frame.SLOPE:
        return {"x_m": positions.x_m, "y_m": positions.y_m}
    horizontal, up = slope_to_world(positions.x_m, positions.y_m, physics.slope_angle_rad[:, None])
    return {"x_m": horizontal, "z_m": up}


def speeds(shown: Positions, asked: Asked) -> Mapping[str, Array]:
    """The speeds that were asked for, as columns."""
    if not isinstance(shown, Motion):
        return {}
    columns = {"speed_m_s": shown.speed_m_s} if asked.speed else {}
    if asked.wheel_speed:
        wheels = {"rear_wheel_speed_rad_s": shown.rear_wheel_speed_rad_s}
        wheels["front_wheel_speed_rad_s"] = shown.front_wheel_speed_rad_s
        columns |= {name: column for name, column in wheels.items() if column is not None}
    return columns
