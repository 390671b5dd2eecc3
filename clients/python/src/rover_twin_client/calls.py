"""The questions one can ask: each builds a `Call`, the address to GET and how to read the answer. No I/O.

The synchronous and the asynchronous client send the same calls, so both speak the same words.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

from rover_twin_client import parsing, responses
from rover_twin_client.answers import ModelInfo, Prediction, Readiness
from rover_twin_client.document import Node
from rover_twin_client.errors import FieldFault, InvalidInputError

Answer = TypeVar("Answer")
NAME = re.compile(r"[a-z0-9][a-z0-9-]{0,62}")


@dataclass(frozen=True, slots=True)
class Call(Generic[Answer]):
    """One GET: `path` below the base address, `query`, the reader of its document, and whether to try again."""

    path: str
    parse: Callable[[Node], Answer]
    query: Mapping[str, str] = field(default_factory=dict)
    retried: bool = True

    def read(self, status: int, headers: Mapping[str, str], content: bytes) -> Answer:
        """The answer's value, or the named error raised (see `responses.document`)."""
        return self.parse(responses.document(status, headers, content))


def predict(
    slope_deg: float,
    mass_kg: float,
    torque_nm: float,
    horizon_s: float,
    *,
    dt_s: float | None,
    model: str | None,
    frame: str,
    include: Iterable[str],
    strict: bool,
    band_level: float | None = None,
) -> Call[Prediction]:
    """GET /v1/predictions. Ranges are the service's to judge; only what cannot be written is refused here."""
    numbers = {"slope_deg": slope_deg, "mass_kg": mass_kg, "torque_nm": torque_nm, "horizon_s": horizon_s}
    numbers |= {name: value for name, value in (("dt_s", dt_s), ("band_level", band_level)) if value is not None}
    query = {name: _number(name, value) for name, value in numbers.items()}
    if model is not None:
        query["model"] = model
    query["frame"] = frame
    wanted = ",".join([include] if isinstance(include, str) else include)
    if wanted:
        query["include"] = wanted
    if strict:
        query["strict"] = "true"
    return Call("/v1/predictions", parsing.prediction, query)


def models() -> Call[list[ModelInfo]]:
    """GET /v1/models."""
    return Call("/v1/models", parsing.models)


def model(name: str) -> Call[ModelInfo]:
    """GET /v1/models/{name}."""
    return Call(f"/v1/models/{_name(name)}", parsing.model)


def manifest(name: str, version: int) -> Call[dict[str, Any]]:
    """GET /v1/models/{name}/versions/{version}."""
    if isinstance(version, bool) or not isinstance(version, int) or version < 1:
        raise _refused("version", version, "a positive integer")
    return Call(f"/v1/models/{_name(name)}/versions/{version}", parsing.manifest)


def ready() -> Call[Readiness]:
    """GET /health/ready. Never repeated: who asks whether it is ready wants to hear a no."""
    return Call("/health/ready", parsing.readiness, retried=False)


def _number(name: str, value: object) -> str:
    # float() first: the repr of a NumPy scalar is not a number. repr then keeps every digit.
    try:
        return repr(float(value))  # type: ignore[arg-type] # what is no number raises, and is named below
    except (TypeError, ValueError, OverflowError) as fault:
        raise _refused(name, value, "a number") from fault


def _name(name: str) -> str:
    # The name becomes part of the address, where `..` or a slash would lead elsewhere.
    if not isinstance(name, str) or not NAME.fullmatch(name):
        raise _refused("name", name, "1 to 63 of a-z, 0-9 and -, not starting with -")
    return name


def _refused(name: str, value: object, allowed: str) -> InvalidInputError:
    message = f"{name} is {value!r}, allowed is {allowed}"
    fault = FieldFault(field=name, value=value, allowed=allowed, message=message)
    return InvalidInputError(message, faults=(fault,))
