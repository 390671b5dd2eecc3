"""From a request's body to the body of its answer: what runs on a worker thread, unless it is quick."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from fastapi import Response
from pydantic import BaseModel, Field

from service.api.http.statistics import Statistics
from service.api.v2.question import InferenceQuestion, question_of
from service.api.v2.signature import Answered, Values
from service.api.v2.wire import Parameters, request_of, response_of, split, unpacked
from service.twin import Count, Loaded

# What is answered in about half a millisecond: handing it to a thread would take longer.
_SCENARIOS_AT_ONCE, _TEXT_AT_ONCE, _BINARY_AT_ONCE = 4, 20_000, 25_000


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


@dataclass(frozen=True, slots=True, eq=False)
class Inference:
    """A request that was read, and what is to be counted when it is answered."""

    loaded: Loaded
    request_id: str | None
    question: InferenceQuestion
    statistics: Statistics
    arrived_ns: int
    began_ns: int
    read_ns: int

    @property
    def quick(self) -> bool:
        """Whether it is answered in about half a millisecond."""
        values = len(self.question.scenarios) * self.question.time_s.shape[-1]
        text = not all(each.binary for each in self.question.outputs)
        most = _TEXT_AT_ONCE if text else _BINARY_AT_ONCE
        # a scenario of its own takes as long as thousands of values
        return self.loaded.twin.model.quick and len(self.question.scenarios) <= _SCENARIOS_AT_ONCE and values <= most


def read(call: Call, loaded: Loaded, bounds: Bounds, statistics: Statistics) -> Inference:
    """Read a request. One that cannot be read is counted, and what is wrong with it raised."""
    began = time.perf_counter_ns()
    with _counting(loaded, call.arrived_ns, statistics):
        body = unpacked(call.body, call.encoding, bounds.max_body_bytes)
        content, tail = split(body, call.header_length)
        request = request_of(content)
        question = question_of(request, tail, loaded.twin, bounds.max_points)
    return Inference(loaded, request.id, question, statistics, call.arrived_ns, began, time.perf_counter_ns())


def answer(inference: Inference, count: Count) -> Response:
    """Answer a request and count it. Raises what predicting raises."""
    loaded, question = inference.loaded, inference.question
    started = time.perf_counter_ns()
    with _counting(loaded, inference.arrived_ns, inference.statistics):
        answered = _answered(question, loaded)
        inferred = time.perf_counter_ns()
        count(loaded.twin, (inferred - started) / 1e9, answered.outcomes, answered.outside)
        response = _response(inference.request_id, question, loaded, answered)
    parts_ns = {
        "queue": inference.began_ns - inference.arrived_ns + started - inference.read_ns,
        "compute_input": inference.read_ns - inference.began_ns,
        "compute_infer": inferred - started,
        "compute_output": time.perf_counter_ns() - inferred,
    }
    inference.statistics.succeeded(loaded.twin.name, loaded.twin.version, len(question.scenarios), parts_ns)
    return response


def _answered(question: InferenceQuestion, loaded: Loaded) -> Answered:
    """One scenario is predicted as the API's own routes do, sooner than many of which there is one."""
    twin, prior, speed = loaded.twin, question.with_prior, question.with_speed
    common = question.time_s, question.frame, question.band_level
    if len(question.scenarios) == 1 and question.time_s.ndim == 1:
        return Answered.of_one(twin.predict(question.scenarios[0], *common, with_prior=prior, with_speed=speed))
    return Answered.of_many(twin.predict_many(question.scenarios, *common, with_prior=prior, with_speed=speed))


@contextmanager
def _counting(loaded: Loaded, arrived_ns: int, statistics: Statistics) -> Iterator[None]:
    """Counts a request that fails inside."""
    try:
        yield
    except Exception:
        statistics.failed(loaded.twin.name, loaded.twin.version, time.perf_counter_ns() - arrived_ns)
        raise


def _response(request_id: str | None, question: InferenceQuestion, loaded: Loaded, answered: Answered) -> Response:
    parameters: dict[str, str | float] = {"frame": str(question.frame)}
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
        values = wanted.tensor.take(answered)
        described = {"name": wanted.tensor.name, "datatype": wanted.tensor.datatype, "shape": _shape(values)}
        outputs.append((described, values, wanted.binary))
    return response_of(document, outputs)


def _shape(values: Values) -> list[int]:
    return [len(values)] if isinstance(values, list) else list(values.shape)
