"""Runs whose slope, torque and brake change: columns of their rows, wherever they come from."""

from __future__ import annotations

import gzip
import json
from dataclasses import replace

import numpy as np
import pytest

from service.datasets import Dataset, Run, dataset_id, parse_passport, read_folder, read_parquet, to_parquet
from service.datasets.checks.motion import fastest_m_s
from service.datasets.columns import BY_NAME
from service.datasets.report import RejectedDatasetError
from service.datasets.run_labels import read_run_labels
from service.datasets.summary import summarise
from service.datasets.thinning import thinned
from service.datasets.uploads.upload import read_upload
from service.datasets.uploads.upload_form import UploadForm
from service.errors import InvalidValueError
from tests.datasets.conftest import PASSPORT

HEADER = "file,set,mass_kg,horizon_s"


def driven(motion, *, start=20.0):
    """A motion with a slope that rises underway, motors off from 4 s to 6 s and a brake from 5 s to 6 s."""
    time = motion["time_s"]
    return motion | {
        "slope_deg": np.where(time > 2, np.minimum(start + (time - 2) / 3, start + 2), start),
        "torque_nm": np.where((time >= 4) & (time < 6), 0.0, 60.0),
        "brake": ((time >= 5) & (time < 6)).astype(float),
    }


def write_folder(folder, files, header=HEADER, rows=None):
    for file, columns in files.items():
        folder.add(file, columns)
    folder.write()
    lines = rows or [f"{file},a,430,{columns['time_s'][-1]:g}" for file, columns in files.items()]
    (folder.path / "runs.csv").write_text("\n".join([header, *lines]) + "\n")
    return folder.path


def run_of(columns, name="r", **scenario):
    values = {"slope_deg": 20.0, "mass_kg": 430.0, "torque_nm": 60.0, "horizon_s": 10.0} | scenario
    return Run(name, "a", **values, columns=columns)


def dataset_of(passport_content, *runs):
    return Dataset("d", parse_passport(json.dumps(passport_content).encode()), runs)


def test_rows_tell_what_runs_csv_does_not(folder, make_motion):
    dataset, report = read_folder(write_folder(folder, {"runs/one.csv": driven(make_motion())}))
    (run,) = dataset.runs
    assert report.findings == ()
    assert run.scenario == (20.0, 430.0, 60.0, 10.0)
    assert run.varies == ("slope_deg", "torque_nm", "brake")
    assert run.acting("slope_deg").max() == 22.0


def test_a_column_that_does_not_change_is_the_scenario(folder, make_motion, passport_content):
    steady = driven(make_motion()) | {"slope_deg": np.full(201, 12.5), "torque_nm": np.full(201, 0.0)}
    steady["brake"] = np.zeros(201)
    dataset, _ = read_folder(write_folder(folder, {"one.csv": steady}))
    (run,) = dataset.runs
    assert (run.varies, run.slope_deg, run.torque_nm) == ((), 12.5, 0.0)
    without = {name: column for name, column in steady.items() if name not in ("slope_deg", "torque_nm", "brake")}
    told = dataset_of(passport_content, run_of(without, slope_deg=12.5, torque_nm=0.0))
    also = dataset_of(passport_content, run_of(steady, slope_deg=12.5, torque_nm=0.0))
    assert dataset_id(told) == dataset_id(also)
    assert to_parquet(told) == to_parquet(also)


def test_a_run_starts_with_the_slope_and_torque_of_its_first_row(make_motion):
    with pytest.raises(InvalidValueError, match="slope_deg of run r is 21"):
        run_of(driven(make_motion()), slope_deg=21.0)


def test_locked_from_the_first_row_to_the_last_is_kept(make_motion):
    assert run_of(make_motion() | {"brake": np.ones(201)}, torque_nm=0.0).varies == ("brake",)


@pytest.mark.parametrize(
    ("column", "value", "said"),
    [
        ("brake", 0.5, "is 0.5 (1 such rows), allowed is 1 (motors off, wheels locked) or 0"),
        ("brake", -1.0, "is -1 (1 such rows), allowed is 1"),
        ("slope_deg", 46.0, "is 46, allowed is -45..45 deg"),
        ("torque_nm", -1.0, "is -1, allowed is 0..10000 N m: locked wheels are a column brake with 1"),
        ("slope_deg", np.nan, "nan is not finite"),
    ],
)
def test_a_row_that_cannot_be_is_named(folder, make_motion, column, value, said):
    columns = driven(make_motion())
    columns[column][100] = value
    with pytest.raises(RejectedDatasetError) as caught:
        read_folder(write_folder(folder, {"one.csv": columns}))
    (finding,) = caught.value.report.rejections
    assert (finding.file, finding.row, finding.column) == ("one.csv", 103, column)
    assert said in finding.message


def test_a_scenario_that_nobody_tells_is_asked_for(folder, make_motion):
    with pytest.raises(RejectedDatasetError) as caught:
        read_folder(write_folder(folder, {"one.csv": make_motion()}))
    assert {(f.code, f.column) for f in caught.value.report.rejections} == {
        ("scenario-missing", "slope_deg"),
        ("scenario-missing", "torque_nm"),
    }


def test_runs_csv_and_the_first_row_say_the_same(folder, make_motion):
    header = HEADER + ",slope_deg,torque_nm"
    path = write_folder(folder, {"one.csv": driven(make_motion())}, header, ["one.csv,a,430,10,20,60"])
    dataset, _ = read_folder(path)
    assert dataset.runs[0].slope_deg == 20.0
    (path / "runs.csv").write_text(f"{header}\none.csv,a,430,10,25,60\n")
    with pytest.raises(
        RejectedDatasetError, match=r"one.csv line 3 column slope_deg: is 20 in the first row, but 25 in"
    ):
        read_folder(path)


def test_runs_of_one_dataset_differ_in_length_sampling_and_what_changes(folder, make_motion):
    files = {
        "drive.csv": driven(make_motion(rows=401, horizon_s=20.0)),
        "short.csv": driven(make_motion(1.1, rows=51, horizon_s=5.0)),
        "steady.csv": make_motion(0.9),
    }
    header = HEADER + ",slope_deg,torque_nm"
    rows = ["drive.csv,a,430,20,,", "short.csv,a,430,5,,", "steady.csv,a,430,10,20,60"]
    dataset, report = read_folder(write_folder(folder, files, header, rows))
    assert report.findings == ()
    assert [len(run) for run in dataset.runs] == [401, 51, 201]
    back = read_parquet(to_parquet(dataset))
    assert dataset_id(back) == dataset_id(dataset)
    for run, again in zip(dataset.runs, back.runs, strict=True):
        assert run.varies == again.varies
        for name, column in run.columns.items():
            np.testing.assert_allclose(again.columns[name], column, rtol=0, atol=0.51 / BY_NAME[name].scale)
    again = read_parquet(to_parquet(back))
    for one, two in zip(back.runs, again.runs, strict=True):
        assert all((one.columns[name] == two.columns[name]).all() for name in one.columns)


def test_what_changes_is_read_though_nobody_asks_for_it(make_motion, passport_content):
    data = to_parquet(dataset_of(passport_content, run_of(driven(make_motion()))))
    (run,) = read_parquet(data, columns=()).runs
    assert list(run.columns) == ["time_s", "rear_x_m", "rear_y_m", "slope_deg", "torque_nm", "brake"]


def test_a_footer_tells_the_slope_of_a_run_or_that_it_has_none(make_motion, passport_content):
    data = to_parquet(dataset_of(passport_content, run_of(driven(make_motion())), run_of(make_motion(1.1), "steady")))
    assert [(label.name, label.slope_deg) for label in read_run_labels(data)] == [("r", None), ("steady", 20.0)]


def test_any_row_that_changes_is_another_dataset(make_motion, passport_content):
    columns = driven(make_motion())
    ids = {dataset_id(dataset_of(passport_content, run_of(columns)))}
    for name, by in (("slope_deg", 1e-6), ("torque_nm", 1e-3), ("brake", 1.0)):
        changed = columns[name].copy()
        changed[150] += by
        ids.add(dataset_id(dataset_of(passport_content, run_of(columns | {name: changed}))))
    assert len(ids) == 4


def test_the_summary_says_which_runs_vary_and_how(make_motion, passport_content):
    dataset = dataset_of(passport_content, run_of(driven(make_motion())), run_of(make_motion(1.1), "steady"))
    summary = summarise(dataset).as_json()
    assert summary["slope_deg"] == {"lowest": 20.0, "highest": 22.0}
    assert summary["torque_nm"] == {"lowest": 0.0, "highest": 60.0}
    assert summary["varies"] == {"slope_deg": 1, "torque_nm": 1, "brake": 1}
    assert summary["varying_runs"] == {
        "r": {
            "slope_deg": {"lowest": 20.0, "highest": 22.0},
            "torque_nm": {"lowest": 0.0, "highest": 60.0},
            "brake_s": 1.0,
        }
    }


def test_two_drives_that_start_alike_are_two_scenarios(folder, make_motion):
    later = driven(make_motion(1.01))
    later["torque_nm"] = np.where(later["time_s"] > 7, 90.0, 60.0)
    _, report = read_folder(write_folder(folder, {"one.csv": driven(make_motion()), "two.csv": later}))
    assert report.findings == ()


def test_gravity_pulls_only_where_it_is_steep(passport_content):
    passport = parse_passport(json.dumps(passport_content).encode())
    time = np.linspace(0.0, 10.0, 1001)
    flat = fastest_m_s(passport, 0.0, time)
    partly = fastest_m_s(passport, np.where(time < 4, 0.0, -30.0), time)
    np.testing.assert_allclose(partly[:400], flat[:400])
    assert partly[-1] - flat[-1] == pytest.approx(1.62 * 0.5 * 6.0, rel=0.01)


def test_every_fifth_step_is_as_good_as_every_step(folder, make_motion):
    columns = make_motion(rows=201)
    _, report = read_folder(folder.add("one.csv", columns, step=0.01).write())
    assert report.findings == ()


def test_thinning_keeps_rows_as_they_are(make_motion, passport_content):
    dataset = dataset_of(passport_content, run_of(driven(make_motion(rows=1001))))
    (full,), (thin,) = dataset.runs, thinned(dataset, 0.07).runs
    kept = np.searchsorted(full.time_s, thin.time_s)
    for name, column in thin.columns.items():
        np.testing.assert_array_equal(column, full.columns[name][kept])
    changes = np.flatnonzero(np.diff(full.columns["torque_nm"]) + np.diff(full.columns["brake"])) + 1
    assert {0, 1000, *changes} <= set(kept)
    assert 1000 * 0.01 / 0.07 < len(thin) < 1000 * 0.01 / 0.07 + 6
    assert "0.07 s" in thinned(dataset, 0.07).passport.model_dump()["kept_rows"]
    assert thinned(dataset, 0.01) is dataset
    with pytest.raises(InvalidValueError, match="r would have"):
        thinned(dataset, 5.0)


# -- a long table ----------------------------------------------------------------------------------------------------


def long_csv(*runs, order=None):
    """Rows of all runs, one after the other or in `order`; each run is a mapping of columns."""
    rows = [row for columns in runs for row in zip(*columns.values(), strict=True)]
    rows = rows if order is None else [rows[index] for index in order]
    text = "\n".join(",".join(f"{v:.9g}" if not isinstance(v, str) else v for v in row) for row in rows)
    return f"{','.join(runs[0])}\n{text}\n".encode()


def upload(tmp_path, data, **form):
    (tmp_path / "work").mkdir(exist_ok=True)
    (tmp_path / "file").write_bytes(data)
    form = {"passport": PASSPORT, **form}
    return read_upload(tmp_path / "file", filename="t.csv", workspace=tmp_path / "work", form=UploadForm(**form))


def labelled(motion, **labels):
    return {name: np.full(len(motion["time_s"]), value) for name, value in labels.items()} | motion


def test_one_file_of_a_drive_needs_only_the_mass(tmp_path, make_motion, as_text):
    dataset, report = upload(tmp_path, gzip.compress(as_text(driven(make_motion()))), mass_kg=430)
    (run,) = dataset.runs
    assert not report.rejected
    assert run.varies == ("slope_deg", "torque_nm", "brake")


@pytest.mark.parametrize("named", [True, False])
def test_constant_within_a_run_is_the_scenario_and_changing_are_rows(tmp_path, make_motion, named):
    runs = [
        labelled(make_motion(), mass_kg=430, slope_deg=20.0, torque_nm=60.0, brake=0.0),
        labelled(driven(make_motion(1.1, rows=301)), mass_kg=430),
        labelled(driven(make_motion(0.9, horizon_s=8.0)), mass_kg=430),
        labelled(make_motion(1.2), mass_kg=430, slope_deg=22.0, torque_nm=60.0, brake=0.0),
    ]
    names = ["time_s", "rear_x_m", "rear_y_m", "mass_kg", "slope_deg", "torque_nm", "brake"]
    tables = [{name: run[name] for name in names} for run in runs]
    if named:
        tables = [{"run": ["abcd"[i]] * len(table["time_s"])} | table for i, table in enumerate(tables)]
    dataset, _ = upload(tmp_path, long_csv(*tables))
    assert [len(run) for run in dataset.runs] == [201, 301, 201, 201]
    assert [bool(run.varies) for run in dataset.runs] == [False, True, True, False]
    assert [run.slope_deg for run in dataset.runs] == [20.0, 20.0, 20.0, 22.0]


def test_constant_runs_whose_rows_are_mixed_by_time_stay_constant(tmp_path, make_motion):
    runs = [
        labelled({name: make_motion(scale)[name] for name in ("time_s", "rear_x_m", "rear_y_m")},
                 mass_kg=430, slope_deg=slope, torque_nm=60.0)
        for scale, slope in ((1.0, 20.0), (0.9, 22.0), (0.8, 24.0))
    ]  # fmt: skip
    order = np.argsort(np.concatenate([run["time_s"] for run in runs]), kind="stable")
    dataset, report = upload(tmp_path, long_csv(*runs, order=order))
    assert not report.rejected
    assert [(run.slope_deg, len(run), run.varies) for run in dataset.runs] == [
        (20.0, 201, ()), (22.0, 201, ()), (24.0, 201, ()),
    ]  # fmt: skip


def test_a_drive_with_a_repeated_time_is_one_faulty_run(tmp_path, make_motion):
    run = labelled(driven(make_motion()), mass_kg=430)
    run["time_s"] = run["time_s"].copy()
    run["time_s"][10] = run["time_s"][9]
    with pytest.raises(RejectedDatasetError) as caught:
        upload(tmp_path, long_csv(run))
    assert {(f.code, f.row) for f in caught.value.report.rejections} == {("time-duplicate", 12)}


def test_slope_under_another_plain_name(tmp_path, make_motion):
    run = labelled(driven(make_motion()), mass_kg=430)
    renamed = {{"slope_deg": "slope angle [deg]", "torque_nm": "Torque (N m)"}.get(n, n): c for n, c in run.items()}
    dataset, _ = upload(tmp_path, long_csv(renamed))
    assert dataset.runs[0].varies == ("slope_deg", "torque_nm", "brake")


def test_our_parquet_uploads_again_to_the_same_dataset(tmp_path, make_motion, passport_content):
    dataset = dataset_of(passport_content, run_of(driven(make_motion())), run_of(make_motion(1.1), "steady"))
    again, report = upload(tmp_path, to_parquet(dataset), passport=None)
    assert dataset_id(again) == dataset_id(dataset)
    assert not report.rejected


def test_our_parquet_with_rows_that_cannot_be_is_rejected(tmp_path, make_motion, passport_content):
    columns = driven(make_motion())
    columns["slope_deg"] = columns["slope_deg"] * 3
    dataset = dataset_of(passport_content, replace(run_of(make_motion()), slope_deg=60.0, columns=columns))
    with pytest.raises(RejectedDatasetError, match="slope_deg"):
        upload(tmp_path, to_parquet(dataset), passport=None)
