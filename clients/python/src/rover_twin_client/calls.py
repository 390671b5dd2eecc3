"""Builds the calls that predict and describe models. Both clients send these calls. No I/O."""

from __future__ import annotations

import math
import operator
import os
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from http import HTTPStatus
from pathlib import Path
from typing import Any, Generic, TypeVar, cast

import numpy as np

from rover_twin_client import parsing, responses
from rover_twin_client.answers import MobilityMap, ModelInfo, Prediction, Readiness, SuggestedRuns
from rover_twin_client.document import Node
from rover_twin_client.errors import FieldFault, InvalidInputError

Answer = TypeVar("Answer")
Value = TypeVar("Value")
PREDICTIONS = "/v1/predictions"
_SHOWN = 120  # characters of a value that a message shows
NAME = re.compile(r"[a-z0-9][a-z0-9-]{0,62}")


@dataclass(frozen=True, slots=True)
class Call(Generic[Answer]):
    """One request to `path` below the base address, and `parse`, which reads the answer.

    `retried` allows the client to send it again. `json` or `form` is its body. `read_s` is how long the
    answer may take, in seconds, when that is longer than usual: by default, or with `always_patient` whatever timeout
    the caller chose. `numbers` are those that `query` has as text. An answer succeeds with one of `statuses`, and its
    body is JSON unless `is_document` is false. `words` has this client's name for fields that the service calls
    otherwise.
    """

    path: str
    parse: Callable[[Node], Answer]
    query: Mapping[str, str] = field(default_factory=dict)
    retried: bool = True
    method: str = "GET"
    headers: Mapping[str, str] = field(default_factory=dict)
    json: Mapping[str, Any] | None = None
    form: Mapping[str, str] | None = None
    statuses: tuple[int, ...] = (200,)
    read_s: float | None = None
    always_patient: bool = False
    numbers: Mapping[str, float] = field(default_factory=dict)
    is_document: bool = True
    words: Mapping[str, str] = field(default_factory=dict)

    def read(self, status: int, headers: Mapping[str, str], content: bytes) -> Answer:
        """Returns the value of the answer, or raises the named error (see `responses.document`)."""
        if status == HTTPStatus.NO_CONTENT or not self.is_document:
            responses.require(status, headers, content, self.statuses, self.words, self.numbers)
            return self.parse(Node(content))
        return self.parse(responses.document(status, headers, content, self.statuses, self.words, self.numbers))


def predict(
    slope_deg: float,
    mass_kg: float,
    torque_nm: float,
    horizon_s: float | None,
    *,
    dt_s: float | None,
    times_s: Iterable[float] | None = None,
    model: str | None,
    frame: str,
    include: Iterable[str],
    strict: bool,
    band_level: float | None = None,
) -> Call[Prediction]:
    """/v1/predictions, by GET unless the times would not fit into an address.

    The service checks the ranges; this refuses only what is not a number, and a level without a band.
    """
    wanted = inclusions(include)
    require_band(wanted, band_level)
    strict = flag("strict", strict)
    numbers: dict[str, Any] = {"slope_deg": slope_deg, "mass_kg": mass_kg, "torque_nm": torque_nm}
    numbers |= said(horizon_s=horizon_s, dt_s=dt_s, band_level=band_level)
    if times_s is not None:
        body: dict[str, Any] = {name: finite(name, value) for name, value in numbers.items()}
        body |= said(model=model) | {"frame": frame, "times_s": column("times_s", times_s)}
        body |= ({"include": list(wanted)} if wanted else {}) | ({"strict": True} if strict else {})
        return Call(PREDICTIONS, parsing.prediction, method="POST", json=body)
    numbers = {name: number(name, value) for name, value in numbers.items()}
    query = {name: repr(value) for name, value in numbers.items()}
    query |= said(model=model) | {"frame": frame}
    query |= ({"include": ",".join(wanted)} if wanted else {}) | ({"strict": "true"} if strict else {})
    return Call(PREDICTIONS, parsing.prediction, query, numbers=numbers)


def in_form(call: Call[Any], form: str) -> Call[bytes]:
    """The same question, answered as a file: its bytes."""
    if not isinstance(form, str) or not form:
        raise refused("form", form, "the name of a form, such as csv")
    query = {**call.query, "format": form}
    headers = {"Accept": "*/*"}
    return replace(call, parse=_content, query=query, headers=headers, is_document=False, words={"format": "form"})


def form_of(form: str | None, save_to: str | os.PathLike[str] | None) -> str | None:
    """The form that was asked for: by name, or by the ending of the file to save to. None: values of Python."""
    if save_to is None:
        return form
    if not isinstance(save_to, str | os.PathLike) or not isinstance(os.fspath(save_to), str):
        raise refused("save_to", save_to, "the path of a file, as text or a Path")
    if form is not None:
        return form
    ending = Path(save_to).suffix.removeprefix(".").lower()
    if not ending:
        raise refused("save_to", str(save_to), "a file whose name ends with a form, such as .csv, or `form` beside it")
    return ending


def inclusions(include: Iterable[str]) -> tuple[str, ...]:
    """The parts to add; one alone may be a text. Raises InvalidInputError for what are no words."""
    wanted: object = (include,) if isinstance(include, str) else include
    words = tuple(wanted) if isinstance(wanted, Iterable) and not isinstance(wanted, bytes) else (None,)
    if not all(isinstance(word, str) for word in words):
        raise refused("include", include, 'a list of words, such as ["band"]')
    return words


def flag(name: str, value: object) -> bool:
    """A flag of Python or NumPy; raises InvalidInputError for anything else, such as the text "no"."""
    if not isinstance(value, bool | np.bool_):
        raise refused(name, value, "True or False")
    return bool(value)


def require_band(include: Iterable[str], band_level: float | None) -> None:
    """Raises InvalidInputError for the level of a band that is not asked for."""
    if band_level is not None and "band" not in inclusions(include):
        raise refused("band_level", band_level, 'nothing without include=["band"]: it is the level of that band')


def mobility(
    mass_kg: float,
    torque_min_nm: float,
    torque_max_nm: float | None,
    horizon_s: float,
    *,
    torque_steps: int | None,
    slope_min_deg: float | None,
    slope_max_deg: float | None,
    slope_steps: int | None,
    confidence: float | None,
    model: str | None,
) -> Call[MobilityMap]:
    """GET /v1/mobility. The service has a default for every None, and checks the ranges."""
    numbers = {
        "mass_kg": mass_kg,
        "torque_min_nm": torque_min_nm,
        "horizon_s": horizon_s,
        **said(torque_max_nm=torque_max_nm, slope_min_deg=slope_min_deg, slope_max_deg=slope_max_deg),
        **said(confidence=confidence),
    }
    counts = said(torque_steps=torque_steps, slope_steps=slope_steps)
    numbers = {name: number(name, value) for name, value in numbers.items()}
    query = {name: repr(value) for name, value in numbers.items()}
    query |= {name: whole(name, value) for name, value in counts.items()}
    return Call("/v1/mobility", parsing.mobility, query | said(model=model), numbers=numbers | counts)


def suggested_runs(name: str, version: int, n: int | None) -> Call[SuggestedRuns]:
    """GET /v1/models/{name}/versions/{version}/suggested-runs."""
    query = {field: whole(field, value) for field, value in said(n=n).items()}
    return Call(f"{_version_path(name, version)}/suggested-runs", parsing.suggested_runs, query)


def models() -> Call[list[ModelInfo]]:
    """GET /v1/models."""
    return Call("/v1/models", parsing.models)


def model(name: str) -> Call[ModelInfo]:
    """GET /v1/models/{name}."""
    return Call(f"/v1/models/{checked_name(name)}", parsing.model)


def manifest(name: str, version: int) -> Call[dict[str, Any]]:
    """GET /v1/models/{name}/versions/{version}."""
    return Call(_version_path(name, version), parsing.manifest)


def ready() -> Call[Readiness]:
    """GET /health/ready. Never repeated: "not ready" is an answer that the caller wants at once."""
    return Call("/health/ready", parsing.readiness, retried=False)


def number(name: str, value: object) -> float:
    """A number of Python or NumPy as a float; raises InvalidInputError for anything else."""
    try:
        return float(value)  # type: ignore[arg-type] # anything but a number raises, and is named below
    except (TypeError, ValueError, OverflowError) as fault:
        raise refused(name, value, "a number") from fault


def finite(name: str, value: object) -> float:
    """A number that JSON can hold as a float; raises InvalidInputError for anything else."""
    if not math.isfinite(found := number(name, value)):
        raise refused(name, value, "a finite number")
    return found


def whole(name: str, value: object) -> str:
    """An integer as text; raises InvalidInputError for anything else."""
    if isinstance(value, bool):
        raise refused(name, value, "a whole number")
    try:
        # index() accepts the integers of Python and NumPy but no float. str() refuses thousands of digits.
        return str(operator.index(value))  # type: ignore[arg-type] # anything but an integer raises, and is named below
    except (TypeError, ValueError) as fault:
        raise refused(name, value, "a whole number") from fault


def column(name: str, values: object) -> list[Any]:
    """One column as a list; raises InvalidInputError unless it is a flat list of finite numbers or flags."""
    if (
        not hasattr(values, "__array__")
        and not isinstance(values, str | bytes | Mapping)
        and isinstance(values, Iterable)
    ):
        values = list(values)  # a range or a generator
    try:
        found = np.asarray(values)
    except ValueError as ragged:
        raise refused(name, "a ragged list", "a flat list of numbers") from ragged
    if found.ndim != 1 or (found.size and found.dtype.kind not in "fiub"):
        raise refused(name, values, "a flat list of numbers")
    if found.dtype.kind == "f" and not np.isfinite(found).all():
        raise refused(name, float(found[~np.isfinite(found)][0]), "finite numbers")
    listed: list[Any] = found.tolist()
    return listed


def said(**values: Value | None) -> dict[str, Value]:
    """The values that are not None."""
    return {name: value for name, value in values.items() if value is not None}


def _content(answer: Node) -> bytes:
    return cast("bytes", answer.value)


def _version_path(name: str, version: int) -> str:
    if isinstance(version, bool) or not isinstance(version, int) or version < 1:
        raise refused("version", version, "a positive integer")
    return f"/v1/models/{checked_name(name)}/versions/{whole('version', version)}"


def checked_name(name: str, field: str = "name") -> str:
    """The name of a model or an alias; raises InvalidInputError for anything else."""
    # The name becomes part of the address, where `..` or a slash would lead elsewhere.
    if not isinstance(name, str) or not NAME.fullmatch(name):
        raise refused(field, name, "1 to 63 of a-z, 0-9 and -, not starting with -")
    return name


def refused(name: str, value: object, allowed: str) -> InvalidInputError:
    """The error for a value that the client refuses to send."""
    try:
        shown = " ".join(repr(value).split())  # a table has lines
    except ValueError:  # str() and repr() refuse an integer of thousands of digits
        shown = "a number too long to write"
    if len(shown) > _SHOWN:
        shown = f"{shown[:_SHOWN]}..."
    message = f"{name} is {shown}, allowed is {allowed}"
    fault = FieldFault(field=name, value=value, allowed=allowed, message=message)
    return InvalidInputError(message, faults=(fault,))
