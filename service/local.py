"""Rover Twin without a server: for notebooks and simulators that want the answer inside their own process.

    from service.local import load

    twin = load("viper-lunar")
    print(twin.predict(slope_deg=28, mass_kg=430, torque_nm=60, horizon_s=10).summary.outcome)
    track = {"distance_m": [0, 2, 2.3], "slope_deg": [10, 10, 20]}
    print(twin.drive(430, track, 100, horizon_s=20).summary.final_x_m)

    live = twin.live()
    live.start("rover", mass_kg=430, slope_deg=10)
    print(live.step("rover", slope_deg=10, torque_nm=100, dt_s=0.1).x_m)

The answers are those of `/v1/predictions`, `/v1/drives` and `/v1/steps`. Nothing here imports the web, or reads the
environment. Loading takes a tenth of a second, a prediction or a drive about a millisecond.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike, fspath
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

import model_store
from model_store import ModelStore
from service.errors import InvalidValueError
from service.learning.band import USUAL_LEVEL
from service.learning.drive.inputs import Controls
from service.physics.scenario import Array
from service.twin import Frame, Prediction, Scenario, Twin, sample_times
from service.twin.drives import HORIZON_S, LONGEST_S, Drive, DriveQuestion, Ground, Wanted, controls_of, drive
from service.twin.load import load_twin
from service.twin.steps import Live, Moments

Track: TypeAlias = Mapping[str, Sequence[float] | Array]
Told: TypeAlias = float | Mapping[str, Any]

_SHIPPED = Path(model_store.__file__).parent  # the models lie beside the modules
_TRACKS = ({"distance_m", "slope_deg"}, {"horizontal_m", "elevation_m"})


def load(model: str = "viper-lunar@champion", store: str | PathLike[str] | None = None) -> LocalTwin:
    """A version of a model: `name`, `name@3` or `name@alias`; the alias is `champion` where none is named.

    `store` is a directory or a URL of a store; without it the models that ship with the program. Raises what the store
    raises (`model_store.StoreError`), and CheckpointError for a version that is whole but cannot predict.
    """
    opened = ModelStore.open(fspath(store) if store is not None else str(_SHIPPED))
    resolved = opened.resolve(model)
    return LocalTwin(load_twin(opened, resolved.name, resolved.version))


@dataclass(frozen=True, slots=True)
class LocalTwin:
    """One version in memory. Immutable: any number of threads may share it, but for what `live` returns."""

    twin: Twin

    @property
    def name(self) -> str:
        """Of model and version, as name@version."""
        return f"{self.twin.name}@{self.twin.version}"

    def predict(
        self,
        slope_deg: float,
        mass_kg: float,
        torque_nm: float,
        horizon_s: float = 10.0,
        *,
        dt_s: float = 0.05,
        times_s: Sequence[float] | Array | None = None,
        frame: str = "slope",
        include: Sequence[str] = (),
        band_level: float = USUAL_LEVEL,
    ) -> Prediction:
        """Where the rover goes from rest on a constant slope, with this stall torque of each wheel's motor.

        With `times_s`, rising, the last of them is the horizon. `include` may name `prior`, `band`, `speed` and
        `wheel_speed`. Raises InvalidValueError, which names field, value and what is allowed.
        """
        _require_parts(include, ("prior", "band", "speed", "wheel_speed"))
        times = sample_times(horizon_s, dt_s) if times_s is None else _rising("times_s", times_s)
        return self.twin.predict(
            Scenario(slope_deg, mass_kg, torque_nm, float(times[-1])),
            times,
            _frame(frame),
            band_level if "band" in include else None,
            with_prior="prior" in include,
            with_speed="speed" in include,
            with_wheel_speed="wheel_speed" in include,
        )

    def drive(
        self,
        mass_kg: float,
        track: Track,
        controls: Told,
        *,
        start_speed_m_s: float | None = None,
        horizon_s: float | None = None,
        until_distance_m: float | None = None,
        dt_s: float = 0.05,
        times_s: Sequence[float] | Array | None = None,
        frame: str = "slope",
        include: Sequence[str] = (),
        band_level: float = USUAL_LEVEL,
    ) -> Drive:
        """Where the rover goes along a track whose slope changes, under controls that change.

        `track` is `{"distance_m": ..., "slope_deg": ...}` or `{"horizontal_m": ..., "elevation_m": ...}`, `controls` a
        stall torque of each wheel's motor (N m) or `{"time_s": ..., "torque_nm": ..., "brake": ...}`. The drive ends
        after `horizon_s` (20 s; with a distance alone 600 s), or where it reaches `until_distance_m`. `include` may
        name `band` and `wheel_speed`. Raises InvalidValueError.
        """
        _require_parts(include, ("band", "wheel_speed"))
        times = None if times_s is None else _rising("times_s", times_s)
        if horizon_s is None:
            horizon_s = HORIZON_S if until_distance_m is None else LONGEST_S
        question = DriveQuestion(
            mass_kg=mass_kg,
            ground=ground_of(track),
            controls=_controls(controls),
            start_speed_m_s=start_speed_m_s,
            horizon_s=horizon_s if times is None else float(times[-1]),
            until_distance_m=until_distance_m,
        )
        wanted = Wanted(dt_s, times, _frame(frame), "band" in include, band_level, "wheel_speed" in include)
        return drive(self.twin, question, wanted)

    def live(self) -> Live:
        """Rovers by name that are moved on step by step: many at once, states out and in. For one thread."""
        return Live(self.twin)


def ground_of(track: Track) -> Ground:
    """The ground of a track. Raises InvalidValueError for one of other members, and what `Ground` raises."""
    members = set(track) if isinstance(track, Mapping) else set()
    if members not in _TRACKS:
        allowed = "distance_m and slope_deg, or horizontal_m and elevation_m"
        raise InvalidValueError("track", sorted(map(str, members)), allowed)
    if "distance_m" in track:
        return Ground.of_slopes(track["distance_m"], track["slope_deg"])
    return Ground.of_elevations(track["horizontal_m"], track["elevation_m"])


def _controls(told: Told) -> Controls:
    if not isinstance(told, Mapping):
        return controls_of([0.0], [float(told)])
    if not {"time_s", "torque_nm"} <= set(told) <= {"time_s", "torque_nm", "brake"}:
        raise InvalidValueError("controls", sorted(map(str, told)), "time_s and torque_nm, and brake where wanted")
    return controls_of(told["time_s"], told["torque_nm"], told.get("brake"))


def _frame(name: str) -> Frame:
    try:
        return Frame(name)
    except ValueError:
        raise InvalidValueError("frame", name, " or ".join(Frame)) from None


def _rising(field: str, values: Sequence[float] | Array) -> Array:
    times = np.asarray(values, dtype=np.float64)
    if times.ndim != 1 or not len(times) or not np.isfinite(times).all() or times[0] < 0 or (np.diff(times) <= 0).any():
        raise InvalidValueError(field, "other times", "one or more rising times from 0 on, in s")
    return times


def _require_parts(include: Sequence[str], known: tuple[str, ...]) -> None:
    if strangers := [each for each in include if each not in known]:
        raise InvalidValueError("include", strangers[0], "of " + ", ".join(known))


__all__ = ["Drive", "Live", "LocalTwin", "Moments", "Prediction", "Track", "load"]
