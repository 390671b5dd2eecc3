"""`/v1/models/{name}/versions/{version}/card` and `/comparison`: a version, and two of them, for people who decide."""

from __future__ import annotations

from functools import partial
from typing import Annotated, Any

from fastapi import Query, Request, Response
from pydantic import BaseModel, ConfigDict
from pydantic.json_schema import SkipJsonSchema

from model_store import DEFAULT_ALIAS, Manifest, ModelStore, NotFoundError, VersionRetiredError
from service.api.http.answers.delivery import CACHE_HEADERS, NOT_MODIFIED, Delivery
from service.api.http.answers.negotiation import choose
from service.api.http.openapi import problem_responses
from service.api.http.problems import Slug
from service.api.http.reading import Route
from service.api.http.router import Router
from service.api.services import Services, TheServices
from service.api.v1.models import MODEL_PROBLEMS, Name, Version, require_name
from service.errors import CheckpointError, MissingPartError
from service.twin import Loaded
from service.wire.forms import ENCODERS, PICTURE_MEDIA_TYPES, Format, PictureFormat
from service.wire.forms.numbers import dump
from service.wire.prediction import FORMAT
from service.wire.versions.card import CardAnswer, card_of
from service.wire.versions.comparison import ComparisonAnswer, ComparisonQuery, Two, compared
from service.wire.versions.written import written_card, written_comparison


class CardQuery(BaseModel):
    """How the card is written."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: Annotated[PictureFormat | SkipJsonSchema[None], FORMAT] = None


def _responses(model: type[BaseModel], description: str) -> dict[int | str, dict[str, Any]]:
    content = {
        PICTURE_MEDIA_TYPES[form]: {"schema": {"type": "string"}} for form in PictureFormat if form.value != "json"
    }
    return {
        200: {"model": model, "description": description, "content": content, "headers": CACHE_HEADERS},
        **NOT_MODIFIED,
        **problem_responses(
            *(Slug.INVALID_INPUT, Slug.MODEL_NOT_FOUND, Slug.VERSION_NOT_FOUND, Slug.NOT_ACCEPTABLE),
            *(Slug.NOT_INSTALLED, *MODEL_PROBLEMS),
        ),
    }


router = Router(prefix="/v1/models/{name}/versions/{version}", tags=["models"], route_class=Route)


@router.get(
    "/card",
    summary="The card of a version",
    response_class=Response,
    response_model=None,
    responses=_responses(CardAnswer, "The card, in the form asked for."),
)
async def get_card(
    name: Name, version: Version, asked: Annotated[CardQuery, Query()], request: Request, services: TheServices
) -> Response:
    """What a version was made from, its errors on runs that it has not seen, its domain, where it must not be used."""
    require_name(name)
    form = choose(PICTURE_MEDIA_TYPES, asked.format, request.headers.get("accept"))
    manifest = await services.storage.run(lambda: services.store.manifest(name, version))
    page = form is PictureFormat.HTML
    card = await services.read_much(lambda: card_of(services.store, manifest, with_figures=page))
    tag = dump(card.answer.model_dump(mode="json"))
    delivery = _delivery(request, form).tagged(request, tag, fixed=False)  # names of datasets and the state may change
    if nothing_new := delivery.not_modified():
        return nothing_new
    return await services.heavy.run(lambda: delivery.response(written_card(card, form)), asker=request)


@router.get(
    "/comparison",
    summary="Two versions side by side",
    response_class=Response,
    response_model=None,
    responses=_responses(ComparisonAnswer, "The comparison, in the form asked for.")
    | problem_responses(Slug.ALIAS_NOT_FOUND, Slug.OVERLOADED),
)
async def get_comparison(
    name: Name, version: Version, asked: Annotated[ComparisonQuery, Query()], request: Request, services: TheServices
) -> Response:
    """The gate's verdict on a version beside another one, errors of both by regime on the runs that neither has seen,
    their domains, and their positions on chosen slopes. It changes nothing.
    """
    require_name(name)
    form = choose(PICTURE_MEDIA_TYPES, asked.format, request.headers.get("accept"))
    reference = asked.against or f"{name}@{DEFAULT_ALIAS}"
    candidate, against, key = await services.read_much(lambda: _found(services, (name, version), reference))
    question = "\n".join([*key, asked.model_dump_json(exclude={"format", "against"})]).encode()
    delivery = _delivery(request, form).tagged(request, question, fixed=False)
    if nothing_new := delivery.not_modified():
        return nothing_new
    two = await _with_twins(services, candidate, against)
    answer = await services.heavy.run(lambda: compared(services.store, two, asked), asker=request)
    return await services.heavy.run(lambda: delivery.response(written_comparison(answer, form)), asker=request)


def _delivery(request: Request, form: PictureFormat) -> Delivery:
    encoder = ENCODERS[Format(form)]
    return Delivery.of(request, encoder.media_type, text=encoder.text)


def _found(services: Services, version: tuple[str, int], reference: str) -> tuple[Manifest, Manifest, tuple[str, str]]:
    """Both manifests, and of both what an answer follows from."""
    store = services.store
    ours = store.manifest(*version)
    against = store.resolve(reference)
    theirs = store.manifest(against.name, against.version)
    return ours, theirs, (_tag_of(store, ours), _tag_of(store, theirs))


def _tag_of(store: ModelStore, manifest: Manifest) -> str:
    files = ",".join(each.sha256 for each in manifest.files.values())
    state, _ = store.version_state(manifest.name, manifest.version)
    return f"{manifest.name}@{manifest.version} {manifest.created_at.isoformat()} {state} {files}"


async def _with_twins(services: Services, candidate: Manifest, against: Manifest) -> Two:
    """Both versions in memory; without them, why not, for all the rest can be compared."""
    loaded: list[Loaded] = []
    for each in (candidate, against):
        try:
            await services.storage.run(partial(services.store.require_usable, each.name, each.version))
            loaded.append(await services.twin(f"{each.name}@{each.version}"))
        except (MissingPartError, CheckpointError, VersionRetiredError, NotFoundError) as error:
            return Two(candidate, against, None, str(error))
    return Two(candidate, against, (loaded[0].twin, loaded[1].twin))
