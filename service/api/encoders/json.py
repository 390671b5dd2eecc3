"""A prediction as one JSON object: the field names of `service.api.answers.PredictionAnswer`."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from service.api.encoders.numbers import dump
from service.api.encoders.subject import Subject
from service.learning.domain import DomainVerdict


def encode_json(subject: Subject) -> bytes:
    """The whole answer, UTF-8. Raises NonFiniteError."""
    twin, prediction = subject.loaded.twin, subject.prediction
    answer: dict[str, Any] = {
        "model": {"name": twin.name, "version": twin.version, "alias": subject.loaded.alias},
        "scenario": asdict(prediction.scenario),
        "frame": prediction.frame,
        "trajectory": dict(prediction.trajectory),
    }
    if subject.with_prior:
        answer["prior"] = {"name": prediction.prior_name, **prediction.prior}
    if prediction.band is not None:
        answer["band"] = {"level": prediction.band.level, **prediction.band.columns()}
    answer["domain"] = domain_document(prediction.domain)
    answer["summary"] = asdict(prediction.summary)
    return dump(answer)


def domain_document(verdict: DomainVerdict) -> dict[str, Any]:
    """The verdict as every answer shows it."""
    return {
        "inside": verdict.inside,
        "reasons": [asdict(reason) | {"detail": reason.detail} for reason in verdict.reasons],
        "distance": verdict.distance,
        "nearest_runs": [asdict(run) for run in verdict.nearest_runs],
    }
