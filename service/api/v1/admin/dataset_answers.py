"""The wire models of datasets, and how they are made from the store's records."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from typing import Annotated, Any, Self

from pydantic import BaseModel, Field

from model_store import DatasetRecord, FileEntry
from service.wire.datasets import DatasetUsers, ReportAnswer

ADDRESS = "/v1/admin/datasets"


class DatasetLinks(BaseModel):
    """Where to go from here."""

    self: str
    preview: str
    download: str

    @classmethod
    def of(cls, identity: str) -> Self:
        """The addresses of one dataset."""
        own = f"{ADDRESS}/{identity}"
        return cls(self=own, preview=f"{own}/preview", download=f"{own}/download")


class UploadAnswer(BaseModel):
    """What became of an upload."""

    id: Annotated[
        str,
        Field(
            description="Digest of the content: the same runs have the same id, in whatever form they were uploaded."
        ),
    ]
    created: Annotated[bool, Field(description="Whether this upload stored it.")]
    stored: Annotated[bool, Field(description="Whether the store has it now, by this upload or before.")]
    dry_run: bool
    name: Annotated[
        str | None, Field(description="The name that it is found by: as asked for, else its first; null if not stored.")
    ]
    already_known_as: Annotated[
        list[str],
        Field(
            description="Its names before this upload: the one that it was stored under, then the others in the order "
            "of the alphabet; none where the content was new."
        ),
    ] = []
    report: ReportAnswer
    links: DatasetLinks


class DatasetEntry(BaseModel):
    """A dataset in a list. `unreadable` says why a damaged one shows nothing more; null when all is well."""

    id: str
    name: str = ""
    names: Annotated[list[str], Field(description="Every name that it is found by, the first one first.")] = []
    created_at: datetime | None = None
    created_by: str = ""
    description: str = ""
    summary: Annotated[dict[str, Any], Field(description="Runs, rows, ranges, sampling, columns and sets.")] = {}
    unreadable: str | None = None
    links: DatasetLinks


class DatasetsAnswer(BaseModel):
    """One page of the datasets, in the order of their ids."""

    datasets: list[DatasetEntry]
    next: Annotated[str | None, Field(description="Address of the next page; null on the last one.")]


class DatasetAnswer(DatasetEntry):
    """Everything about one dataset."""

    passport: Annotated[dict[str, Any], Field(description="What was simulated, as uploaded.")]
    source: Annotated[dict[str, Any], Field(description="The files that it was made from.")]
    files: dict[str, FileEntry]
    used_by: DatasetUsers


def entry_of(record: DatasetRecord, others: Sequence[str]) -> DatasetEntry:
    """What a list shows of a dataset; `others` are its names beside the first one."""
    return DatasetEntry(
        id=record.id,
        name=record.name,
        names=list(dict.fromkeys([record.name, *others])),
        created_at=record.created_at,
        created_by=record.created_by,
        description=record.description,
        summary=record.summary,
        links=DatasetLinks.of(record.id),
    )
