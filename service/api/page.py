"""`/`: the page for people. Static files of ours, read once when the service starts, and the ranges of the questions.

It is public where predictions need a token, too: nothing in it is secret, and it is where the token is asked for.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import orjson
from fastapi import Request, Response
from pydantic import BaseModel
from starlette.exceptions import HTTPException

from service.api.http.answers.compression import SMALLEST_BYTES, Coding, compressed
from service.api.http.answers.delivery import Delivery
from service.api.http.router import Router

_FOLDER = Path(__file__).parents[1] / "page"
_HOME, _FIELDS = "index.html", "fields.json"
_MEDIA_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
    ".json": "application/json",
}
# Everything comes from this service, no script and no style stands inside the page. `blob:` is for pictures and files
# that were fetched with a token.
_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)


@dataclass(frozen=True, slots=True)
class _File:
    """One file, and what was sent of it so far, by coding."""

    media_type: str
    body: bytes
    sent: dict[Coding, bytes] = field(default_factory=dict)

    def answer(self, request: Request) -> Response:
        """The file, or 304 for who has it."""
        delivery = Delivery.of(request, self.media_type, text=True, negotiated=False)
        delivery = delivery.tagged(request, self.body, fixed=False)
        response = delivery.not_modified() or self._whole(delivery)
        response.headers["Content-Security-Policy"] = _POLICY
        return response

    def _whole(self, delivery: Delivery) -> Response:
        coding = delivery.coding if len(self.body) >= SMALLEST_BYTES else Coding.IDENTITY
        if (body := self.sent.get(coding)) is None:
            body = self.sent[coding] = compressed(self.body, coding)
        headers = {"Vary": delivery.vary, **delivery.cached}
        if coding is not Coding.IDENTITY:
            headers["Content-Encoding"] = coding
        return Response(body, headers=headers, media_type=self.media_type)


def _read() -> dict[str, _File]:
    """The files of the page by their names in it."""
    return {
        path.relative_to(_FOLDER).as_posix(): _File(media_type, path.read_bytes())
        for path in sorted(_FOLDER.rglob("*"))
        if (media_type := _MEDIA_TYPES.get(path.suffix))
    }


@cache
def _fields() -> _File:
    """What may be asked, as the OpenAPI document says it, which is a hundred times as long.

    Found out for the first who opens the page: a service that starts need not know what is uploaded and trained.
    """
    from service.datasets.uploads.upload_form import UploadForm  # noqa: PLC0415
    from service.jobs.request import TrainingJobRequest  # noqa: PLC0415
    from service.wire.drives.question import DriveBody  # noqa: PLC0415
    from service.wire.mobility import MobilityQuery  # noqa: PLC0415
    from service.wire.prediction import PredictionQuery  # noqa: PLC0415

    questions: dict[str, type[BaseModel]] = {
        "prediction": PredictionQuery,
        "mobility": MobilityQuery,
        "drive": DriveBody,
        "upload": UploadForm,
        "training": TrainingJobRequest,
    }
    found = {name: asked.model_json_schema() for name, asked in questions.items()}
    return _File(_MEDIA_TYPES[".json"], orjson.dumps(found))


_FILES = _read()
PATHS = frozenset({"/", *(f"/page/{name}" for name in (*_FILES, _FIELDS))})
"""All addresses of the page. Nobody needs a token for them."""

router = Router(include_in_schema=False)


@router.get("/")
async def home(request: Request) -> Response:
    """The page. Its files have relative addresses, so that it works behind a proxy with a prefix, too."""
    return _FILES[_HOME].answer(request)


@router.get("/page/{name:path}")
async def file(name: str, request: Request) -> Response:
    """One of the page's files. What is not one of them is not looked for on the disk."""
    if name == _FIELDS:
        return _fields().answer(request)
    if name not in _FILES:
        raise HTTPException(404)
    return _FILES[name].answer(request)
