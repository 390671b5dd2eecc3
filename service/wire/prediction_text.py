"""The JSON answer to one scenario, put together from texts: `PredictionAnswer`, as orjson would write it, sooner."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache

import orjson

from service.learning.domain import DomainVerdict
from service.physics.scenario import Array
from service.twin import NonFiniteError, Prediction
from service.twin.summary import Summary
from service.wire.forms.numbers import column_list, dump_finite, require_finite, require_finite_columns
from service.wire.forms.subject import Subject, reasons_document

_ANSWER = (
    b'{"model":%b,"scenario":{"slope_deg":%b,"mass_kg":%b,"torque_nm":%b,"horizon_s":%b},"frame":"%b",'
    b'"trajectory":{%b}%b,"domain":{"inside":%b,"reasons":%b,"distance":%b,"nearest_runs":[%b]},"summary":'
    b'{"outcome":"%b","final_x_m":%b,"final_y_m":%b,"distance_m":%b,"mean_speed_m_s":%b,"slip_ratio":%b}}'
)
_RUN = b'{"run":%b,"slope_deg":%b,"mass_kg":%b,"torque_nm":%b,"left_out_final_error_m":%b,"distance":%b}'
_RUN_NUMBERS = 5


def prediction_text(subject: Subject) -> bytes:
    """The whole answer, UTF-8. Raises NonFiniteError."""
    prediction, loaded, twin = subject.prediction, subject.loaded, subject.loaded.twin.manifest
    _require_finite_summary(prediction.summary)
    try:
        trajectory, besides = _columns(prediction.trajectory), _besides(prediction)
    except NonFiniteError:
        require_finite_columns(subject.columns(), "answer")  # which says where
        raise
    verdict, numbers = prediction.domain, _numbers(prediction)
    return _ANSWER % (
        _model(twin.name, twin.version, loaded.alias),
        *numbers[:4],
        prediction.frame.encode(),
        trajectory,
        besides,
        b"true" if verdict.inside else b"false",
        dump_finite(reasons_document(verdict.reasons)) if verdict.reasons else b"[]",
        numbers[4],
        _runs(verdict, numbers[10:]),
        prediction.summary.outcome.encode(),
        *numbers[5:10],
    )


def _numbers(prediction: Prediction) -> list[bytes]:
    """All numbers that stand alone as texts, in one go: scenario (4), distance, summary (5), nearest runs (5 each)."""
    scenario, summary = prediction.scenario, prediction.summary
    numbers = [
        *(scenario.slope_deg, scenario.mass_kg, scenario.torque_nm, scenario.horizon_s, prediction.domain.distance),
        *(summary.final_x_m, summary.final_y_m, summary.distance_m, summary.mean_speed_m_s, summary.slip_ratio),
    ]
    for run in prediction.domain.nearest_runs:
        numbers += run.slope_deg, run.mass_kg, run.torque_nm, run.left_out_final_error_m, run.distance
    return orjson.dumps(numbers)[1:-1].split(b",")


def _runs(verdict: DomainVerdict, numbers: list[bytes]) -> bytes:
    places = enumerate(verdict.nearest_runs)
    return b",".join([_RUN % (_quoted(run.run), *numbers[5 * at : 5 * at + _RUN_NUMBERS]) for at, run in places])


def _columns(columns: Mapping[str, Array]) -> bytes:
    """Raises NonFiniteError."""
    return b",".join([b'"%b":%b' % (name.encode(), column_list(name, values)) for name, values in columns.items()])


def _besides(prediction: Prediction) -> bytes:
    """Prior and band, where they were asked for. Raises NonFiniteError."""
    told = b""
    if prediction.prior is not None:
        told += b',"prior":{"name":%b,%b}' % (_quoted(prediction.prior_name), _columns(prediction.prior))
    if prediction.band is not None:
        told += b',"band":{"level":%b,%b}' % (orjson.dumps(prediction.band.level), _columns(prediction.band.columns()))
    return told


def _require_finite_summary(summary: Summary) -> None:
    """The verdict follows from the question and from the manifest, whose numbers are finite. Raises NonFiniteError."""
    total = summary.final_x_m + summary.final_y_m + summary.distance_m + summary.mean_speed_m_s
    if not math.isfinite(total + (summary.slip_ratio or 0.0)):
        require_finite({"summary": summary}, "answer")  # which says where


@lru_cache(maxsize=1024)
def _quoted(text: str) -> bytes:
    return orjson.dumps(text)


@lru_cache(maxsize=64)
def _model(name: str, version: int, alias: str | None) -> bytes:
    return orjson.dumps({"name": name, "version": version, "alias": alias})
