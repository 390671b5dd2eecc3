"""Answers read back by the libraries that users have: columns by name, and what is beside them."""

from __future__ import annotations

import csv
import io
import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from pxr import Sdf, Usd

DATA_FORMS = ("json", "csv", "npz", "arrow", "parquet", "usda")


def columns_in(form: str, body: bytes) -> dict[str, np.ndarray]:
    """Every column of one answer, float64 of shape (time,), by the names of the CSV answer."""
    return _READERS[form](body)


def about_in(form: str, body: bytes) -> dict[str, object]:
    """What is no column: of the forms that carry it beside their columns."""
    if form == "npz":
        with np.load(io.BytesIO(body)) as archive:
            return json.loads(str(archive["metadata"]))
    if form in ("arrow", "parquet"):
        schema = (_arrow(body) if form == "arrow" else _parquet(body)).schema
        metadata = {name.decode(): text.decode() for name, text in schema.metadata.items()}
        return {name: text if name == "frame" else json.loads(text) for name, text in metadata.items()}
    return json.loads(stage_of(body).GetRootLayer().customLayerData["roverTwin"]["metadata"])


def stage_of(body: bytes) -> Usd.Stage:
    layer = Sdf.Layer.CreateAnonymous(".usda")
    assert layer.ImportFromString(body.decode())
    return Usd.Stage.Open(layer)


def _json(body):
    answer = json.loads(body)
    prior = {f"prior_{name}": values for name, values in answer.get("prior", {}).items() if name != "name"}
    band = {name: values for name, values in answer.get("band", {}).items() if name != "level"}
    return {name: np.array(values, dtype=float) for name, values in (answer["trajectory"] | prior | band).items()}


def _csv(body):
    rows = list(csv.reader(io.StringIO(body.decode())))
    return dict(zip(rows[0], np.array(rows[1:], dtype=float).T, strict=True))


def _npz(body):
    with np.load(io.BytesIO(body)) as archive:
        return {name: archive[name] for name in archive.files if name != "metadata"}


def _arrow(body):
    with pa.ipc.open_stream(body) as stream:
        return stream.read_all()


def _parquet(body):
    return pq.read_table(io.BytesIO(body))


def _arrow_columns(body):
    return _whole_columns(_arrow(body))


def _parquet_columns(body):
    return _whole_columns(_parquet(body))


def _whole_columns(table):
    assert [column.null_count for column in table.columns] == [0] * table.num_columns
    return {name: table[name].to_numpy() for name in table.column_names}


def _usda(body):
    stage = stage_of(body)
    return rover_columns(stage, stage.GetDefaultPrim())


def rover_columns(stage: Usd.Stage, rover: Usd.Prim) -> dict[str, np.ndarray]:
    """The columns that a rover of a layer has as attributes, and `time_s`."""
    codes = rover.GetAttribute("xformOp:translate").GetTimeSamples()
    columns = {"time_s": np.array(codes) / stage.GetTimeCodesPerSecond()}
    for attribute in rover.GetAttributes():
        space, _, name = attribute.GetName().rpartition(":")
        if space == "roverTwin":
            assert attribute.GetTimeSamples() == codes
            columns[name] = np.array([attribute.Get(code) for code in codes])
    return columns


_READERS = {
    "json": _json,
    "csv": _csv,
    "npz": _npz,
    "arrow": _arrow_columns,
    "parquet": _parquet_columns,
    "usda": _usda,
}
