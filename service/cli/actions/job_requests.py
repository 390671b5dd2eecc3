"""From the options of `rover-twin jobs start` to a job in the queue."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from service.jobs.request import TrainingJobRequest


def request_of(given: Mapping[str, Any]) -> TrainingJobRequest:
    """The request in which options that are None, at any depth, have their defaults. Raises ValidationError."""
    return TrainingJobRequest.model_validate(_without_none(given))


def _without_none(given: Mapping[str, Any]) -> dict[str, Any]:
    return {
        name: _without_none(value) if isinstance(value, Mapping) else value
        for name, value in given.items()
        if value is not None
    }
