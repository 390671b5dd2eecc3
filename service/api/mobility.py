"""`/v1/mobility`: should the rover go over this slope? Outcome, speed and slip over slope x torque for one mass."""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Callable, Coroutine, Mapping, Sequence
from typing import Annotated, Any

import numpy as np
import orjson
from fastapi import APIRouter, Query, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.routing import APIRoute
from pydantic import BaseModel, ConfigDict, Field
from pydantic.json_schema import SkipJsonSchema

from service.allowed import allowed_fields
from service.api.answers import MobilityAnswer
from service.api.delivery import CACHE_HEADERS, NOT_MODIFIED, Delivery
from service.api.encoders import MEDIA_TYPES, TableFormat
from service.api.encoders.numbers import dump
from service.api.errors import InvalidInputError
from service.api.input_faults import MAX_FAULTS, InputFault, echo, fault, faults_of
from service.api.inputs import PredictionInputs, TableFormatQuery
from service.api.negotiation import choose_format
from service.api.openapi import problem_responses
from service.api.problems import Slug
from service.api.services import Parts
from service.errors import InvalidValueError
from service.physics.scenario import Array
from service.settings import LIMITS
from service.twin import Loaded
from service.twin.mobility import CONFIDENCE, MOST_VALUES, MobilityMap, mobility_map

COLUMNS = ("torque_nm", "slope_deg", "outcome", "mean_speed_m_s", "slip_ratio", "inside_domain")
LAST_COLUMN = "steepest_climb_slope_deg"
_PREDICTION = PredictionInputs.model_fields
_Torque = Annotated[float, Field(ge=LIMITS.torque_nm[0], le=LIMITS.torque_nm[1])]
_Slope = Annotated[float, Field(ge=-LIMITS.slope_deg, le=LIMITS.slope_deg)]
_Steps = Annotated[
    int,
    Field(ge=2, le=MOST_VALUES, json_schema_extra={"x-allowed": f"a whole number from 2 to {MOST_VALUES}"}),
]


class MobilityInputs(BaseModel):
    """The map: one mass, a range of torques or one torque, a range of slopes or one slope."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    mass_kg: Annotated[float, _PREDICTION["mass_kg"]]
    torque_min_nm: Annotated[
        _Torque, Field(description="Lowest stall torque of each wheel's motor in N m.", examples=[30])
    ]
    torque_max_nm: Annotated[
        _Torque | SkipJsonSchema[None],
        Field(description="Highest torque; without it, the map has one row, the lowest torque.", examples=[120]),
    ] = None
    torque_steps: Annotated[
        _Steps,
        Field(description="How many torques, both ends included; matters with a range of torques only.", examples=[10]),
    ] = 10
    slope_min_deg: Annotated[
        _Slope, Field(description="Lowest slope in degrees; positive means uphill.", examples=[0])
    ] = 0.0
    slope_max_deg: Annotated[_Slope, Field(description="Steepest slope in degrees.", examples=[35])] = 35.0
    slope_steps: Annotated[
        _Steps,
        Field(description="How many slopes, both ends included; matters with a range of slopes only.", examples=[36]),
    ] = 36
    horizon_s: Annotated[float, _PREDICTION["horizon_s"]]
    confidence: Annotated[
        float,
        Field(
            ge=CONFIDENCE[0],
            le=CONFIDENCE[1],
            description="How sure the steepest slope must be climbed; needs a version with a band.",
            examples=[0.9],
        ),
    ] = 0.9
    model: Annotated[str, _PREDICTION["model"]]

    def torques_nm(self) -> Array:
        """The rows. Raises InvalidValueError for a range that ends before it starts."""
        highest = self.torque_min_nm if self.torque_max_nm is None else self.torque_max_nm
        return _axis("torque_max_nm", "torque_min_nm", self.torque_min_nm, highest, self.torque_steps)

    def slopes_deg(self) -> Array:
        """The columns. Raises InvalidValueError for a range that ends before it starts."""
        return _axis("slope_max_deg", "slope_min_deg", self.slope_min_deg, self.slope_max_deg, self.slope_steps)


class MobilityQuery(TableFormatQuery, MobilityInputs):
    """A map asked for in the query of a GET; text becomes numbers."""


def _axis(highest_name: str, lowest_name: str, lowest: float, highest: float, steps: int) -> Array:
    if highest < lowest:
        raise InvalidValueError(highest_name, highest, f"at least {lowest_name}, which is {lowest:g}")
    return np.linspace(lowest, highest, steps if highest > lowest else 1)


ALLOWED = allowed_fields(MobilityQuery.model_json_schema())


def mobility_faults(errors: Sequence[Mapping[str, Any]]) -> list[InputFault]:
    """The faults in pydantic's list of errors, in the words of a map's fields."""
    return faults_of(errors, ALLOWED)


class _MobilityRoute(APIRoute):
    """Says what is wrong with a query in the words of this route's own fields."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        handle = super().get_route_handler()

        async def handle_in_words(request: Request) -> Response:
            times = Counter(name for name, _ in request.query_params.multi_items())
            if repeated := [name for name, count in times.items() if count > 1]:
                raise InvalidInputError(*(_repeated(name, request) for name in repeated[:MAX_FAULTS]))
            try:
                return await handle(request)
            except RequestValidationError as error:
                raise InvalidInputError(*mobility_faults(error.errors())) from error

        return handle_in_words


def _repeated(name: str, request: Request) -> InputFault:
    values = ", ".join(str(echo(value)) for value in request.query_params.getlist(name))
    return fault(name, values, f"one value only, {ALLOWED.get(name, 'if the field were known')}")


_RESPONSES: dict[int | str, dict[str, Any]] = {
    200: {
        "model": MobilityAnswer,
        "description": "The map, in the form asked for; as CSV one line for each torque and slope.",
        "content": {
            "text/csv": {
                "schema": {"type": "string"},
                "example": ",".join([*COLUMNS, LAST_COLUMN]) + "\n60.0,28.0,climbs,0.11,0.7,true,29.5\n",
            }
        },
        "headers": {
            "Rover-Twin-Model": {
                "schema": {"type": "string"},
                "description": "Version that answered, as name@version.",
            },
            "Rover-Twin-Confidence": {
                "schema": {"type": "string"},
                "description": "Confidence of the steepest slopes; `none` when the version has no band.",
            },
            **CACHE_HEADERS,
        },
    },
    **NOT_MODIFIED,
    **problem_responses(
        Slug.INVALID_INPUT,
        Slug.MODEL_NOT_FOUND,
        Slug.VERSION_NOT_FOUND,
        Slug.ALIAS_NOT_FOUND,
        Slug.NOT_ACCEPTABLE,
        Slug.ARTEFACT_CORRUPT,
        Slug.UNSUPPORTED_FORMAT,
        Slug.STORE_UNAVAILABLE,
        Slug.OVERLOADED,
    ),
}

router = APIRouter(prefix="/v1/mobility", tags=["mobility"], responses=_RESPONSES, route_class=_MobilityRoute)


@router.get("", summary="Where the rover climbs, stalls and slides", response_class=Response, response_model=None)
async def get_mobility(asked: Annotated[MobilityQuery, Query()], request: Request, parts: Parts) -> Response:
    """Over slope x torque for one mass: outcome, speed, slip, and for each torque the steepest slope surely climbed."""
    form = choose_format(asked.format, request.headers.get("accept"), TableFormat)
    torques, slopes = asked.torques_nm(), asked.slopes_deg()
    loaded = await parts.storage.run(lambda: parts.registry.get(asked.model))
    question = orjson.dumps(asked.model_dump(exclude={"model", "format"}))
    delivery = Delivery.of(request, MEDIA_TYPES[form], text=True).cacheable(request, loaded, asked.model, question)
    if nothing_new := delivery.not_modified():
        return nothing_new
    return await parts.predictions.run(lambda: _computed(asked, torques, slopes, form, loaded, delivery))


def _computed(
    asked: MobilityInputs, torques: Array, slopes: Array, form: TableFormat, loaded: Loaded, delivery: Delivery
) -> Response:
    """Runs on a worker thread: everything that takes time, up to the bytes of the answer."""
    found = mobility_map(loaded.twin, asked.mass_kg, torques, slopes, asked.horizon_s, asked.confidence)
    headers = {
        "Rover-Twin-Model": f"{loaded.twin.name}@{loaded.twin.version}",
        "Rover-Twin-Confidence": "none" if found.confidence is None else f"{found.confidence:g}",
    }
    body = dump(document_of(loaded, found)) if form is TableFormat.JSON else table_of(found).encode()
    return delivery.response(body, headers)


def document_of(loaded: Loaded, found: MobilityMap) -> dict[str, Any]:
    """The JSON answer: a `service.api.answers.MobilityAnswer`."""
    return {
        "model": {"name": loaded.twin.name, "version": loaded.twin.version, "alias": loaded.alias},
        "mass_kg": found.mass_kg,
        "horizon_s": found.horizon_s,
        "confidence": found.confidence,
        "steepest_by": "central_estimate" if found.confidence is None else "band",
        "slope_deg": found.slope_deg.tolist(),
        "torque_nm": found.torque_nm.tolist(),
        "outcome": [list(row) for row in found.outcome],
        "mean_speed_m_s": found.mean_speed_m_s.tolist(),
        "slip_ratio": [list(row) for row in found.slip_ratio],
        "inside_domain": found.inside_domain.tolist(),
        "steepest_climb_slope_deg": list(found.steepest_climb_slope_deg),
    }


def table_of(found: MobilityMap) -> str:
    """A line for each cell; empty where JSON has null. The steepest slope is that of the line's torque."""
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow([*COLUMNS, LAST_COLUMN])
    for row, torque in enumerate(found.torque_nm.tolist()):
        for column, slope in enumerate(found.slope_deg.tolist()):
            speed, inside = float(found.mean_speed_m_s[row, column]), bool(found.inside_domain[row, column])
            cell = (found.outcome[row][column].value, speed, found.slip_ratio[row][column], str(inside).lower())
            rows.writerow([torque, slope, *cell, found.steepest_climb_slope_deg[row]])
    return text.getvalue()
