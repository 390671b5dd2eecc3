"""What is wrong with an input, field by field: the `errors` of a problem."""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import BaseModel, Field

from service.datasets.file_names import printable
from service.errors import RoverTwinError

MAX_SHOWN = 100
MAX_FAULTS = 20
_MOST_STRANGERS = 3
_NO_NUMBER = frozenset({"float_type", "float_parsing"})


@dataclass(frozen=True, slots=True)
class InputFault:
    """One field with the value that was sent, what is allowed, and a sentence that says both."""

    field: str
    value: object
    allowed: str
    message: str

    def as_json(self) -> dict[str, Any]:
        """The fault as it stands in an answer; texts are cut, NaN is written as text."""
        return {
            "field": _short(self.field),
            "value": echo(self.value),
            "allowed": self.allowed,
            "message": printable(self.message),
        }


class ProblemError(BaseModel):
    """What is wrong with one field."""

    field: str
    value: Annotated[Any, Field(description="What was sent; long texts are cut, NaN is written as text.")]
    allowed: str
    message: str


class InvalidInputError(RoverTwinError):
    """Fields of a request are wrong in a way that their types alone do not show."""

    def __init__(self, *faults: InputFault) -> None:
        self.faults = list(faults)
        super().__init__(summary_of(faults))


class MalformedBodyError(RoverTwinError):
    """A body cannot be read at all."""


def fault(field: str, value: object, allowed: str) -> InputFault:
    """A value that is out of range or of the wrong kind."""
    return InputFault(field, value, allowed, f"{_short(field)} is {_said(value)}, allowed is {allowed}")


def missing(field: str, allowed: str) -> InputFault:
    """A field that is needed and was not sent."""
    return InputFault(field, None, allowed, f"{_short(field)} is missing, allowed is {allowed}")


def unknown_field(field: str, value: object, allowed: str) -> InputFault:
    """A field that does not exist, most often misspelt."""
    return InputFault(field, value, allowed, f"there is no field '{_short(field)}'; allowed is {allowed}")


def strangers_in(sent: Mapping[str, Any], allowed: Mapping[str, str]) -> InvalidInputError | None:
    """The error of one of many that has more than a few unknown fields; None for all others.

    Whoever validates many asks first, for to find out in detail what is wrong with ninety fields in each of a
    thousand takes seconds.
    """
    if len(sent) <= _MOST_STRANGERS:
        return None
    strangers = [name for name in sent if name not in allowed]
    if len(strangers) <= _MOST_STRANGERS:
        return None
    known = "one of " + ", ".join(allowed)
    first = [unknown_field(name, sent[name], known) for name in strangers[: _MOST_STRANGERS - 1]]
    rest = len(strangers) - len(first)
    return InvalidInputError(*first, fault("body", f"{rest} more unknown fields", known))


def faults_of(errors: Sequence[Mapping[str, Any]], allowed: Mapping[str, str]) -> list[InputFault]:
    """The faults in pydantic's list of errors, at most 20, each field once (a union has an error for each member).

    `allowed` says in words what each known field accepts.
    """
    faults = {each.field: each for each in (_fault_of(error, allowed) for error in reversed(errors))}
    return list(reversed(faults.values()))[:MAX_FAULTS]


def summary_of(faults: Iterable[InputFault]) -> str:
    """All faults in one line."""
    return "; ".join(printable(each.message) for each in faults)


def require_unique(
    pairs: Sequence[tuple[str, Any]], allowed: Mapping[str, str], may_repeat: frozenset[str] = frozenset()
) -> None:
    """Two values for one field are a mistake, and taking either would be a guess. Raises InvalidInputError."""
    times = Counter(name for name, _ in pairs)
    repeated = [name for name, count in times.items() if count > 1 and name not in may_repeat]
    if repeated:
        raise InvalidInputError(*(_repeated(name, pairs, allowed) for name in repeated[:MAX_FAULTS]))


def _repeated(name: str, pairs: Sequence[tuple[str, Any]], allowed: Mapping[str, str]) -> InputFault:
    values = ", ".join(str(echo(value)) for each, value in pairs if each == name)
    return fault(name, values, f"one value only, {allowed.get(name, 'if the field were known')}")


def echo(value: object) -> object:
    """The value as JSON can carry it: at most 100 characters of text, and no NaN, infinity or broken Unicode."""
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, float):
        return (
            value if math.isfinite(value) else "NaN" if math.isnan(value) else "-Infinity" if value < 0 else "Infinity"
        )
    if isinstance(value, int) and abs(value) < 1 << 53:
        return value
    if isinstance(value, list | dict):
        return "[...]" if isinstance(value, list) else "{...}"  # may be nested too deeply to be written
    return _short(str(value))


def _fault_of(error: Mapping[str, Any], known: Mapping[str, str]) -> InputFault:
    # the first part says where the field was (query, path, body); list positions say too little to be shown
    path = [part for part in error["loc"][1:] if isinstance(part, str)]
    whole = ".".join(path)
    value = error.get("input")
    if error["type"] == "extra_forbidden":
        return unknown_field(whole, value, "one of " + ", ".join(known) if known else "none at all")
    field = path[0] if path and whole not in known and path[0] in known else whole or "body"
    allowed = _choices(error) or known.get(field, _other_allowed(error))
    if error["type"] == "missing" and field != "body":
        return missing(field, allowed)
    if error["type"] in _NO_NUMBER:
        return InputFault(field, value, allowed, f"{field} is {_said(value)}, which is no number; allowed is {allowed}")
    return fault(field, value, allowed)


def _choices(error: Mapping[str, Any]) -> str:
    """What a field with a few words allows on this very route; empty for all other errors."""
    if error["type"] != "enum" or not isinstance(error["loc"][-1], str):
        return ""
    return "one of " + ", ".join(re.findall("'([^']*)'", error["ctx"]["expected"]))


def _said(value: object) -> str:
    return f"'{echo(value)}'" if isinstance(value, str) else str(json.dumps(echo(value)))


def _other_allowed(error: Mapping[str, Any]) -> str:
    if error["loc"] == ("body",):
        return "a JSON object"
    return str(error.get("ctx", {}).get("error", error["msg"]))


def _short(text: str) -> str:
    return printable(text if len(text) <= MAX_SHOWN else text[:MAX_SHOWN] + "...")
