"""`/v1/admin/datasets`: uploads of Chrono runs, and what became of them.

An upload is streamed to a file and read in a process of its own (`service.jobs.import_process`): what is hostile in it
meets neither this process nor its memory. A sender who goes away while the import runs changes nothing: it ends as it
would have, and the same upload again is told that it is known.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Annotated, Literal

from fastapi import Depends, Path, Query, Request, Response
from fastapi.responses import StreamingResponse
from pydantic import BaseModel, ConfigDict, Field
from pydantic.json_schema import SkipJsonSchema

from model_store import (
    CorruptArtefactError,
    DatasetRecord,
    InvalidReferenceError,
    ModelStore,
    UnsupportedFormatError,
    layout,
)
from service.api.admin import ADMIN_PROBLEMS, Admin, AdminRoute, about, require_admin
from service.api.http.limits.worker_threads import OverloadedError
from service.api.http.openapi import problem_responses
from service.api.http.problems import Slug
from service.api.http.reading import query_pairs
from service.api.http.router import Router
from service.api.http.upload_body import receive_upload, upload_folder
from service.api.services import Services, TheServices
from service.api.v1.admin.dataset_answers import (
    ADDRESS,
    DatasetAnswer,
    DatasetEntry,
    DatasetLinks,
    DatasetsAnswer,
    UploadAnswer,
    entry_of,
)
from service.api.v1.admin.upload_fields import OPENAPI, asked_for
from service.datasets.passport import PASSPORT_FILE
from service.errors import JobError
from service.jobs.dataset_users import delete_unused, jobs_of
from service.jobs.import_process import import_in_process
from service.jobs.preview_process import preview_in_process
from service.pictures import report
from service.training.stored_dataset import RUNS_FILE, UploadResult
from service.wire.datasets import DatasetUsers, report_document
from service.wire.faults import InputFault, InvalidInputError, fault
from service.wire.whole_numbers import PLAIN_INTEGER

MOST_LISTED = 200
PARQUET = "application/vnd.apache.parquet"
_MOST_WAITING = 8
_MEDIA_TYPES = {"svg": "image/svg+xml", "png": "image/png", "html": report.MEDIA_TYPE}


class DatasetsQuery(BaseModel):
    """Which page of the list."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    limit: Annotated[
        int,
        Field(ge=1, le=MOST_LISTED, description="How many datasets at most.", examples=[50]),
        PLAIN_INTEGER,
    ] = 50
    after: Annotated[
        str | SkipJsonSchema[None],
        Field(
            pattern="^[0-9a-f]{64}$",
            description="Id that the page begins after.",
            examples=["0" * 64],
            json_schema_extra={"x-allowed": "the id of a dataset: 64 hexadecimal digits"},
        ),
    ] = None


class PreviewQuery(BaseModel):
    """The form of the figure."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: Annotated[
        Literal["svg", "png", "html"], Field(description="Form of the figure; `html` is a page with its numbers.")
    ] = "svg"


_STORE_PROBLEMS = (Slug.ARTEFACT_CORRUPT, Slug.UNSUPPORTED_FORMAT, Slug.STORE_UNAVAILABLE, Slug.OVERLOADED)
_NO_DATASET = problem_responses(Slug.INVALID_INPUT, Slug.DATASET_NOT_FOUND)

router = Router(
    prefix=ADDRESS,
    tags=["datasets"],
    dependencies=[Depends(require_admin)],
    responses=problem_responses(*ADMIN_PROBLEMS, *_STORE_PROBLEMS),
    route_class=AdminRoute,
)

Reference = Annotated[
    str,
    Path(alias="dataset", description="Id, a unique start of it (6 digits or more), or name of a dataset."),
]


@router.post(
    "",
    summary="Upload a dataset",
    response_model=UploadAnswer,
    responses=problem_responses(
        Slug.INVALID_INPUT,
        Slug.DATASET_REJECTED,
        Slug.MALFORMED_BODY,
        Slug.UPLOAD_STALLED,
        Slug.BODY_TOO_LARGE,
        Slug.STORAGE_FULL,
        Slug.CONFLICT,
        Slug.DATASET_NAME_TAKEN,
    )
    | {
        200: {
            "model": UploadAnswer,
            "description": "The same content is stored already, or it was a dry run; `already_known_as` has its names.",
        },
        201: {
            "model": UploadAnswer,
            "description": "The dataset is stored.",
            "headers": {"Location": {"schema": {"type": "string"}, "description": "Address of the dataset."}},
        },
    },
    openapi_extra=OPENAPI,
)
async def create_dataset(request: Request, response: Response, actor: Admin, services: TheServices) -> UploadAnswer:
    """Chrono runs as a zip or tar with `runs.csv` and `passport.json`, one long CSV, Parquet, or one plain file with
    its scenario in the form; any of them gzipped. As `multipart/form-data` with a part `file`, or as the raw body.
    Slope, torque and brake that change within a run are columns `slope_deg`, `torque_nm` and `brake` of its rows.

    The id is the digest of the content, so the same upload again answers 200 with the same id. Under another `name` it
    gets that name too, and is found by each of its names. `report` says of every
    run whether it was accepted and, if not, why: file, line, column and reason.
    """
    query = query_pairs(request)
    asked = asked_for(query)
    with upload_folder(services.uploads) as folder:
        upload = await receive_upload(request, folder, asked.filename)
        asked = asked_for([*query, *upload.fields])
        about(f"dataset {asked.name or 'without a name'}{', dry run' if asked.dry_run else ''}")
        result = await import_in_process(
            services.settings.store_url,
            upload.path,
            filename=upload.filename,
            form=asked.form(),
            created_by=actor,
            dry_run=asked.dry_run,
            workspace=folder,
        )
    about(f"dataset {result.dataset_id}")
    answer = _upload_answer(result, dry_run=asked.dry_run)
    if answer.created:
        response.status_code = 201
        response.headers["Location"] = answer.links.self
    return answer


def _upload_answer(result: UploadResult, *, dry_run: bool) -> UploadAnswer:
    return UploadAnswer.model_validate(
        {
            "id": result.dataset_id,
            "created": result.created,
            "stored": result.record is not None,
            "dry_run": dry_run,
            "name": result.name,
            "already_known_as": result.already_known_as,
            "report": report_document(result.report),
            "links": DatasetLinks.of(result.dataset_id),
        }
    )


@router.get("", summary="All datasets")
async def list_datasets(asked: Annotated[DatasetsQuery, Query()], services: TheServices) -> DatasetsAnswer:
    """One page of the datasets, in the order of their ids; `next` is the address of the page after it."""
    return await services.read_much(lambda: _page(services.store, asked))


@router.get("/{dataset}", summary="One dataset", responses=_NO_DATASET)
async def get_dataset(reference: Reference, services: TheServices) -> DatasetAnswer:
    """Passport, ranges and statistics of a dataset, and who uses it."""
    return await services.storage.run(lambda: _described(services, reference))


@router.get(
    "/{dataset}/preview",
    summary="A figure of a dataset",
    response_class=Response,
    response_model=None,
    responses=problem_responses(Slug.INVALID_INPUT, Slug.DATASET_NOT_FOUND, Slug.NOT_INSTALLED)
    | {
        200: {
            "description": "The distance of every run over time, and where the scenarios lie.",
            "content": {media_type: {"schema": {"type": "string"}} for media_type in _MEDIA_TYPES.values()},
        }
    },
)
async def get_dataset_preview(
    reference: Reference, asked: Annotated[PreviewQuery, Query()], services: TheServices
) -> Response:
    """The runs of a dataset at a glance."""
    record = await services.storage.run(lambda: _found(services.store, reference))
    if services.figures.statistics().tasks_waiting >= _MOST_WAITING:
        raise OverloadedError(f"{_MOST_WAITING} figures are waiting already")
    async with services.figures:
        figure = await preview_in_process(services.settings.store_url, record.id, asked.format)
    # an id is the digest of what it shows: the figure never changes
    policy = {"Content-Security-Policy": report.POLICY} if asked.format == "html" else {}
    return Response(
        figure,
        media_type=_MEDIA_TYPES[asked.format],
        headers={"Cache-Control": "private, max-age=86400", **policy},
    )


@router.get(
    "/{dataset}/download",
    summary="A dataset as Parquet",
    response_class=StreamingResponse,
    response_model=None,
    responses=_NO_DATASET
    | {
        200: {
            "description": "`runs.parquet`: one row per sample. It can be uploaded again.",
            "content": {PARQUET: {"schema": {"type": "string", "format": "binary"}}},
            "headers": {
                "ETag": {"schema": {"type": "string"}, "description": "sha256 of the file."},
                "Content-Disposition": {"schema": {"type": "string"}},
            },
        }
    },
)
async def download_dataset(reference: Reference, services: TheServices) -> StreamingResponse:
    """The runs as they are stored. If the stored file is damaged, the connection is cut before its end."""
    size_bytes, headers, pieces = await services.storage.run(lambda: _opened(services.store, reference))
    return StreamingResponse(pieces, headers=headers | {"Content-Length": str(size_bytes)}, media_type=PARQUET)


@router.delete(
    "/{dataset}",
    summary="Delete a dataset",
    status_code=204,
    response_class=Response,
    response_model=None,
    responses=_NO_DATASET | problem_responses(Slug.DATASET_IN_USE),
)
async def delete_dataset(reference: Reference, services: TheServices) -> Response:
    """Takes the whole id. Refused while a published version or an unfinished training job uses the dataset."""
    about(f"dataset {reference}")
    await services.read_much(lambda: _delete(services, reference))
    return Response(status_code=204)


@router.delete(
    "/{dataset}/names/{name}",
    summary="Take a name from a dataset",
    status_code=204,
    response_class=Response,
    response_model=None,
    responses=_NO_DATASET | problem_responses(Slug.CONFLICT),
)
async def delete_dataset_name(
    reference: Reference, name: Annotated[str, Path(description="A name of it.")], services: TheServices
) -> Response:
    """Takes the whole id. The name that the dataset was stored under stays as long as it."""
    about(f"dataset {reference}, name {name}")
    await services.read_much(lambda: _forget_name(services.store, reference, name))
    return Response(status_code=204)


def _forget_name(store: ModelStore, identity: str, name: str) -> None:
    if not layout.is_dataset_id(identity):
        raise InvalidInputError(fault("dataset", identity, "a whole id"))
    if not layout.is_dataset_name(name):
        raise InvalidInputError(fault("name", name, "a name of a dataset: A-Z a-z 0-9 . _ -, at most 63"))
    store.forget_dataset_name(identity, name)


def _page(store: ModelStore, asked: DatasetsQuery) -> DatasetsAnswer:
    ids = [each for each in store.dataset_ids() if asked.after is None or each > asked.after]
    shown = ids[: asked.limit]
    more = f"{ADDRESS}?limit={asked.limit}&after={shown[-1]}" if len(ids) > len(shown) else None
    others = store.other_dataset_names()
    return DatasetsAnswer(
        datasets=[_listed(store, identity, others.get(identity, [])) for identity in shown], next=more
    )


def _listed(store: ModelStore, identity: str, others: list[str]) -> DatasetEntry:
    """One damaged dataset must not hide the others."""
    try:
        return entry_of(store.dataset(identity), others)
    except (CorruptArtefactError, UnsupportedFormatError) as error:
        return DatasetEntry(id=identity, unreadable=str(error), links=DatasetLinks.of(identity))


def _found(store: ModelStore, reference: str) -> DatasetRecord:
    try:
        return store.dataset(reference)
    except InvalidReferenceError as error:
        raise InvalidInputError(InputFault("dataset", reference, "a whole id", str(error))) from error


def _described(services: Services, reference: str) -> DatasetAnswer:
    record = _found(services.store, reference)
    try:
        jobs = jobs_of(services.jobs, record.id)
    except JobError:
        jobs = None
    return DatasetAnswer(
        **entry_of(record, services.store.dataset_names(record)).model_dump(),
        passport=json.loads(services.store.read_dataset_file(record.id, PASSPORT_FILE)),
        source=record.source,
        files=record.files,
        used_by=DatasetUsers(versions=services.store.datasets_in_use().get(record.id, []), jobs=jobs),
    )


def _opened(store: ModelStore, reference: str) -> tuple[int, dict[str, str], Iterator[bytes]]:
    record = _found(store, reference)
    entry, pieces = store.stream_dataset_file(record.id, RUNS_FILE)
    first = next(pieces)  # what is gone or not permitted shows here, while another answer can still be given
    headers = {
        "ETag": f'"{entry.sha256}"',
        "Content-Disposition": f'attachment; filename="{record.name}.parquet"',
    }

    def all_pieces() -> Iterator[bytes]:
        yield first
        yield from pieces

    return entry.size_bytes, headers, all_pieces()


def _delete(services: Services, identity: str) -> None:
    if not layout.is_dataset_id(identity):
        record = _found(services.store, identity)
        raise InvalidInputError(fault("dataset", identity, f"the whole id, {record.id}"))
    # by the id alone: what is damaged cannot be looked up
    delete_unused(services.store, services.jobs, identity)
