"""Rover Twin without a server: for notebooks and simulators that want the answer inside their own process.

    from service.local import load

    twin = load("viper-lunar")
    print(twin.predict(slope_deg=28, mass_kg=430, torque_nm=60, horizon_s=10).summary.outcome)
    track = {"distance_m": [0, 2, 2.3], "slope_deg": [10, 10, 20]}
    print(twin.drive(430, track, 100, horizon_s=20).summary.final_x_m)

    live = twin.live()
    live.start("rover", mass_kg=430, slope_deg=10)
    print(live.step("rover", slope_deg=10, torque_nm=100, dt_s=0.1).x_m)

Questions are read as `/v1/predictions` and `/v1/drives` read them, with the same ranges, and have the same answers;
`live` moves rovers as `/v1/steps` does. Nothing here imports the web, or reads the environment. Loading, a
prediction and a drive take some milliseconds each.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike, fspath
from pathlib import Path
from typing import Any, NoReturn, TypeAlias, TypeVar

import numpy as np
from pydantic import BaseModel, ValidationError

import model_store
from model_store import ModelStore
from service.errors import InvalidValueError
from service.physics.scenario import Array
from service.twin import Prediction, Twin
from service.twin.drives import Drive, drive
from service.twin.load import load_twin
from service.twin.steps import Live, Moments
from service.wire.drives.question import WORDS, DriveBody
from service.wire.faults import faults_of
from service.wire.prediction import ALLOWED, PredictionBody, require_few_points

Track: TypeAlias = Mapping[str, Sequence[float] | Array]
Told: TypeAlias = float | Mapping[str, Any]
Asked = TypeVar("Asked", bound=BaseModel)

MAX_POINTS = 100_000
"""Of one answer, as in the service."""

_SHIPPED = Path(model_store.__file__).parent  # the models lie beside the modules


def load(model: str = "viper-lunar@champion", store: str | PathLike[str] | None = None) -> LocalTwin:
    """A version of a model: `name`, `name@3` or `name@alias`; the alias is `champion` where none is named.

    `store` is a directory or a URL of a store; without it the models that ship with the program. Raises what the store
    raises (`model_store.StoreError`), and CheckpointError for a version that is whole but cannot predict.
    """
    if not isinstance(model, str):
        raise InvalidValueError("model", model, "name, name@version or name@alias")
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
        horizon_s: float | None = None,
        *,
        dt_s: float | None = None,
        times_s: Sequence[float] | Array | None = None,
        frame: str | None = None,
        include: str | Sequence[str] = (),
        band_level: float | None = None,
    ) -> Prediction:
        """Where the rover goes from rest on a constant slope, with this stall torque of each wheel's motor.

        `horizon_s` is 10 s and `dt_s` 0.05 s where nothing is said; with `times_s`, rising, the last of them is the
        horizon. `include` may name `prior`, `band`, `speed` and `wheel_speed`. Raises InvalidValueError, which names
        field, value and what is allowed.
        """
        scenario = {"slope_deg": slope_deg, "mass_kg": mass_kg, "torque_nm": torque_nm, "horizon_s": horizon_s}
        sampling = {"dt_s": dt_s, "times_s": times_s, "frame": frame, "band_level": band_level}
        asked = _read(PredictionBody, scenario | sampling | _parts(include), ALLOWED)
        require_few_points(asked, MAX_POINTS)
        question, times = asked.sampled()
        return self.twin.predict(
            question,
            times,
            asked.frame,
            asked.parts.band_level,
            with_prior=asked.parts.prior,
            with_speed=asked.parts.speed,
            with_wheel_speed=asked.parts.wheel_speed,
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
        dt_s: float | None = None,
        times_s: Sequence[float] | Array | None = None,
        frame: str | None = None,
        include: str | Sequence[str] = (),
        band_level: float | None = None,
    ) -> Drive:
        """Where the rover goes along a track whose slope changes, under controls that change.

        `track` is `{"distance_m": ..., "slope_deg": ...}` or `{"horizontal_m": ..., "elevation_m": ...}`, `controls` a
        stall torque of each wheel's motor (N m) or `{"time_s": ..., "torque_nm": ..., "brake": ...}`. The drive ends
        after `horizon_s` (20 s; with a distance alone 600 s), or where it reaches `until_distance_m`. `include` may
        name `band` and `wheel_speed`. Raises InvalidValueError.
        """
        what = {"mass_kg": mass_kg, "track": track, "controls": controls, "start_speed_m_s": start_speed_m_s}
        until = {"horizon_s": horizon_s, "until_distance_m": until_distance_m}
        sampling = {"dt_s": dt_s, "times_s": times_s, "frame": frame, "band_level": band_level}
        asked = _read(DriveBody, what | until | sampling | _parts(include), WORDS)
        return drive(self.twin, *asked.asked(MAX_POINTS))

    def live(self) -> Live:
        """Rovers by name that are moved on step by step: many at once, states out and in. For one thread."""
        return Live(self.twin)


def _parts(include: str | Sequence[str]) -> dict[str, Any]:
    parts = [include] if isinstance(include, str) else list(include)
    return {"include": parts} if parts else {}


def _read(model: type[Asked], sent: Mapping[str, Any], words: Mapping[str, str]) -> Asked:
    """The question as the service would read it from JSON. Raises InvalidValueError for the first wrong field."""
    needed = {name for name, field in model.model_fields.items() if field.is_required()}
    document = {name: _plain(value) for name, value in sent.items() if value is not None or name in needed}
    try:
        # numbers must be numbers and flags flags, all the way down: so pydantic is only with JSON
        return model.model_validate_json(json.dumps(document, default=str), strict=True)
    except ValidationError as error:
        _refuse(error, words)


def _plain(value: Any) -> Any:  # noqa: ANN401 - whatever a caller has
    """Arrays and numbers of NumPy, and sequences, as JSON would have them."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, Mapping):
        return {name: _plain(each) for name, each in value.items()}
    if isinstance(value, list | tuple | range):
        return [_plain(each) for each in value]
    return value


def _refuse(error: ValidationError, words: Mapping[str, str]) -> NoReturn:
    errors: list[dict[str, Any]] = [{**each, "loc": ("", *each["loc"])} for each in error.errors(include_url=False)]
    fault = faults_of(errors, words)[0]
    raise InvalidValueError(fault.field, fault.value, fault.allowed) from None


__all__ = ["Drive", "Live", "LocalTwin", "Moments", "Prediction", "Track", "load"]
