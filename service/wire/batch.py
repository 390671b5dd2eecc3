"""What a client sends to ask for many predictions at once: scenarios, each of which may be wrong, and what they share.

What they share is checked as a single prediction's fields are, and by the same model.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError, create_model

from service.allowed import Words
from service.errors import InvalidValueError
from service.physics.scenario import Array
from service.settings import LIMITS
from service.twin import ManyScenarios
from service.wire.faults import (
    InputFault,
    InvalidInputError,
    fault,
    faults_of,
    strangers_in,
    unknown_field,
)
from service.wire.points import bounded_grid, require_few_times
from service.wire.prediction import ALLOWED, HORIZON_S, PredictionBody, PredictionInputs

MAX_SCENARIOS = 1000

_FIELDS = PredictionInputs.model_fields
_OF_SCENARIO = ("slope_deg", "mass_kg", "torque_nm", "horizon_s")
_SHARED = tuple(name for name in _FIELDS if name not in _OF_SCENARIO)
BATCH_WORDS = Words(
    lambda: {
        **{name: ALLOWED[name] for name in (*_OF_SCENARIO, *_SHARED)},
        "scenarios": f"a list of 1 to {MAX_SCENARIOS} scenarios",
    }
)
"""What each field of a batch allows."""
_SCENARIO_WORDS = Words(lambda: {name: ALLOWED[name] for name in _OF_SCENARIO})
_BODY_FIELDS = ("scenarios", *_SHARED)
_NUMBERS = frozenset({float, int})  # of JSON, without true and false
_LOWEST, _HIGHEST = np.array(
    [(-LIMITS.slope_deg, LIMITS.slope_deg), LIMITS.mass_kg, LIMITS.torque_nm, LIMITS.horizon_s], dtype=np.float64
).T
_STAND_IN = {"slope_deg": 0.0, "mass_kg": 100.0, "torque_nm": 0.0}


class BatchScenario(BaseModel):
    """One of many scenarios."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)

    slope_deg: Annotated[float, *_FIELDS["slope_deg"].metadata, Field(description=_FIELDS["slope_deg"].description)]
    mass_kg: Annotated[float, *_FIELDS["mass_kg"].metadata, Field(description=_FIELDS["mass_kg"].description)]
    torque_nm: Annotated[float, *_FIELDS["torque_nm"].metadata, Field(description=_FIELDS["torque_nm"].description)]
    horizon_s: Annotated[
        float,
        *_FIELDS["horizon_s"].metadata,
        Field(description=_FIELDS["horizon_s"].description, default_factory=lambda: HORIZON_S),
    ]


_scenarios = TypeAdapter(list[BatchScenario], config=ConfigDict(defer_build=True))

_EXAMPLE: dict[str, Any] = {
    "scenarios": [
        {"slope_deg": 28, "mass_kg": 430, "torque_nm": 60},
        {"slope_deg": 20, "mass_kg": 550, "torque_nm": 60, "horizon_s": 5},
    ],
    "dt_s": 0.1,
}
_shared_fields: dict[str, Any] = {name: (_FIELDS[name].annotation, _FIELDS[name]) for name in _SHARED}
BatchBody = create_model(
    "BatchBody",
    __config__=ConfigDict(extra="forbid", json_schema_extra={"examples": [_EXAMPLE]}),
    __doc__="Many scenarios, and the fields that they share.",
    scenarios=(
        list[BatchScenario],
        Field(
            min_length=1,
            max_length=MAX_SCENARIOS,
            description="The scenarios. Refused ones are listed in `errors`; the others are answered.",
        ),
    ),
    **_shared_fields,
)
"""The body as the OpenAPI document shows it; `read_batch` reads it."""


@dataclass(frozen=True, slots=True, eq=False)
class BatchQuestion:
    """What was asked. `indices` (row,) are the places of `scenarios` among all that were sent, of which `failures`
    were refused: by their place, what is wrong. `shared` has what the scenarios share; its own scenario means nothing.

    `times_s` (time,) are the times that were sent, None where `dt_s` makes them.
    """

    shared: PredictionInputs
    scenarios: ManyScenarios
    indices: npt.NDArray[np.intp]
    failures: Mapping[int, Exception]
    times_s: Array | None

    def grid(self, max_points: int) -> Array:
        """The times of the scenarios, (time,) or (scenario, time): see `sample_grid`.

        Raises InvalidValueError where a trajectory would have more than `max_points` points, or all of them more than
        ten times as many, counted as if each were as long as the longest.
        """
        if self.times_s is not None:
            require_few_times(len(self.times_s), len(self.scenarios), max_points)
            return self.times_s
        horizons = self.scenarios.horizon_s.tolist()
        return bounded_grid(horizons, self.shared.dt_s, max_points) if horizons else np.empty(0)


def read_batch(document: object) -> BatchQuestion:
    """The question in the JSON of a body. Scenarios that are wrong are among its failures.

    Raises InvalidInputError and InvalidValueError for what concerns all of them.
    """
    if not isinstance(document, dict):
        raise InvalidInputError(fault("body", document, "a JSON object"))
    strangers = [name for name in document if name not in _BODY_FIELDS]
    if strangers:
        allowed = "one of " + ", ".join(_BODY_FIELDS)
        raise InvalidInputError(*(unknown_field(name, document[name], allowed) for name in strangers[:20]))
    sent = document.get("scenarios")
    if not isinstance(sent, list) or not 1 <= len(sent) <= MAX_SCENARIOS:
        said = f"{len(sent)} scenarios" if isinstance(sent, list) else sent
        raise InvalidInputError(fault("scenarios", said, BATCH_WORDS["scenarios"]))
    try:
        sent_shared = {name: document[name] for name in _SHARED if name in document}
        shared = PredictionBody.model_validate(sent_shared | _STAND_IN)
    except ValidationError as error:
        raise InvalidInputError(*_faults(error, BATCH_WORDS)) from error
    times = shared.sampled()[1] if shared.times_s else None
    places, values, failures = _checked(sent)
    if times is not None:
        horizon = float(times[-1])
        for at, own in zip(places, values[:, 3].tolist(), strict=True):
            if "horizon_s" in sent[at] and own != horizon:
                allowed = f"the last of times_s, which is {horizon:.12g}"
                failures[at] = InvalidValueError("horizon_s", own, allowed)
        left = [row for row, at in enumerate(places) if at not in failures]
        places, values = [places[row] for row in left], values[left]
        values[:, 3] = horizon
    scenarios = ManyScenarios(*np.ascontiguousarray(values.T))
    return BatchQuestion(shared, scenarios, np.array(places, dtype=np.intp), failures, times)


def _checked(sent: list[Any]) -> tuple[list[int], Array, dict[int, Exception]]:
    """The places of the scenarios that can be, their values (scenario, 4), and what is wrong with the others."""
    values = _values(sent)
    if values is not None:
        return list(range(len(sent))), values, {}
    failures = _failures(sent)
    left = [at for at in range(len(sent)) if at not in failures]
    values = _values([sent[at] for at in left])
    assert values is not None
    return left, values, failures


def _values(sent: list[Any]) -> Array | None:
    """The fields of scenarios, (scenario, 4). None if one of them is not what `BatchScenario` takes."""
    try:
        if not set(map(len, sent)) <= {3, 4}:
            return None
        columns = [[each[name] for each in sent] for name in _OF_SCENARIO[:3]]
        columns.append([each["horizon_s"] if len(each) == 4 else HORIZON_S for each in sent])
        kinds = {kind for column in columns for kind in set(map(type, column))}
        values = np.array(columns, dtype=np.float64).T
    except (LookupError, TypeError, ValueError, OverflowError):
        return None
    fits = kinds <= _NUMBERS and ((values >= _LOWEST) & (values <= _HIGHEST)).all()
    return values if fits else None


def _failures(sent: list[Any]) -> dict[int, Exception]:
    strange = {at: strangers_in(each, _SCENARIO_WORDS) for at, each in enumerate(sent) if isinstance(each, dict)}
    found: dict[int, Exception] = {at: error for at, error in strange.items() if error is not None}
    asked = [at for at in range(len(sent)) if at not in found]
    errors: dict[int, list[Any]] = defaultdict(list)
    try:
        _scenarios.validate_python([sent[at] for at in asked])
    except ValidationError as error:
        for each in error.errors(include_url=False):
            errors[asked[int(each["loc"][0])]].append(each)
    return found | {
        at: InvalidInputError(*(faults_of(some, _SCENARIO_WORDS) if isinstance(sent[at], dict) else [_none(sent[at])]))
        for at, some in errors.items()
    }


def _none(value: object) -> InputFault:
    return fault("scenario", value, "a JSON object with " + ", ".join(_OF_SCENARIO))


def _faults(error: ValidationError, allowed: Mapping[str, str]) -> list[InputFault]:
    return faults_of([{**each, "loc": ("body", *each["loc"])} for each in error.errors(include_url=False)], allowed)
