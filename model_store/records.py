"""The smaller documents: where an alias pointed and why, and what a dataset is."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from model_store.documents import Document, JsonObject, JsonObjectDraft, Moment, Text
from model_store.files import Files, Sha256
from model_store.layout import MAX_SEQ, MAX_VERSION, check_alias, check_dataset_name
from model_store.manifest import Actor, Note


class AliasRecord(Document):
    """One move of an alias. Records are only ever added; the one with the highest `seq` holds.

    `previous_seq` is the record a rollback from here returns to, None when there is nothing to return to.
    """

    format: str = "rover-twin-alias"
    seq: Annotated[int, Field(ge=1, le=MAX_SEQ)]
    version: Annotated[int, Field(ge=1, le=MAX_VERSION)]
    time: Moment
    actor: Actor
    reason: Note = ""
    previous_seq: Annotated[int, Field(ge=1, le=MAX_SEQ)] | None = None


class Retired(BaseModel):
    """A version that is archived or deleted; `seq` is the record that says when, by whom and why."""

    model_config = ConfigDict(extra="allow", frozen=True)

    state: Literal["archived", "deleted"]
    seq: Annotated[int, Field(ge=1, le=MAX_SEQ)]


class OpenMove(BaseModel):
    """Record `seq` of this alias is about to be written, and will name this version."""

    model_config = ConfigDict(extra="allow", frozen=True)

    alias: Annotated[str, AfterValidator(check_alias)]
    seq: Annotated[int, Field(ge=1, le=MAX_SEQ)]
    version: Annotated[int, Field(ge=1, le=MAX_VERSION)]


class LifecycleRecord(Document):
    """One change of what becomes of a model's versions, and everything that holds after it.

    `what` is archived, deleted, published (restored) or move (of an alias, announced before it happens).
    """

    format: str = "rover-twin-lifecycle"
    seq: Annotated[int, Field(ge=1, le=MAX_SEQ)]
    what: Text
    version: Annotated[int, Field(ge=1, le=MAX_VERSION)]
    time: Moment
    actor: Actor
    reason: Note = ""
    retired: dict[str, Retired] = Field(default_factory=dict)
    restored: dict[str, int] = Field(default_factory=dict)  # the record of the last restoring, of each version in use
    moves: list[OpenMove] = Field(default_factory=list)


class DatasetDraft(BaseModel):
    """What somebody says about a dataset; the store adds id, time and digests.

    `name` is for people (A-Z a-z 0-9 . _ -, at most 63) and need not be unique. Raises pydantic's ValidationError
    (a ValueError) for unknown fields, NaN, and what is not JSON.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: Annotated[str, AfterValidator(check_dataset_name)]
    created_by: Actor
    description: Note = ""
    summary: JsonObjectDraft = Field(default_factory=dict)
    source: JsonObjectDraft = Field(default_factory=dict)


class DatasetName(Document):
    """Another name of a dataset, given to it by somebody who put the same content again."""

    format: str = "rover-twin-dataset-name"
    name: Annotated[str, AfterValidator(check_dataset_name)]
    created_at: Moment
    created_by: Actor


class DatasetRecord(Document):
    """One published dataset. Immutable; unknown fields are kept; `files` maps name to digest and size."""

    format: str = "rover-twin-dataset"
    id: Sha256
    name: Text
    created_at: Moment
    created_by: Text
    description: Text = ""
    files: Files
    summary: JsonObject = Field(default_factory=dict)
    source: JsonObject = Field(default_factory=dict)
