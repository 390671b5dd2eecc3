"""Questions and answers of steps as Arrow IPC streams: a row for each rover, states as bytes.

Columns of a question: `id` (text), `slope_deg`, `dt_s`, `torque_nm`, `brake`, `state` (binary), `mass_kg` and
`start_speed_m_s` of a start; all but the first three may be left out, or null. `model` is metadata of the schema.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from service.physics.scenario import Array
from service.twin.steps import write_states
from service.wire.faults import InvalidInputError, MalformedBodyError, fault, unknown_field
from service.wire.forms.numbers import dump
from service.wire.steps.fleet import Group, Stepped
from service.wire.steps.question import (
    LONGEST_ID,
    MAX_ROVERS,
    ROVER_RANGES,
    StepsQuestion,
    checked_model,
    why_refused,
)

if TYPE_CHECKING:
    import pyarrow as pa

_NUMBERS = ("slope_deg", "dt_s", "torque_nm", "mass_kg", "start_speed_m_s")
_KNOWN = ("id", *_NUMBERS, "brake", "state")
_NEEDED = ("id", "slope_deg", "dt_s")
_UNITS = {
    "time_s": "s",
    "x_m": "m",
    "y_m": "m",
    "speed_m_s": "m/s",
    "rear_wheel_speed_rad_s": "rad/s",
    "front_wheel_speed_rad_s": "rad/s",
    "slip_ratio": "1",
    "x_half_width_m": "m",
}


def read_arrow_steps(content: bytes) -> StepsQuestion:
    """The question in an IPC stream. Rovers that are wrong are among its failures.

    Raises MalformedBodyError for what is no such stream or compressed, InvalidInputError for what concerns all rovers.
    """
    table = _table(content)
    names, count = table.schema.names, table.num_rows
    if strangers := [name for name in names if name not in _KNOWN]:
        allowed = "one of " + ", ".join(_KNOWN)
        raise InvalidInputError(*(unknown_field(name, "a column", allowed) for name in strangers[:20]))
    if missing := [name for name in _NEEDED if name not in names]:
        raise InvalidInputError(*(fault(name, None, "a column of that name") for name in missing))
    if len(set(names)) < len(names):
        raise InvalidInputError(fault("columns", ", ".join(names), "each column once"))
    if not 1 <= count <= MAX_ROVERS:
        raise InvalidInputError(fault("rovers", f"{count} rovers", f"a list of 1 to {MAX_ROVERS} rovers"))
    numbers = {name: _numbers(table, name, count) for name in _NUMBERS}
    ids = _listed(table, "id", count)
    states = _listed(table, "state", count)
    brake = np.array([bool(each) for each in _listed(table, "brake", count)], dtype=np.bool_)
    metadata = table.schema.metadata or {}
    model = checked_model(metadata[b"model"].decode("utf-8", "replace")) if b"model" in metadata else None
    good, failures = _judged(ids, numbers, brake, states)
    return StepsQuestion(
        ids=[ids[at] for at in good],
        slope_deg=numbers["slope_deg"][good],
        torque_nm=np.nan_to_num(numbers["torque_nm"][good]),
        brake=brake[good],
        dt_s=numbers["dt_s"][good],
        states=[states[at] for at in good],
        mass_kg=numbers["mass_kg"][good],
        start_speed_m_s=numbers["start_speed_m_s"][good],
        places=good,
        sent_ids=ids,
        failures=failures,
        model=model,
    )


def encode_arrow_steps(stepped: Stepped, errors: Sequence[Mapping[str, Any]]) -> bytes:
    """One record batch, a row for each rover that was moved on: `index` (int32, its place in the request), `id`,
    numbers (float64, null for a half-width that is not known), `moving`, `inside`, `outside_of` and `state` (binary).

    The metadata of the schema has `model` and `errors` as JSON; that of each number its `unit`.
    """
    import pyarrow as pa  # noqa: PLC0415 - half a second that only those pay who ask for Arrow

    from service.wire.forms.arrow import stream_of  # noqa: PLC0415 - as above

    fields = [pa.field("index", pa.int32(), nullable=False), pa.field("id", pa.string(), nullable=False)]
    fields += [
        pa.field(name, pa.float64(), nullable=name == "x_half_width_m", metadata={"unit": unit})
        for name, unit in _UNITS.items()
    ]
    fields += [pa.field("moving", pa.bool_(), nullable=False), pa.field("inside", pa.bool_(), nullable=False)]
    fields += [pa.field("outside_of", pa.list_(pa.string()), nullable=False)]
    fields += [pa.field("state", pa.binary(), nullable=False)]
    schema = pa.schema(fields, {"model": dump(stepped.identity()), "errors": dump(list(errors))})
    batches = [_batch(each, schema) for each in stepped.groups]
    whole = batches[0] if len(batches) == 1 else _together(batches, schema)
    return stream_of(whole)


def _batch(group: Group, schema: pa.Schema) -> pa.RecordBatch:
    import pyarrow as pa  # noqa: PLC0415 - as above

    moments, twin = group.moments, group.loaded.twin
    columns = [pa.array(group.places, pa.int32()), pa.array(group.ids, pa.string())]
    for name in _UNITS:
        values = getattr(moments, name)
        columns.append(pa.array(values, pa.float64(), from_pandas=name == "x_half_width_m"))
    columns += [pa.array(moments.moving), pa.array([not each for each in moments.outside_of])]
    columns.append(pa.array(moments.outside_of, pa.list_(pa.string())))
    columns.append(pa.array(write_states(twin.name, twin.version, group.states), pa.binary()))
    return pa.record_batch(columns, schema)


def _together(batches: list[pa.RecordBatch], schema: pa.Schema) -> pa.RecordBatch:
    """One batch, in the order sent."""
    import pyarrow as pa  # noqa: PLC0415 - as above

    if not batches:
        return pa.record_batch([pa.array([], each.type) for each in schema], schema)
    return pa.Table.from_batches(batches, schema).sort_by("index").combine_chunks().to_batches()[0]


def _table(content: bytes) -> pa.Table:
    """What the stream holds, whole and plain. Raises MalformedBodyError."""
    import pyarrow as pa  # noqa: PLC0415 - as above

    if not content:
        raise MalformedBodyError("the body is empty; send an Arrow IPC stream")
    try:
        for message in pa.ipc.MessageReader.open_stream(content):
            _require_plain(message)
        table = pa.ipc.open_stream(content).read_all()
        table.validate(full=True)
    except (pa.ArrowException, ValueError, OSError, EOFError, IndexError, struct.error) as error:
        if isinstance(error, MalformedBodyError):
            raise
        raise MalformedBodyError(f"the body cannot be read as an Arrow IPC stream: {str(error)[:200]}") from error
    return table


def _require_plain(message: pa.Message) -> None:
    """A compressed batch says only when it is unpacked how large it is. Raises MalformedBodyError."""
    if message.type == "dictionary":
        raise MalformedBodyError("columns that are dictionaries are not read here: send plain ones")
    if message.type == "record batch":
        metadata = message.metadata.to_pybytes()
        batch = _follow(metadata, _root(metadata), 2)
        if batch is None or _follow(metadata, batch, 3) is not None:
            raise MalformedBodyError("the stream is compressed: send it as it is")


def _root(metadata: bytes) -> int:
    """Where the root table of a flatbuffer is."""
    return int(struct.unpack_from("<I", metadata)[0])


def _follow(metadata: bytes, table: int, number: int) -> int | None:
    """Where the table is that is field `number` of a table in a flatbuffer; None where it has none."""
    fields = table - int(struct.unpack_from("<i", metadata, table)[0])
    if 4 + 2 * number >= struct.unpack_from("<H", metadata, fields)[0]:
        return None
    offset = int(struct.unpack_from("<H", metadata, fields + 4 + 2 * number)[0])
    if offset == 0:
        return None
    return table + offset + int(struct.unpack_from("<I", metadata, table + offset)[0])


def _numbers(table: pa.Table, name: str, count: int) -> Array:
    """A column as float64, NaN where it is null or not there. Raises InvalidInputError for one of another kind."""
    import pyarrow as pa  # noqa: PLC0415 - as above

    if name not in table.schema.names:
        return np.full(count, np.nan)
    column = table.column(name)
    if not (pa.types.is_integer(column.type) or pa.types.is_floating(column.type) or pa.types.is_null(column.type)):
        raise InvalidInputError(fault(name, f"a column of {column.type}", "a column of numbers"))
    values = column.combine_chunks().cast(pa.float64())
    return np.asarray(values.to_numpy(zero_copy_only=False), dtype=np.float64)


def _listed(table: pa.Table, name: str, count: int) -> list[Any]:
    """A column as Python values. Raises InvalidInputError for one of another kind."""
    import pyarrow as pa  # noqa: PLC0415 - as above

    if name not in table.schema.names:
        return [None] * count
    column, kinds = table.column(name), pa.types
    if name == "id":
        right, allowed = kinds.is_string(column.type) or kinds.is_large_string(column.type), "text"
    elif name == "brake":
        right, allowed = kinds.is_boolean(column.type), "true and false"
    else:
        right = kinds.is_binary(column.type) or kinds.is_large_binary(column.type)
        right, allowed = right or kinds.is_fixed_size_binary(column.type), "bytes"
    if not (right or kinds.is_null(column.type)):
        raise InvalidInputError(fault(name, f"a column of {column.type}", f"a column of {allowed}"))
    return list(column.to_pylist())


def _judged(
    ids: list[str | None], numbers: Mapping[str, Array], brake: npt.NDArray[np.bool_], states: list[bytes | None]
) -> tuple[list[int], dict[int, Exception]]:
    """The rovers that can be, by their place, and what is wrong with the others, in the words of the JSON form."""
    right = np.ones(len(ids), dtype=np.bool_)
    for name, (lowest, highest) in ROVER_RANGES.items():
        right &= (numbers[name] >= lowest) & (numbers[name] <= highest) | _may_lack(name, numbers[name], brake)
    right &= np.isnan(numbers["start_speed_m_s"]) | ~np.isnan(numbers["mass_kg"])
    right &= ~np.isnan(numbers["mass_kg"]) != np.array([state is not None for state in states])
    known: set[str] = set()
    good: list[int] = []
    failures: dict[int, Exception] = {}
    for at, fits in enumerate(right.tolist()):
        own = ids[at]
        if fits and own and len(own) <= LONGEST_ID and own not in known:
            good.append(at)
        else:
            failures[at] = why_refused(_row(at, ids, numbers, brake, states), known)
        known.add(str(own))
    return good, failures


def _may_lack(name: str, values: Array, brake: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    if name == "torque_nm":
        return np.asarray(np.isnan(values) & brake)
    return np.asarray(np.isnan(values) & (name in ("mass_kg", "start_speed_m_s")))


def _row(
    at: int,
    ids: list[str | None],
    numbers: Mapping[str, Array],
    brake: npt.NDArray[np.bool_],
    states: list[bytes | None],
) -> dict[str, Any]:
    """One rover as JSON has it."""
    told = {name: float(numbers[name][at]) for name in _NUMBERS if not np.isnan(numbers[name][at])}
    begin = {name: told.pop(name) for name in ("mass_kg", "start_speed_m_s") if name in told}
    row: dict[str, Any] = {"id": ids[at], "brake": bool(brake[at]), **told}
    if begin:
        row["start"] = begin
    if states[at] is not None:
        row["state"] = ""
    return row
