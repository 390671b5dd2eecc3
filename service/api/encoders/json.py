"""A prediction as one JSON object: the field names of `service.api.answers.PredictionAnswer`."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from service.api.encoders.numbers import dump
from service.api.encoders.subject import Subject, domain_document


def encode_json(subject: Subject) -> bytes:
    """The whole answer, UTF-8. Raises NonFiniteError."""
    prediction = subject.prediction
    answer: dict[str, Any] = {
        "model": subject.model(),
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


__all__ = ["domain_document", "encode_json"]
