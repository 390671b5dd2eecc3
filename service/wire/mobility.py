"""Should the rover go over this slope? What is asked for a mobility map, and how one is written."""

from __future__ import annotations

import csv
import io
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from pydantic.json_schema import SkipJsonSchema

from service.allowed import Words
from service.errors import InvalidValueError
from service.physics.scenario import Array
from service.pictures.drawing import as_png, as_svg
from service.settings import LIMITS
from service.twin import Loaded, Outcome
from service.twin.mobility import CONFIDENCE, MOST_VALUES, MobilityMap
from service.wire.forms import MapFormat
from service.wire.forms.numbers import dump, require_finite
from service.wire.mobility_picture import drawing_of_map, map_as_html
from service.wire.prediction import FORMAT, PredictionInputs
from service.wire.prediction_answer import ModelIdentity
from service.wire.whole_numbers import PLAIN_INTEGER

COLUMNS = ("torque_nm", "slope_deg", "outcome", "mean_speed_m_s", "slip_ratio", "inside_domain")
LAST_COLUMNS = ("steepest_climb_slope_deg", "steepest_inside_domain")
_PREDICTION = PredictionInputs.model_fields
_Torque = Annotated[float, Field(ge=LIMITS.torque_nm[0], le=LIMITS.torque_nm[1])]
_Slope = Annotated[float, Field(ge=-LIMITS.slope_deg, le=LIMITS.slope_deg)]
_Steps = Annotated[
    int,
    Field(ge=2, le=MOST_VALUES),
    PLAIN_INTEGER,
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
        Field(description="Number of torques, both ends included. Used with a range of torques only.", examples=[10]),
    ] = 10
    slope_min_deg: Annotated[
        _Slope, Field(description="Lowest slope in degrees; positive means uphill.", examples=[0])
    ] = 0.0
    slope_max_deg: Annotated[_Slope, Field(description="Steepest slope in degrees.", examples=[35])] = 35.0
    slope_steps: Annotated[
        _Steps,
        Field(description="Number of slopes, both ends included. Used with a range of slopes only.", examples=[36]),
    ] = 36
    horizon_s: Annotated[float, _PREDICTION["horizon_s"]]
    confidence: Annotated[
        float,
        Field(
            ge=CONFIDENCE[0],
            le=CONFIDENCE[1],
            description="Probability with which the steepest slope must be climbed. Needs a version with a band.",
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


class MobilityQuery(MobilityInputs):
    """A map asked for in the query of a GET; text becomes numbers."""

    format: Annotated[MapFormat | SkipJsonSchema[None], FORMAT] = None


def _axis(highest_name: str, lowest_name: str, lowest: float, highest: float, steps: int) -> Array:
    if highest < lowest:
        raise InvalidValueError(highest_name, highest, f"at least {lowest_name}, which is {lowest:g}")
    return np.linspace(lowest, highest, steps if highest > lowest else 1)


ALLOWED = Words.of(MobilityQuery)


class MobilityAnswer(BaseModel):
    """Outcome, speed and slip over slope x torque. Each table has a row for each torque and a column for each slope."""

    model: ModelIdentity
    mass_kg: float
    horizon_s: float
    confidence: Annotated[
        float | None, Field(description="Confidence of the steepest slopes; null when the version has no band.")
    ]
    steepest_by: Annotated[
        Literal["band", "central_estimate"],
        Field(
            description="`band`: what the version knows of its errors decides what is climbed. "
            "`central_estimate`: the version has no band."
        ),
    ]
    slope_deg: list[float]
    torque_nm: list[float]
    outcome: list[list[Outcome]]
    mean_speed_m_s: Annotated[list[list[float]], Field(description="Along the slope; negative downhill.")]
    slip_ratio: Annotated[list[list[float | None]], Field(description="null where wheels stand still.")]
    inside_domain: list[list[bool]]
    steepest_climb_slope_deg: Annotated[
        list[float | None],
        Field(
            description="For each torque, the slope up to which every slope of the map is climbed, to 0.01 deg. It is "
            "never above the steepest slope of the map. null when the lowest slope is not climbed, or when no cell of "
            "the torque is inside the domain."
        ),
    ]
    steepest_inside_domain: Annotated[
        list[bool | None],
        Field(description="For each torque, whether the steepest slope is inside the domain; null where it is null."),
    ]


def written(loaded: Loaded, found: MobilityMap, form: MapFormat) -> bytes:
    """The map in a form. Raises MissingPartError for a picture where Matplotlib is not installed, NonFiniteError."""
    if form is MapFormat.JSON:
        return dump(map_as_json(loaded, found))
    require_finite((found.mean_speed_m_s, found.slip_ratio, found.steepest_climb_slope_deg), "answer")
    if form is MapFormat.CSV:
        return map_as_csv(found).encode()
    if form is MapFormat.HTML:
        return map_as_html(loaded, found)
    return (as_svg if form is MapFormat.SVG else as_png)(drawing_of_map(loaded, found))


def map_as_json(loaded: Loaded, found: MobilityMap) -> dict[str, Any]:
    """The JSON answer: a `MobilityAnswer`."""
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
        "steepest_inside_domain": list(found.steepest_inside_domain),
    }


def map_as_csv(found: MobilityMap) -> str:
    """A line for each cell; empty where JSON has null. The last columns are those of the line's torque."""
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow([*COLUMNS, *LAST_COLUMNS])
    for row, torque in enumerate(found.torque_nm.tolist()):
        known = found.steepest_inside_domain[row]
        steepest = (found.steepest_climb_slope_deg[row], None if known is None else str(known).lower())
        for column, slope in enumerate(found.slope_deg.tolist()):
            speed, inside = float(found.mean_speed_m_s[row, column]), bool(found.inside_domain[row, column])
            cell = (found.outcome[row][column].value, speed, found.slip_ratio[row][column], str(inside).lower())
            rows.writerow([torque, slope, *cell, *steepest])
    return text.getvalue()
