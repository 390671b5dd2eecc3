"""From a request's body to the body of its answer: what runs on a worker thread."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fastapi import Response
from pydantic import BaseModel, Field

from service.api.inference.question import Question, question_of
from service.api.inference.signature import Values
from service.api.inference.statistics import Statistics
from service.api.inference.wire import Parameters, request_of, response_of, split, unpacked
from service.twin import Loaded, PredictionBatch


class AnsweredOutput(BaseModel):
    """One output tensor; in binary it has `parameters.binary_data_size` in place of `data`."""

    name: str
    datatype: str
    shape: list[int]
    parameters: Parameters | None = None
    data: list[Any] | None = Field(default=None, description="Values in row-major order.")


class InferenceAnswer(BaseModel):
    """The JSON part of an answer; `id` is that of the request."""

    model_name: str
    model_version: str
    id: str | None = None
    parameters: Parameters = Field(description="`frame`; with a band its `band_level`; `alias` where one was followed.")
    outputs: list[AnsweredOutput]


@dataclass(frozen=True, slots=True)
class Call:
    """One request as it came: the body, and the two headers that say how to read it."""

    body: bytes
    header_length: str | None
    encoding: str
    arrived_ns: int
    """Of `time.perf_counter_ns`."""


@dataclass(frozen=True, slots=True)
class Bounds:
    """What one request may ask for."""

    max_points: int
    max_body_bytes: int


def answer(call: Call, loaded: Loaded, bounds: Bounds, statistics: Statistics) -> Response:
    """Answer a request and count it. Raises what reading and predicting raise."""
    twin = loaded.twin
    began = time.perf_counter_ns()
    try:
        body = unpacked(call.body, call.encoding, bounds.max_body_bytes)
        content, tail = split(body, call.header_length)
        request = request_of(content)
        question = question_of(request, tail, twin, bounds.max_points)
        read = time.perf_counter_ns()
        batch = twin.predict_many(
            question.scenarios,
            question.time_s,
            question.frame,
            question.band_level,
            with_prior=question.with_prior,
        )
        inferred = time.perf_counter_ns()
        response = _response(request.id, question, loaded, batch)
    except Exception:
        statistics.failed(twin.name, twin.version, time.perf_counter_ns() - call.arrived_ns)
        raise
    parts_ns = {
        "queue": began - call.arrived_ns,
        "compute_input": read - began,
        "compute_infer": inferred - read,
        "compute_output": time.perf_counter_ns() - inferred,
    }
    statistics.succeeded(twin.name, twin.version, len(batch), parts_ns)
    return response


def _response(request_id: str | None, question: Question, loaded: Loaded, batch: PredictionBatch) -> Response:
    parameters: dict[str, str | float] = {"frame": question.frame.value}
    if question.band_level is not None:
        parameters["band_level"] = question.band_level
    if loaded.alias is not None:
        parameters["alias"] = loaded.alias
    document: Mapping[str, Any] = {
        "model_name": loaded.twin.name,
        "model_version": str(loaded.twin.version),
        **({} if request_id is None else {"id": request_id}),
        "parameters": parameters,
    }
    outputs = []
    for wanted in question.outputs:
        values = wanted.tensor.take(batch)
        described = {"name": wanted.tensor.name, "datatype": wanted.tensor.datatype, "shape": _shape(values)}
        outputs.append((described, values, wanted.binary))
    return response_of(document, outputs)


def _shape(values: Values) -> list[int]:
    return [len(values)] if isinstance(values, list) else list(values.shape)
