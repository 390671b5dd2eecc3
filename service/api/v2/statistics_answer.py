"""Triton's statistics as the OpenAPI document shows them; `service.api.http.statistics` counts."""

from __future__ import annotations

from pydantic import BaseModel, Field


class Duration(BaseModel):
    """How often, and nanoseconds in all."""

    count: int
    ns: int


class InferenceStatistics(BaseModel):
    """Requests that were answered or failed, and where the time of the answered ones went."""

    success: Duration
    fail: Duration
    queue: Duration
    compute_input: Duration
    compute_infer: Duration
    compute_output: Duration
    cache_hit: Duration = Field(description="Always zero: there is no cache here.")


class BatchStatistics(BaseModel):
    """Nothing here has them: requests are not put together."""


class VersionStatistics(BaseModel):
    """What was asked of one version."""

    name: str
    version: str
    last_inference: int = Field(description="Milliseconds since 1970; 0 before the first.")
    inference_count: int = Field(description="Scenarios.")
    execution_count: int = Field(description="Requests.")
    inference_stats: InferenceStatistics
    batch_stats: list[BatchStatistics] = Field(description="Empty.")


class ModelStatistics(BaseModel):
    """Triton's statistics, of this process since its start."""

    model_stats: list[VersionStatistics]
