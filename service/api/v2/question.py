"""What a request asks: scenarios, times, frame, and which outputs, checked against the signature."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
import numpy.typing as npt

from service.api.v2.failures import UnsupportedError
from service.api.v2.signature import (
    DEFAULT_HORIZON_S,
    DEFAULT_STEP_S,
    INPUT_TYPES,
    INPUTS,
    OUTPUTS,
    REQUIRED,
    InputTensor,
    OutputTensor,
)
from service.api.v2.wire import InferenceRequest, Parameters, RequestedInput
from service.learning.band import HIGHEST_LEVEL, LOWEST_LEVEL, USUAL_LEVEL
from service.physics.scenario import Array
from service.settings import LIMITS
from service.twin import Frame, Scenario, Twin
from service.wire.batch import MAX_SCENARIOS
from service.wire.faults import InputFault, InvalidInputError, fault, unknown_field
from service.wire.points import bounded_grid, require_few_times
from service.wire.prediction import ALLOWED

_OWN_PARAMETERS = ("frame", "band_level", "dt_s", "binary_data_output")
# Triton's hints to a scheduler (here is none), and MLServer's to whoever decodes: datatypes say enough
_IGNORED_PARAMETERS = frozenset({"priority", "timeout", "headers", "content_type"})
_IGNORED_PREFIX = "triton_"
_SHARED_MEMORY = "shared_memory_"
_NUMBERS = frozenset({int, float})
_SLOPE = Frame.SLOPE  # to find a member of an enumeration takes as long as an array operation


@dataclass(frozen=True, slots=True)
class Wanted:
    """One output of the answer, and whether its values go in binary."""

    tensor: OutputTensor
    binary: bool


@dataclass(frozen=True, slots=True, eq=False)
class InferenceQuestion:
    """What `Twin.predict_many` takes; `time_s` has shape (time,) or (scenario, time)."""

    scenarios: tuple[Scenario, ...]
    time_s: Array
    frame: Frame
    band_level: float | None
    outputs: tuple[Wanted, ...]

    @property
    def with_prior(self) -> bool:
        """Whether an output needs the prior's positions."""
        return any(each.tensor.of_prior for each in self.outputs)

    @property
    def with_speed(self) -> bool:
        """Whether an output needs the speed."""
        return any(each.tensor.of_speed for each in self.outputs)


def question_of(request: InferenceRequest, tail: memoryview, twin: Twin, max_points: int) -> InferenceQuestion:
    """Read a request; `tail` is the binary part of its body, `max_points` bounds one trajectory.

    Raises InvalidInputError with the tensor, the value and what is allowed, and UnsupportedError.
    """
    _require_known(request.parameters)
    frame = _frame(request.parameters)
    columns = _columns(request.inputs, tail)
    scenarios, time_s = _scenarios(columns, _number(request.parameters, "dt_s", LIMITS.dt_s), max_points)
    level = _number(request.parameters, "band_level", (LOWEST_LEVEL, HIGHEST_LEVEL))
    outputs = _outputs(request, frame, twin)
    with_band = any(each.tensor.of_band for each in outputs)
    return InferenceQuestion(scenarios, time_s, frame, (level or USUAL_LEVEL) if with_band else None, outputs)


def _require_known(parameters: Parameters) -> None:
    for name, value in parameters.items():
        if name.startswith("sequence_"):
            raise UnsupportedError(f"parameter {name}: these models keep no state between requests")
        if name not in _OWN_PARAMETERS and name not in _IGNORED_PARAMETERS and not name.startswith(_IGNORED_PREFIX):
            raise InvalidInputError(unknown_field(name, value, "one of " + ", ".join(_OWN_PARAMETERS)))


def _frame(parameters: Parameters) -> Frame:
    asked = parameters.get("frame")
    if asked is None:
        return _SLOPE
    if asked not in list(Frame):
        raise InvalidInputError(fault("frame", asked, ALLOWED["frame"]))
    return Frame(asked)


def _number(parameters: Parameters, name: str, span: tuple[float, float]) -> float | None:
    value = parameters.get(name)
    if value is None:
        return None
    if type(value) not in _NUMBERS or not span[0] <= float(value) <= span[1]:
        raise InvalidInputError(fault(name, value, ALLOWED[name]))
    return float(value)


def _flag(parameters: Parameters, name: str, default: bool) -> bool:
    value = parameters.get(name, default)
    if not isinstance(value, bool):
        raise InvalidInputError(fault(name, value, "true or false"))
    return value


def _columns(inputs: Sequence[RequestedInput], tail: memoryview) -> Mapping[str, Array]:
    """The values of each input that was sent, in float64 and within range."""
    columns: dict[str, Array] = {}
    at = 0
    for each in inputs:
        known = INPUTS.get(each.name)
        if known is None:
            raise InvalidInputError(unknown_field(each.name, list(each.shape), "one of " + ", ".join(INPUTS)))
        if each.name in columns:
            raise InvalidInputError(fault(each.name, "sent twice", "one tensor of each name"))
        count = _count(each)
        size = _binary_size(each, count)
        if size is None:
            values = _from_json(each, count)
        else:
            if at + size > len(tail):
                there = f"{len(tail) - at} bytes in the body's binary part"
                raise InvalidInputError(fault(f"{each.name}.binary_data_size", size, f"at most the {there}"))
            values = np.frombuffer(tail[at : at + size], dtype=INPUT_TYPES[each.datatype])
            at += size
        columns[each.name] = _within(known, values.astype(np.float64))
    if at != len(tail):
        raise InvalidInputError(fault("body", f"{len(tail) - at} bytes more than its tensors", "tensors only"))
    return columns


def _count(sent: RequestedInput) -> int:
    if sent.datatype not in INPUT_TYPES:
        raise InvalidInputError(fault(f"{sent.name}.datatype", sent.datatype, "one of " + ", ".join(INPUT_TYPES)))
    if len(sent.shape) not in (1, 2) or sent.shape[0] == 0 or sent.shape[1:] not in ([], [1]):
        allowed = "one dimension of at least 1, and after it none or one of 1"
        raise InvalidInputError(fault(f"{sent.name}.shape", str(sent.shape), allowed))
    if sent.parameters and any(name.startswith(_SHARED_MEMORY) for name in sent.parameters):
        raise UnsupportedError(f"{sent.name}: tensors in shared memory are not supported; send the values")
    return sent.shape[0]


def _binary_size(sent: RequestedInput, count: int) -> int | None:
    """How many bytes the tensor has in the binary part; None when its values are in the JSON."""
    size = sent.parameters.get("binary_data_size")
    if size is None:
        return None
    expected = count * INPUT_TYPES[sent.datatype].itemsize
    if type(size) is not int or size != expected:
        allowed = f"{expected}, for {count} values of {sent.datatype}"
        raise InvalidInputError(fault(f"{sent.name}.binary_data_size", size, allowed))
    if sent.data:
        raise InvalidInputError(fault(f"{sent.name}.data", sent.data, "no data beside a binary_data_size"))
    return size


def _from_json(sent: RequestedInput, count: int) -> npt.NDArray[np.float64]:
    data = sent.data
    if len(sent.shape) == 2 and all(isinstance(row, list) and len(row) == 1 for row in data):
        data = [row[0] for row in data]
    if len(data) != count:
        raise InvalidInputError(fault(f"{sent.name}.data", f"{len(data)} values", f"{count} values, as its shape says"))
    if not _NUMBERS.issuperset(map(type, data)):
        at = next(at for at, value in enumerate(data) if type(value) not in _NUMBERS)
        raise InvalidInputError(fault(f"{sent.name}[{at}]", data[at], _allowed(INPUTS[sent.name])))
    try:
        values = np.array(data, dtype=np.float64)
    except OverflowError:  # an integer of hundreds of digits
        at = next(at for at, value in enumerate(data) if not abs(value) < 1e300)
        raise InvalidInputError(fault(f"{sent.name}[{at}]", data[at], _allowed(INPUTS[sent.name]))) from None
    kind = INPUT_TYPES[sent.datatype]
    if kind == values.dtype:
        return values
    if kind.kind == "f":
        with np.errstate(over="ignore"):  # infinity is out of every range
            return values.astype(kind).astype(np.float64)
    limits = np.iinfo(kind)
    whole = (values == np.rint(values)) & (values >= limits.min) & (values <= limits.max)
    if not whole.all():
        at = int(whole.argmin())
        raise InvalidInputError(fault(f"{sent.name}[{at}]", data[at], f"a whole number that {sent.datatype} can hold"))
    return values


def _within(known: InputTensor, values: Array) -> Array:
    if len(values) == 1 and known.lowest <= values.item() <= known.highest:
        return values
    fits = (values >= known.lowest) & (values <= known.highest)  # NaN fits nowhere
    if not fits.all():
        at = int(fits.argmin())
        raise InvalidInputError(fault(f"{known.name}[{at}]", float(values[at]), _allowed(known)))
    return values


def _allowed(known: InputTensor) -> str:
    return f"{known.lowest:g} to {known.highest:g} {known.unit}"


def _scenarios(columns: Mapping[str, Array], dt_s: float | None, max_points: int) -> tuple[tuple[Scenario, ...], Array]:
    """The scenarios and their times."""
    required = REQUIRED
    if missing := [name for name in required if name not in columns]:
        raise InvalidInputError(*(_missing(INPUTS[name]) for name in missing))
    count = len(columns[required[0]])
    if count > MAX_SCENARIOS:
        raise InvalidInputError(fault(f"{required[0]}.shape", f"[{count}]", f"[1] to [{MAX_SCENARIOS}]"))
    for name in required[1:]:
        if len(columns[name]) != count:
            _require_shape(name, columns[name], [count], f"[{count}], as that of {required[0]}")
    if "time_s" in columns:
        time_s = _times(columns, dt_s, count, max_points)
        horizons = [float(time_s[-1])] * count
    else:
        horizons = [DEFAULT_HORIZON_S] * count
        if (sent := columns.get("horizon_s")) is not None:
            _require_shape("horizon_s", sent, [1, count], f"[1] or [{count}], as that of {required[0]}")
            horizons = sent.tolist() * (1 if len(sent) == count else count)
        time_s = bounded_grid(horizons, dt_s or DEFAULT_STEP_S, max_points)
    rows = zip(*(columns[name].tolist() for name in required), horizons, strict=True)
    return tuple(Scenario(*row) for row in rows), time_s


def _missing(known: InputTensor) -> InputFault:
    allowed = f"a tensor with values of {_allowed(known)}"
    return InputFault(known.name, None, allowed, f"input {known.name} is missing, allowed is {allowed}")


def _require_shape(name: str, column: Array, lengths: Iterable[int], allowed: str) -> None:
    if len(column) not in lengths:
        raise InvalidInputError(fault(f"{name}.shape", f"[{len(column)}]", allowed))


def _times(columns: Mapping[str, Array], dt_s: float | None, count: int, max_points: int) -> Array:
    """The times that were sent, which say all that horizon and step could."""
    time_s = columns["time_s"]
    if "horizon_s" in columns or dt_s is not None:
        beside = "horizon_s" if "horizon_s" in columns else "dt_s"
        raise InvalidInputError(fault(beside, "sent beside time_s", "either time_s or horizon_s and dt_s"))
    require_few_times(len(time_s), count, max_points)
    falling = np.diff(time_s) <= 0
    if falling.any():
        at = int(falling.argmax()) + 1
        raise InvalidInputError(fault(f"time_s[{at}]", float(time_s[at]), f"more than the {time_s[at - 1]:g} before"))
    if time_s[-1] < LIMITS.horizon_s[0]:
        raise InvalidInputError(fault(f"time_s[{len(time_s) - 1}]", float(time_s[-1]), ALLOWED["horizon_s"]))
    return time_s


def _outputs(request: InferenceRequest, frame: Frame, twin: Twin) -> tuple[Wanted, ...]:
    binary = _flag(request.parameters, "binary_data_output", default=False)
    there = _offered(frame, twin.band is not None)
    if not request.outputs:
        return tuple(Wanted(each, binary) for each in there.values() if each.usual)
    wanted: dict[str, Wanted] = {}
    for asked in request.outputs:
        if asked.name not in there:
            of = f"{twin.name}@{twin.version} in the {frame.value} frame"
            raise InvalidInputError(fault("output", asked.name, f"one of {', '.join(there)}, for {of}"))
        if asked.name in wanted:
            raise InvalidInputError(fault("output", asked.name, "each output once"))
        if any(name == "classification" or name.startswith(_SHARED_MEMORY) for name in asked.parameters):
            raise UnsupportedError(f"output {asked.name}: neither classification nor shared memory is supported")
        wanted[asked.name] = Wanted(there[asked.name], _flag(asked.parameters, "binary_data", binary))
    return tuple(wanted.values())


@cache
def _offered(frame: Frame, with_band: bool) -> Mapping[str, OutputTensor]:
    """The outputs in a frame, of a version that has a band or none."""
    return {name: each for name, each in OUTPUTS.items() if frame in each.frames and (with_band or not each.of_band)}
