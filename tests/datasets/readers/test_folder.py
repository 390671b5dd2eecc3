from __future__ import annotations

import json
from dataclasses import asdict

import pytest

from service.datasets.default_passport import VIPER_ON_LUNAR_REGOLITH
from service.datasets.readers.folder import read_folder
from service.datasets.report import RejectedDatasetError
from service.datasets.run_table import unsafe_path
from service.errors import DatasetError, InvalidValueError


@pytest.mark.parametrize(
    "name",
    ["../out.csv", "a/../../out.csv", "/etc/passwd", "C:/x.csv", "c:x.csv", "..\\x.csv", "", "a\x00.csv", "x" * 600],
)
def test_names_that_could_leave_the_folder_are_unsafe(name):
    assert unsafe_path(name)


@pytest.mark.parametrize("name", ["a.csv", "runs/a.csv.gz", "./a.csv", "a..b.csv", "é/1.csv"])
def test_ordinary_names_are_safe(name):
    assert not unsafe_path(name)


def test_traversal_is_rejected_and_the_rest_is_read(folder, make_motion, as_text):
    (folder.path.parent / "out.csv").write_bytes(as_text(make_motion()))
    folder.add("good.csv", make_motion(0.8), slope=10).add("../out.csv")
    _, report = read_folder(folder.write())
    assert [(f.code, f.file, f.row) for f in report.rejections] == [("unsafe-path", "runs.csv", 3)]


def test_a_link_out_of_the_folder_is_rejected(folder, make_motion, as_text):
    (folder.path.parent / "out.csv").write_bytes(as_text(make_motion()))
    (folder.path / "link.csv").symlink_to(folder.path.parent / "out.csv")
    folder.add("good.csv", make_motion(0.8), slope=10).add("link.csv")
    _, report = read_folder(folder.write())
    assert [(f.code, f.file) for f in report.rejections] == [("unsafe-path", "link.csv")]


def test_missing_repeated_and_unlisted_files_are_told(folder, make_motion, as_text):
    folder.add("runs/good.csv", make_motion(), step=0.05).add("runs/gone.csv", slope=5).add("runs/good.csv", slope=7)
    (folder.path / "runs" / "forgotten.csv").write_bytes(as_text(make_motion()))
    (folder.path / "README.md").write_text("not data")
    _, report = read_folder(folder.write())
    assert {(f.code, f.file, f.severity) for f in report.findings} == {
        ("missing-file", "runs/gone.csv", "reject"),
        ("duplicate-entry", "runs.csv", "reject"),
        ("unlisted-file", "runs/forgotten.csv", "warn"),
    }
    assert report.accepted == ("runs/good.csv",)
    assert report.rejected == ("runs/gone.csv",)


def test_strict_refuses_what_would_otherwise_be_left_out(folder, make_motion):
    path = folder.add("good.csv", make_motion()).add("gone.csv", slope=5).write()
    assert len(read_folder(path)[0].runs) == 1
    with pytest.raises(RejectedDatasetError, match=r"gone\.csv: listed in runs\.csv") as caught:
        read_folder(path, strict=True)
    assert caught.value.report.accepted == ("good.csv",)


def test_nothing_usable_is_an_error_with_the_reasons(folder):
    with pytest.raises(RejectedDatasetError, match="no run is usable") as caught:
        read_folder(folder.add("gone.csv").write())
    assert caught.value.report.summary is None


def test_sets_are_chosen_by_name(folder, make_motion):
    folder.add("a.csv", make_motion(), set_name="paper").add("b.csv", make_motion(0.9), slope=5, set_name="mass")
    path = folder.write()
    assert read_folder(path, sets=["mass"])[0].sets == ("mass",)
    dataset, _ = read_folder(path)
    assert dataset.sets == ("paper", "mass")
    assert [run.name for run in dataset.only_sets(["paper"]).runs] == ["a"]
    for read in (lambda: read_folder(path, sets=["sand"]), lambda: dataset.only_sets(["sand"])):
        with pytest.raises(InvalidValueError, match=r"\['sand'\]"):
            read()


def test_progress_is_told_before_each_file(folder, make_motion):
    told = []
    folder.add("a.csv", make_motion()).add("b.csv", make_motion(0.9), slope=5)
    read_folder(folder.write(), progress=lambda *args: told.append(args))
    assert told == [(0, 2, "a.csv"), (1, 2, "b.csv")]


def test_run_names_drop_what_all_files_share_and_stay_unique(folder, make_motion):
    folder.add("runs/x/a.csv", make_motion()).add("runs/y/a.csv", make_motion(0.9), slope=5)
    dataset, _ = read_folder(folder.write())
    assert [run.name for run in dataset.runs] == ["x/a", "y/a"]


def test_files_without_header_take_the_passports_columns(folder, make_motion, as_text):
    columns = make_motion()
    folder.passport["columns"] = list(columns)
    dataset, report = read_folder(folder.add("a.dat", as_text(columns, header=False, delimiter=" ")).write())
    assert list(dataset.runs[0].columns) == list(columns)
    assert report.findings == ()


def test_horizon_is_the_last_time_when_the_table_has_none(folder, make_motion):
    dataset, _ = read_folder(folder.add("a.csv", make_motion(), horizon="").write())
    assert dataset.runs[0].horizon_s == 10.0


def test_summary_and_report_are_plain_json(folder, make_motion):
    folder.add("a.csv", make_motion()).add("b.csv", make_motion(0.9, rows=101), slope=5, mass=500).add("gone.csv")
    _, report = read_folder(folder.write())
    summary = json.loads(json.dumps(report.as_json()))["summary"]
    assert (summary["runs"], summary["rows"], summary["sets"]) == (2, 302, {"a": 2})
    assert summary["slope_deg"] == {"lowest": 5.0, "highest": 20.0}
    assert summary["step_s"] == {"lowest": 0.05, "highest": 0.1}
    assert asdict(report.findings[0])["code"] == "missing-file"


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ("", "lists 0 runs"),
        ("file,slope_deg\na,1\n", "has no column mass_kg"),
        ("file,slope_deg,mass_kg,torque_nm\n", "lists 0 runs"),
        ('file,slope_deg,mass_kg,torque_nm\n"a,1,2,3\n', "1 values, the header names 4 columns"),
        ("file,slope_deg,mass_kg,torque_nm,Slope [deg]\na,1,2,3,1\n", "several columns for slope_deg"),
    ],
)
def test_a_table_that_says_nothing_is_refused(folder, table, message):
    folder.write()
    (folder.path / "runs.csv").write_text(table)
    with pytest.raises(DatasetError, match=message):
        read_folder(folder.path)


def test_a_folder_without_passport_is_of_the_rover_that_uploads_without_one_are(folder, make_motion):
    path = folder.add("a.csv", make_motion()).write()
    (path / "passport.json").unlink()
    dataset, report = read_folder(path)
    assert dataset.passport == VIPER_ON_LUNAR_REGOLITH
    assert [(f.code, f.severity) for f in report.findings] == [("default-passport", "warn")]


def test_a_folder_without_runs_csv_is_refused(tmp_path):
    with pytest.raises(DatasetError, match=r"runs\.csv cannot be read"):
        read_folder(tmp_path)
