"""pandas, Polars and DuckDB read the tables of answers: the numbers of JSON, the right types, nothing missing."""

from __future__ import annotations

import io
import json

import duckdb
import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from tests.api.conftest import QUESTION
from tests.api.readings import columns_in
from tests.digits import in_text, rounded

ASKED_ALONE = QUESTION | {"horizon_s": 4}
ASKED = QUESTION | {"include": ["prior", "band", "speed"], "horizon_s": 4}
DRIVE = {"mass_kg": 430, "track": {"distance_m": [0, 10], "slope_deg": [5, 5]}, "horizon_s": 4}
DRIVE |= {"controls": {"time_s": [0, 2], "torque_nm": [60, 0], "brake": [False, True]}}
MAP = {"mass_kg": 430, "torque_min_nm": 30, "slope_steps": 5}


def duckdb_reads(body, tmp_path, form):
    file = tmp_path / f"answer.{form}"
    file.write_bytes(body)
    with duckdb.connect() as connection:
        return connection.sql(f"from '{file}'").to_arrow_table().to_pandas()


def duckdb_reads_arrow(body, _):
    answer = pa.ipc.open_stream(body).read_all()
    with duckdb.connect() as connection:
        return connection.from_arrow(answer).to_arrow_table().to_pandas()


READERS = {
    ("csv", "pandas"): lambda body, _: pd.read_csv(io.BytesIO(body)),
    ("csv", "polars"): lambda body, _: pl.read_csv(body).to_pandas(),
    ("csv", "duckdb"): lambda body, folder: duckdb_reads(body, folder, "csv"),
    ("arrow", "pandas"): lambda body, _: pa.ipc.open_stream(body).read_pandas(),
    ("arrow", "polars"): lambda body, _: pl.read_ipc_stream(body).to_pandas(),
    ("arrow", "duckdb"): duckdb_reads_arrow,
    ("parquet", "pandas"): lambda body, _: pd.read_parquet(io.BytesIO(body)),
    ("parquet", "polars"): lambda body, _: pl.read_parquet(body).to_pandas(),
    ("parquet", "duckdb"): lambda body, folder: duckdb_reads(body, folder, "parquet"),
}
BY_FORM_AND_READER = pytest.mark.parametrize(("form", "reader"), READERS)


@BY_FORM_AND_READER
def test_a_prediction_is_read_as_it_is_in_json(banded, tmp_path, form, reader):
    body = banded.client.post("/v1/predictions", params={"format": form}, json=ASKED).content
    expected = columns_in("json", banded.client.post("/v1/predictions", json=ASKED).content)
    table = READERS[form, reader](body, tmp_path)

    assert set(table.columns) == set(expected)
    for name, values in expected.items():
        assert table[name].dtype == np.float64
        found = in_text({name: table[name].to_numpy()})[name]
        assert found.tobytes() == values.tobytes(), name


@BY_FORM_AND_READER
def test_a_drive_has_its_brake_and_no_gaps(shipped, tmp_path, form, reader):
    body = shipped.client.post("/v1/drives", params={"format": form}, json=DRIVE).content
    brake = shipped.client.post("/v1/drives", json=DRIVE).json()["trajectory"]["brake"]
    table = READERS[form, reader](body, tmp_path)

    assert not table.isna().any().any()
    assert table["brake"].dtype == (np.int64 if form == "csv" else np.bool_)  # a CSV file knows no types
    assert table["brake"].astype(bool).to_list() == brake
    assert set(table.drop(columns="brake").dtypes) == {np.dtype(np.float64)}


@pytest.mark.parametrize(("form", "reader"), [each for each in READERS if each[0] != "csv"])
@pytest.mark.parametrize("path", ["/v1/predictions/batch", "/v1/drives/batch"])
def test_a_batch_is_a_long_table(shipped, tmp_path, path, form, reader):
    sent = {"scenarios": [ASKED_ALONE, ASKED_ALONE | {"mass_kg": -1}, ASKED_ALONE | {"horizon_s": 2}]}
    sent = sent if path.startswith("/v1/predictions") else {"drives": [DRIVE, {}, DRIVE | {"horizon_s": 2}]}
    body = shipped.client.post(path, params={"format": form}, json=sent).content
    table = READERS[form, reader](body, tmp_path)
    name = "scenario" if path.startswith("/v1/predictions") else "drive"

    assert not table.isna().any().any()
    assert table[name].dtype == np.int32
    assert table.groupby(name)["time_s"].agg(["size", "max"]).to_dict("index") == {
        0: {"size": 81, "max": 4.0},
        2: {"size": 41, "max": 2.0},
    }


@pytest.mark.parametrize("reader", ["pandas", "polars", "duckdb"])
def test_a_mobility_map_is_a_table_of_numbers_and_words(service, tmp_path, reader):
    body = service.get("/v1/mobility", **MAP, format="csv").content
    table = READERS["csv", reader](body, tmp_path)

    assert len(table) == MAP["slope_steps"]
    assert table["slope_deg"].dtype == table["torque_nm"].dtype == np.float64
    assert table["inside_domain"].dtype == np.bool_
    assert set(table["outcome"]) <= {"climbs", "stalls", "slides"}


def test_parquet_says_what_its_columns_are(banded):
    body = banded.client.post("/v1/predictions", params={"format": "parquet"}, json=ASKED).content
    schema = pq.read_schema(io.BytesIO(body))

    assert schema.field("speed_m_s").metadata == {b"unit": b"m/s"}
    assert not any(each.nullable for each in schema)
    units = json.loads(pl.read_parquet_metadata(io.BytesIO(body))["units"])
    assert (units["x_m"], units["time_s"]) == ("m", "s")


def test_tables_are_read_from_their_address(shipped):
    """pandas takes all of it, Polars asks for parts, and for a Parquet file only for the columns that it wants."""
    address = f"{shipped.url}/v1/predictions?slope_deg=28&mass_kg=430&torque_nm=60&format="
    expected = shipped.client.get(f"{address}json").json()["trajectory"]["x_m"]

    for read in (pd.read_csv, pl.read_csv):
        assert read(f"{address}csv")["x_m"].to_list() == expected
    for read in (pd.read_parquet, pl.read_parquet):
        assert rounded(read(f"{address}parquet")["x_m"].to_list()).tolist() == expected
    assert rounded(pl.read_ipc_stream(f"{address}arrow")["x_m"].to_list()).tolist() == expected
    last = pl.scan_parquet(f"{address}parquet").select(pl.col("x_m").last()).collect().item()
    assert rounded(last).item() == expected[-1]
