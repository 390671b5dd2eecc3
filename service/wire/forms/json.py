"""A prediction as one JSON object: the field names of `service.wire.prediction_answer.PredictionAnswer`."""

from __future__ import annotations

from typing import Any

from service.wire.forms.numbers import dump_finite, require_finite, require_finite_columns, times_text
from service.wire.forms.subject import Subject, domain_document


def encode_json(subject: Subject) -> bytes:
    """The whole answer, UTF-8. Raises NonFiniteError."""
    prediction = subject.prediction
    answer: dict[str, Any] = {
        "model": subject.model(),
        "scenario": prediction.scenario,
        "frame": prediction.frame,
        "trajectory": prediction.trajectory | {"time_s": times_text(prediction.trajectory["time_s"])},
    }
    if prediction.prior is not None:
        answer["prior"] = {"name": prediction.prior_name, **prediction.prior}
    if prediction.band is not None:
        answer["band"] = {"level": prediction.band.level, **prediction.band.columns()}
    # all that was computed; the verdict follows from the question and from the manifest, whose numbers are finite
    require_finite_columns(subject.columns(), "answer")
    require_finite(prediction.summary, "answer.summary")
    answer["domain"] = domain_document(prediction.domain)
    answer["summary"] = prediction.summary
    return dump_finite(answer)


__all__ = ["domain_document", "encode_json"]
