"""The manifest of a model version: what the checkpoint is, where it holds, how good it is, where it came from.

The store owns identity, files and format; the JSON objects `checkpoint`, `domain`, `band` and `metrics` belong to
those who write and read them, and pass through untouched.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, StringConstraints

from model_store.documents import Document, Json, JsonObject, JsonObjectDraft, Moment, Text
from model_store.files import Files, Sha256
from model_store.layout import MAX_VERSION

Actor = Annotated[Text, StringConstraints(min_length=1, max_length=200)]
"""Who did it: a person, a job, a service."""

Note = Annotated[Text, StringConstraints(max_length=4000)]


class Lineage(BaseModel):
    """What a version was made from: enough to make it again."""

    model_config = ConfigDict(extra="allow", frozen=True)

    job: Annotated[Text, StringConstraints(max_length=128)] | None = None
    """Id of the training job; None where a person trained it, and in versions older than jobs."""
    datasets: list[Sha256] = Field(default_factory=list)
    split: Json = None
    seed: int | None = None
    threads: int | None = None
    config: JsonObjectDraft = Field(default_factory=dict)
    libraries: dict[Text, Text] = Field(default_factory=dict)
    code_version: Text = ""
    command: Text = ""
    same_weights_as: Text | None = None
    """The version, as name@2, that had the same weights when this one was published."""


class ManifestDraft(BaseModel):
    """What a publisher says about a version; the store adds name, number, time and digests.

    Raises pydantic's ValidationError (a ValueError) for unknown fields, NaN, and what is not JSON.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    created_by: Actor
    description: Note = ""
    checkpoint: JsonObjectDraft
    domain: JsonObjectDraft
    band: JsonObjectDraft | None = None
    metrics: JsonObjectDraft
    lineage: Lineage


class Manifest(Document):
    """One published version. Immutable; unknown fields are kept; `files` maps path to digest and size."""

    format: str = "rover-twin-manifest"
    name: str
    version: Annotated[int, Field(ge=1, le=MAX_VERSION)]
    created_at: Moment
    created_by: Text
    description: Text = ""
    files: Files
    checkpoint: JsonObject
    domain: JsonObject
    band: JsonObject | None = None
    metrics: JsonObject
    lineage: Lineage
