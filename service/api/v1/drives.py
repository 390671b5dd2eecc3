"""`/v1/drives`: a rover over a track under controls; one drive in, one trajectory with events and summary out."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import Body, Query, Request, Response

from service.api.http.answers.compression import Coding
from service.api.http.answers.delivery import Delivery
from service.api.http.answers.negotiation import choose
from service.api.http.lanes import LaneRoute
from service.api.http.openapi import form_of, problem_responses
from service.api.http.problems import Slug
from service.api.http.router import Router
from service.api.services import TheServices
from service.twin.drives import DriveQuestion
from service.wire.drives.answer import DriveAnswer
from service.wire.drives.ask import driven
from service.wire.drives.question import DriveBody
from service.wire.forms import ENCODERS, MEDIA_TYPES, Format, written
from service.wire.prediction import FormatQuery

PATH = "/v1/drives"
MAX_BODY_BYTES = 4 << 20
"""Of one drive: 10,000 knots, 10,000 controls and 100,000 times in JSON."""

# Of driving, about a millisecond: a thread would add a tenth of it. Where the outcome is open, the search for where it
# turns takes up to 24 drives more, and others wait for some milliseconds: seldom so.
_SECONDS_AT_ONCE = 20.0
_SHORT_TEXT = 1000  # points
_MEANINGS = {
    Format.NPZ: "NumPy archive: an array for each column, and `metadata`, JSON text.",
    Format.ARROW: "Arrow IPC stream: one record batch; the schema's metadata is JSON text.",
    Format.PARQUET: "Parquet file: the table of Arrow, its metadata in the file's key-value metadata.",
    Format.USDA: "USD text layer: the rover as time samples of `/Rover`, or of your own prim in your stage's axes.",
    Format.SVG: "The track from the side; position, speed, slip, slope and torque against time, with the events.",
    Format.PNG: "The plot as pixels.",
    Format.HTML: "A page for people: plot, summary, domain, some points as a table. It loads nothing.",
}
RESPONSES: dict[int | str, dict[str, Any]] = {
    200: {
        "model": DriveAnswer,
        "description": "The drive, in the form asked for.",
        "content": {
            "text/csv": {
                "schema": {"type": "string"},
                "example": "time_s,x_m,y_m,speed_m_s,slope_deg,torque_nm,brake,slip_ratio\n"
                "0.0,0.0,0.2337,-0.0035,11.07,60.0,0,1.0\n",
            },
            **{ENCODERS[form].media_type: form_of(ENCODERS[form].text, meaning) for form, meaning in _MEANINGS.items()},
        },
        "headers": {
            "Rover-Twin-Model": {
                "schema": {"type": "string"},
                "description": "Version that answered, as name@version.",
            },
            "Rover-Twin-Frame": {"schema": {"type": "string", "enum": ["slope", "world"]}},
            "Rover-Twin-Domain": {"schema": {"type": "string", "enum": ["inside", "outside"]}},
            "Rover-Twin-Outcome": {"schema": {"type": "string", "enum": ["passes", "sticks", "slides"]}},
            "Rover-Twin-Band-Level": {
                "schema": {"type": "number"},
                "description": "Level of the band; only on `include=band`.",
            },
        },
    },
    **problem_responses(
        Slug.INVALID_INPUT,
        Slug.OUTSIDE_DOMAIN,
        Slug.MALFORMED_BODY,
        Slug.UNSUPPORTED_MEDIA_TYPE,
        Slug.MODEL_NOT_FOUND,
        Slug.VERSION_NOT_FOUND,
        Slug.VERSION_ARCHIVED,
        Slug.VERSION_DELETED,
        Slug.ALIAS_NOT_FOUND,
        Slug.NOT_ACCEPTABLE,
        Slug.BODY_TOO_LARGE,
        Slug.ARTEFACT_CORRUPT,
        Slug.NOT_INSTALLED,
        Slug.UNSUPPORTED_FORMAT,
        Slug.STORE_UNAVAILABLE,
        Slug.OVERLOADED,
    ),
}


async def create_drive(
    asked: Annotated[DriveBody, Body()],
    form: Annotated[FormatQuery, Query()],
    request: Request,
    services: TheServices,
) -> Response:
    """Where a rover goes over this track under these controls, what happens on the way, and how sure that is."""
    chosen = choose(MEDIA_TYPES, form.format, request.headers.get("accept"))
    form.require_usd(chosen)
    placement = form.placement()
    question, wanted = asked.asked(services.settings.max_points)
    loaded = await services.twin(asked.model)
    encoder = ENCODERS[chosen]
    delivery = Delivery.of(request, encoder.media_type, text=encoder.text)

    def computed() -> Response:
        subject = driven(question, wanted, asked.strict, loaded, services.instruments.drove)
        return delivery.response(written(chosen, subject, placement), subject.headers())

    points = min(encoder.points_at_once, _SHORT_TEXT)
    quick = question.horizon_s <= _SECONDS_AT_ONCE and not wanted.band and question.until_distance_m is None
    if quick and asked.points() <= points and delivery.coding is Coding.IDENTITY and _simple(question):
        return computed()
    return await services.predictions.run(computed)


def _simple(question: DriveQuestion) -> bool:
    """Whether the inputs are few enough not to matter beside the drive."""
    return len(question.ground.distance_m) + len(question.controls.time_s) <= _SHORT_TEXT


router = Router(prefix=PATH, tags=["drives"], responses=RESPONSES)
router.add_api_route(
    "",
    create_drive,
    methods=["POST"],
    summary="Drive over a track",
    response_class=Response,
    response_model=None,
    route_class_override=LaneRoute,
)
