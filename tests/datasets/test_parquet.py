"""What is written is what is read: values to their stored digits, scenario, passport, identity."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyarrow import parquet as pq

from service.datasets.columns import BY_NAME, COLUMNS, INPUTS
from service.datasets.digest import dataset_id
from service.datasets.parquet import read_parquet, to_parquet
from service.datasets.passport import Passport
from service.datasets.run import Dataset, Run
from service.errors import DatasetError, InvalidValueError

PASSPORT = Passport.model_validate(
    {"format": "rover-twin-passport/1", "gravity_m_s2": 1.62, "frame": "slope frame", "reference_body": "wheel",
     "rover": {"wheel_radius_m": 0.25}, "note": "kept, ünknown"}
)  # fmt: skip
OPTIONAL = [column.name for column in COLUMNS[3:]]


@st.composite
def datasets(draw):
    seed, names = (
        draw(st.integers(0, 2**32)),
        draw(st.lists(st.text(min_size=1, max_size=8), min_size=1, max_size=4, unique=True)),
    )
    rng = np.random.default_rng(seed)
    runs = []
    for name in names:
        rows = draw(st.integers(1, 40))
        chosen = ["rear_x_m", "rear_y_m", *draw(st.lists(st.sampled_from(OPTIONAL), unique=True))]
        columns = {each: rng.uniform(BY_NAME[each].lowest, BY_NAME[each].highest, rows) for each in chosen}
        columns["time_s"] = np.cumsum(rng.uniform(2e-6, 1.0, rows))
        if "brake" in columns:
            columns["brake"] = rng.integers(0, 2, rows).astype(np.float64)
        slope, mass = draw(st.floats(-45, 45)), draw(st.floats(1, 1e4))
        slope, torque = (
            float(columns[each][0]) if each in columns else constant
            for each, constant in (("slope_deg", slope), ("torque_nm", 60.0))
        )
        runs.append(Run(name, draw(st.sampled_from(["a", "b"])), slope, mass, torque, 10.0, columns))
    return Dataset(draw(st.text(min_size=1, max_size=8)), PASSPORT, tuple(runs))


@pytest.mark.slow
@settings(deadline=None, max_examples=40)
@given(datasets())
def test_round_trip_keeps_everything_to_the_stored_digits(dataset):
    back = read_parquet(to_parquet(dataset, compression_level=1))
    assert (back.name, back.passport) == (dataset.name, dataset.passport)
    for run, again in zip(dataset.runs, back.runs, strict=True):
        assert (run.name, run.set_name, run.varies) == (again.name, again.set_name, again.varies)
        for name in ("slope_deg", "mass_kg", "torque_nm", "horizon_s"):
            stored = again.columns[name][0] if name in run.varies else getattr(run, name)
            assert getattr(again, name) == stored
        assert list(run.columns) == list(again.columns)
        for name, values in run.columns.items():
            assert np.abs(again.columns[name] - values).max() <= 0.51 / BY_NAME[name].scale
            np.testing.assert_array_equal(again.columns[name], np.round(again.columns[name], BY_NAME[name].digits))


@pytest.mark.slow
@settings(deadline=None, max_examples=40)
@given(datasets(), st.randoms(use_true_random=False))
def test_identity_survives_storage_order_and_name(dataset, random):
    original = dataset_id(dataset)
    assert dataset_id(read_parquet(to_parquet(dataset, compression_level=1))) == original
    shuffled = random.sample(dataset.runs, len(dataset.runs))
    assert dataset_id(Dataset("another name", dataset.passport, tuple(shuffled))) == original


@pytest.mark.slow
@settings(deadline=None, max_examples=40)
@given(datasets(), st.data())
def test_identity_changes_with_any_content(dataset, data):
    run = dataset.runs[0]
    name = data.draw(st.sampled_from([each for each in run.columns if each != "time_s" and each not in INPUTS]))
    row = data.draw(st.integers(0, len(run) - 1))
    moved = run.columns[name].copy()
    moved[row] += 2.0 / BY_NAME[name].scale
    changes = [
        replace(run, columns={**run.columns, name: moved}),
        replace(run, mass_kg=run.mass_kg + 0.5),
        replace(run, set_name="c"),
        replace(run, name=run.name + "x" * 9),
    ]
    others = dataset.runs[1:]
    ids = {dataset_id(Dataset("d", PASSPORT, (changed, *others))) for changed in changes}
    ids.add(dataset_id(replace(dataset, passport=PASSPORT.model_copy(update={"gravity_m_s2": 9.81}))))
    assert len(ids | {dataset_id(dataset)}) == 6


@pytest.fixture
def small(make_motion):
    runs = [
        Run(f"run{i}", "paper" if i < 2 else "mass", 20.0 + i, 430.0, 60.0, 10.0, make_motion(1.0 + i / 10))
        for i in range(3)
    ]
    return Dataset("small", PASSPORT, tuple(runs))


def test_columns_runs_and_sets_can_be_chosen(small):
    data = to_parquet(small)
    chosen = read_parquet(data, columns=["speed_mps"], sets=["paper"])
    assert [run.name for run in chosen.runs] == ["run0", "run1"]
    assert list(chosen.runs[0].columns) == ["time_s", "rear_x_m", "rear_y_m", "speed_mps"]
    assert [run.name for run in read_parquet(data, runs=["run2"]).runs] == ["run2"]
    with pytest.raises(DatasetError, match="no run of dataset small"):
        read_parquet(data, runs=["nobody"])
    with pytest.raises(InvalidValueError, match="wheel_temperature"):
        read_parquet(data, columns=["wheel_temperature"])


def test_any_parquet_tool_can_read_it(small):
    table = pq.read_table(io.BytesIO(to_parquet(small)))
    assert table.num_rows == 603
    frame = table.select(["run", "slope_deg", "rear_x_m"])
    assert frame["run"].to_pylist()[:1] == ["run0"]
    assert set(frame["slope_deg"].to_pylist()) == {20.0, 21.0, 22.0}
    x = frame["rear_x_m"].cast("float64").to_numpy()
    np.testing.assert_allclose(x[:201], small.runs[0].x_m, atol=1e-7)
    assert table.schema.field("rear_x_m").metadata == {b"unit": b"m"}


def test_a_file_on_disk_is_read_as_well(small, tmp_path):
    (tmp_path / "runs.parquet").write_bytes(to_parquet(small))
    assert len(read_parquet(str(tmp_path / "runs.parquet")).runs) == 3


def test_a_value_that_needs_more_digits_is_named(small):
    run = small.runs[0]
    far = replace(run, columns={**run.columns, "rear_x_m": run.x_m * 1e3})
    with pytest.raises(DatasetError, match=r"rear_x_m of run run0 is 9\d\d\.\d+, allowed is below 100 m"):
        to_parquet(Dataset("d", PASSPORT, (far,)))
    absurd = replace(run, columns={**run.columns, "speed_mps": np.full(len(run), -1e300)})
    with pytest.raises(DatasetError, match="speed_mps"):
        to_parquet(Dataset("d", PASSPORT, (absurd,)))


@pytest.mark.parametrize(
    "damage",
    [
        lambda data: b"",
        lambda data: b"PAR1" + b"\0" * 100 + b"PAR1",
        lambda data: data[: len(data) // 2],
        lambda data: data[:200] + bytes(400) + data[600:],
    ],
    ids=["empty", "no footer", "half", "hole"],
)
def test_a_damaged_file_is_an_error_of_ours(small, damage):
    with pytest.raises(DatasetError):
        read_parquet(damage(to_parquet(small)))


def foreign(data, change):
    table = change(pq.read_table(io.BytesIO(data)))
    sink = io.BytesIO()
    pq.write_table(table, sink, row_group_size=201)
    return sink.getvalue()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: t.replace_schema_metadata({}), "format ''"),
        (
            lambda t: t.replace_schema_metadata({**t.schema.metadata, b"rover-twin.format": b"rover-twin-runs/2"}),
            "runs/2",
        ),
        (lambda t: t.drop_columns(["mass_kg"]), "no column mass_kg"),
        (lambda t: t.set_column(6, "time_s", t["time_s"].cast("float64")), "time_s has type double"),
        (lambda t: t.set_column(3, "mass_kg", pa.array(np.arange(603.0))), "one mass_kg, it has 201 values"),
        (lambda t: t.set_column(2, "slope_deg", pa.array(np.full(603, np.nan))), "finite"),
        (lambda t: t.set_column(6, "time_s", t["time_s"].take(pa.array([0] * 603))), "strictly increasing"),
        (lambda t: pa.concat_tables([t, t]), "unique names"),
    ],
    ids=["no format", "newer major", "no mass", "floats", "two masses", "nan", "times", "twice"],
)
def test_a_file_that_breaks_the_rules_is_an_error_of_ours(small, change, message):
    with pytest.raises(DatasetError, match=message):
        read_parquet(foreign(to_parquet(small), change))


def test_columns_that_are_not_ours_are_left_alone(small):
    data = foreign(to_parquet(small), lambda t: t.append_column("colour", pa.array(["red"] * 603)))
    assert dataset_id(read_parquet(data)) == dataset_id(small)


def test_no_damage_gets_past_as_another_error(small):
    data, random = to_parquet(small), np.random.default_rng(5)
    refused = 0
    for _ in range(200):
        damaged = bytearray(data)
        for position in random.integers(0, len(data), 4):
            damaged[position] ^= random.integers(1, 256)
        try:
            read_parquet(bytes(damaged))
        except DatasetError:
            refused += 1
    assert refused > 100
