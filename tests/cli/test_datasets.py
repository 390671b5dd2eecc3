"""`datasets`: folders in and out, with reasons."""

from __future__ import annotations

import json
import re
import shutil
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from model_store import DatasetDraft, ModelStore
from service.cli.failures import ExitCode
from service.datasets import Dataset, Run, dataset_id, parse_passport, to_parquet
from tests.cli.conftest import PASSPORT, call, write_runs


@pytest.mark.slow
def test_list_and_show_agree(small_store):
    listed = call("datasets", "list", "--json", "--store", small_store).json["datasets"]
    assert [each["name"] for each in listed] == ["small"]
    shown = call("datasets", "show", listed[0]["id"][:8], "--json", "--store", small_store).json
    assert shown == listed[0]
    assert listed[0]["id"][:12] in call("datasets", "list", "--store", small_store).out
    assert "20 to 26" in call("datasets", "show", "small", "--store", small_store).out


def test_import_makes_the_store_and_takes_only_the_set(tmp_path):
    folder = write_runs(tmp_path / "runs")
    words = ("--name", "steep", "--set", "steep", "--actor", "me", "--store", tmp_path / "new" / "store")
    imported = call("datasets", "import", folder, *words, "--json").json
    assert imported["dataset"]["summary"]["runs"] == 2
    assert imported["dataset"]["created_by"] == "me"


def test_the_same_runs_are_the_same_dataset(tmp_path, store):
    folder = write_runs(tmp_path / "runs")
    again = call("datasets", "import", folder, "--name", "other", "--store", store)
    assert again.code == 0
    assert "stored before as small" in again.out
    assert len(call("datasets", "list", "--json", "--store", store).json["datasets"]) == 1


def test_a_bad_run_is_left_out_or_with_strict_refused(tmp_path):
    folder = write_runs(tmp_path / "runs", spoil=24.0)
    lax = call("datasets", "import", folder, "--name", "a", "--store", tmp_path / "store")
    assert lax.code == 0
    assert "3 runs, 1 rejected" in lax.out
    assert re.search(r"rejected: runs/s24.csv.gz line \d+ column rear_y_m: nan", lax.err)
    strict = call("datasets", "import", folder, "--name", "b", "--strict", "--store", tmp_path / "strict")
    assert strict.code == ExitCode.REFUSED
    assert "s24.csv.gz" in strict.error
    assert call("datasets", "list", "--json", "--store", tmp_path / "strict").json == {"datasets": []}


def test_validate_tells_and_stores_nothing(tmp_path):
    good, bad = write_runs(tmp_path / "good"), write_runs(tmp_path / "bad", spoil=20.0)
    assert call("datasets", "validate", good).code == 0
    told = call("datasets", "validate", bad, "--json")
    assert told.code == ExitCode.REFUSED
    assert told.json["rejected"] == ["runs/s20.csv.gz"]
    assert "non-finite" in call("datasets", "validate", bad).out


def test_validate_takes_a_file_as_an_upload_would_be(tmp_path):
    folder = write_runs(tmp_path / "runs")
    run, scenario = folder / "runs" / "s20.csv.gz", ("--slope-deg", "20", "--mass-kg", "430", "--torque-nm", "60")
    told = call("datasets", "validate", run, *scenario, "--passport", folder / "passport.json", "--json")
    assert (told.code, told.json["accepted"]) == (0, ["s20.csv.gz"])
    bare = call("datasets", "validate", run, "--json")
    assert bare.code == ExitCode.REFUSED
    assert {each["code"] for each in bare.json["findings"]} == {"scenario-missing", "default-passport"}
    packed = shutil.make_archive(str(tmp_path / "runs"), "zip", folder)
    assert len(call("datasets", "validate", packed, "--json").json["accepted"]) == 4


@pytest.mark.parametrize(
    ("path", "words", "said"),
    [("runs/runs/s20.csv.gz", ("--set", "steep"), "--set"), ("runs", ("--passport", "x"), "--passport"),
     ("nothing", (), "does not exist")],
)  # fmt: skip
def test_validate_says_which_option_goes_with_what(path, words, said, tmp_path):
    write_runs(tmp_path / "runs")
    (tmp_path / "x").write_text("{}")
    words = [tmp_path / "x" if word == "x" else word for word in words]
    told = call("datasets", "validate", tmp_path / path, *words)
    assert told.code == ExitCode.USAGE
    assert said in told.error


def test_options_fill_what_the_table_of_runs_does_not_say(tmp_path):
    folder = write_runs(tmp_path / "runs")
    table = folder / "runs.csv"
    table.write_text("file,slope_deg\n" + "".join(f"runs/s{slope}.csv.gz,{slope}\n" for slope in (20, 22)))
    assert call("datasets", "validate", folder).code != 0
    told = call("datasets", "validate", folder, "--mass-kg", "430", "--torque-nm", "60", "--slope-deg", "3", "--json")
    assert len(told.json["accepted"]) == 2
    assert [each["column"] for each in told.json["findings"] if each["code"] == "ignored-field"] == ["slope_deg"]


def test_a_file_is_not_imported_but_uploaded(tmp_path):
    run = write_runs(tmp_path / "runs") / "runs" / "s20.csv.gz"
    told = call("datasets", "import", run, "--name", "a", "--store", tmp_path / "store")
    assert told.code == ExitCode.USAGE
    assert "datasets upload" in told.error


def test_a_drive_goes_in_thinned_and_out_and_in_again(tmp_path):
    folder, store = write_runs(tmp_path / "runs"), tmp_path / "store"
    time = np.linspace(0.0, 10.0, 401)
    columns = {"time_s": time, "rear_x_m": 0.1 * time, "rear_y_m": np.full(401, 0.24), "slope_deg": 5.0 + time / 10,
               "torque_nm": np.where(time > 7.1, 0.0, 60.0), "brake": (time > 8).astype(float)}  # fmt: skip
    rows = "\n".join(",".join(f"{value:.9g}" for value in row) for row in zip(*columns.values(), strict=True))
    (folder / "drive.csv").write_text(f"{','.join(columns)}\n{rows}\n")
    (folder / "runs.csv").write_text("file,set,mass_kg\ndrive.csv,drive,430\n")
    words = ("--name", "drive", "--step-s", "0.1", "--store", store)
    record = call("datasets", "import", folder, *words, "--json").json["dataset"]
    assert record["summary"]["varies"] == {"slope_deg": 1, "torque_nm": 1, "brake": 1}
    assert 101 <= record["summary"]["rows"] <= 103
    assert "slope in 1 run, torque in 1 run, brake in 1 run" in call("datasets", "show", "drive", "--store", store).out
    assert call("datasets", "preview", "drive", tmp_path / "drive.svg", "--store", store).code == 0
    assert call("datasets", "export", "drive", tmp_path / "out", "--store", store).code == 0
    again = call("datasets", "import", tmp_path / "out", "--name", "again", "--store", store, "--json").json["dataset"]
    assert again["id"] == record["id"]


@pytest.mark.parametrize(
    ("words", "code", "says"),
    [
        (("import", "FOLDER", "--name", "x/y"), ExitCode.USAGE, "name"),
        (("import", "FOLDER", "--name", "x", "--set", "flat"), ExitCode.USAGE, "flat"),
        (("import", "FOLDER", "--name", "x", "--column-map", "unheard-of"), ExitCode.USAGE, "unheard-of"),
        (("import", "FOLDER", "--name", "x", "--column-map", "{time"), ExitCode.USAGE, "not JSON"),
        (("import", "FOLDER/absent", "--name", "x"), ExitCode.FAILED, "runs.csv"),
        (("show", "absent"), ExitCode.NOT_FOUND, "absent"),
        (("export", "absent", "FOLDER/new"), ExitCode.NOT_FOUND, "absent"),
        (("export", "small", "FOLDER"), ExitCode.USAGE, "exists"),
        (("preview", "small", "FOLDER/x.pdf"), ExitCode.USAGE, ".svg, .png or .html"),
        (("preview", "absent", "FOLDER/x.svg"), ExitCode.NOT_FOUND, "absent"),
        (("upload", "FOLDER"), ExitCode.USAGE, "is no file"),
        (("upload", "FOLDER/runs.csv"), ExitCode.REFUSED, "missing-column"),
        (("upload", "FOLDER/runs.csv", "--name", "x/y"), ExitCode.USAGE, "name"),
        (("upload", "FOLDER/runs.csv", "--slope-deg", "90"), ExitCode.USAGE, "slope_deg"),
        (("upload", "FOLDER/runs.csv", "--passport", "FOLDER/runs.csv"), ExitCode.USAGE, "not JSON"),
        (("delete", "absent"), ExitCode.NOT_FOUND, "absent"),
        (("delete", "small"), ExitCode.REFUSED, "rover@1"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_errors(store, tmp_path, words, code, says):
    folder = write_runs(tmp_path / "runs")
    answer = call("datasets", *(word.replace("FOLDER", str(folder)) for word in words), "--store", store)
    assert answer.code == code
    assert says in answer.error
    assert answer.out == ""


@pytest.mark.slow
def test_a_figure_is_drawn_as_its_ending_says(store, tmp_path):
    for ending, magic in (("svg", b"<?xml"), ("png", b"\x89PNG")):
        assert call("datasets", "preview", "small", tmp_path / f"small.{ending}", "--store", store).code == 0
        assert (tmp_path / f"small.{ending}").read_bytes().startswith(magic)


@pytest.mark.slow
def test_a_preview_takes_the_options_of_other_pictures(store, tmp_path):
    words = ("datasets", "preview", "small", "--store", store)
    assert call(*words, tmp_path / "named.svg").code == 0
    assert call(*words, "--format", "svg", "--output", tmp_path / "other").code == 0
    assert call(*words, "-o", tmp_path / "ending.svg").code == 0
    drawn = (tmp_path / "named.svg").read_text()
    assert (tmp_path / "other").read_text() == (tmp_path / "ending.svg").read_text() == drawn
    for to_stdout in ((), ("-",), ("--output", "-")):
        assert call(*words, *to_stdout, "--format", "svg").out == drawn
    for wrong in ((), ("-o", "-"), ("a.svg", "-o", "b.svg")):
        assert call(*words, *wrong).code == ExitCode.USAGE


def packed(folder, target):
    return shutil.make_archive(target, "zip", folder.parent, folder.name)


def test_an_uploaded_archive_is_the_same_dataset_as_its_folder(store, tmp_path):
    archive = packed(write_runs(tmp_path / "runs"), tmp_path / "sent")
    known = call("datasets", "show", "small", "--json", "--store", store).json
    uploaded = call("datasets", "upload", archive, "--name", "other", "--json", "--store", store).json
    assert (uploaded["id"], uploaded["created"], uploaded["dataset"]["name"]) == (known["id"], False, "small")
    said = call("datasets", "upload", archive, "--store", store)
    assert "stored before as small" in said.out
    assert "4 runs, 0 rejected" in said.out


def test_a_dry_run_stores_nothing(store, tmp_path):
    archive = packed(write_runs(tmp_path / "runs", spoil=24.0, slopes=(20.0, 24.0)), tmp_path / "sent")
    dry = call("datasets", "upload", archive, "--dry-run", "--store", store)
    assert "1 runs, 1 rejected, nothing stored" in dry.out
    assert re.search(r"rejected: runs/s24.csv.gz line \d+ column rear_y_m: nan", dry.err)
    assert len(call("datasets", "list", "--json", "--store", store).json["datasets"]) == 1
    assert call("datasets", "upload", archive, "--strict", "--store", store).code == ExitCode.REFUSED


def test_one_file_is_uploaded_with_its_scenario_and_deleted_again(store, tmp_path):
    folder = write_runs(tmp_path / "runs")
    scenario = ("--slope-deg", "20", "--mass-kg", "430", "--torque-nm", "60", "--set", "mine", "--actor", "me")
    words = ("datasets", "upload", folder / "runs" / "s20.csv.gz", *scenario, "--passport", folder / "passport.json")
    uploaded = call(*words, "--json", "--store", store).json
    assert uploaded["created"]
    assert uploaded["dataset"]["created_by"] == "me"
    assert uploaded["dataset"]["summary"]["sets"] == {"mine": 1}
    assert uploaded["report"]["findings"] == []
    assert call("datasets", "delete", uploaded["id"][:8], "--json", "--store", store).json == {
        "deleted": uploaded["id"]
    }
    assert not (store / "jobs").exists()  # looking for jobs makes no database
    assert call("datasets", "show", uploaded["id"], "--store", store).code == ExitCode.NOT_FOUND


def test_headerless_files_are_read_with_a_map(tmp_path):
    folder = write_runs(tmp_path / "runs")
    for file in (folder / "runs").iterdir():
        import gzip

        text = gzip.decompress(file.read_bytes()).partition(b"\n")[2]
        file.write_bytes(text)
    mapping = json.dumps({"time_s": 0, "rear_x_m": 1, "rear_y_m": 2})
    assert call("datasets", "validate", folder).code == ExitCode.REFUSED
    assert call("datasets", "validate", folder, "--column-map", mapping).code == 0


def test_an_exported_folder_imports_as_the_same_dataset(small_store, tmp_path):
    exported = call("datasets", "export", "small", tmp_path / "out", "--json", "--store", small_store).json
    imported = call("datasets", "import", tmp_path / "out", "--name", "back", "--json", "--store", tmp_path / "store")
    assert imported.json["dataset"]["id"] == exported["id"]
    assert imported.json["report"]["rejected"] == []


_NAMES = st.sampled_from(["a", "b c", "x.txt", "x.dat", "x.csv", "x.gz", "s20,5", 'q"q', "ä", "deep/er", "#1"])


@pytest.mark.slow
@settings(max_examples=15)
@given(
    names=st.lists(_NAMES, min_size=1, max_size=3, unique=True),
    speed=st.floats(0.01, 0.3),
    slope=st.floats(5, 44),
    mapped=st.booleans(),
)
def test_export_and_import_keep_the_id(names, speed, slope, mapped):
    """Either the folder reads back to the same id, or nothing is written: never another dataset."""
    passport = PASSPORT | ({"column_map": "vehicle-python"} if mapped else {})
    runs = [_run(name, speed * (1 + 0.1 * index), slope + index / 7) for index, name in enumerate(names)]
    dataset = Dataset("any", parse_passport(json.dumps(passport).encode()), tuple(runs))
    identity = dataset_id(dataset)
    with tempfile.TemporaryDirectory() as root:
        store, folder = Path(root, "store"), Path(root, "out")
        files = {"runs.parquet": to_parquet(dataset), "passport.json": dataset.passport.canonical_json().encode()}
        draft = DatasetDraft(name="any", created_by="tests")
        ModelStore.open(store, create=True).put_dataset(identity, files, draft)
        exported = call("datasets", "export", identity, folder, "--json", "--store", store)
        if exported.code != 0:
            assert exported.code == ExitCode.FAILED
            assert "deep/er" in names  # a folder that all runs share is no part of their names
            assert [each.name for each in Path(root).iterdir()] == ["store"]
            return
        column_map = exported.json["column_map"]
        more = ("--column-map", column_map) if column_map else ()
        back = call("datasets", "import", folder, "--name", "back", *more, "--json", "--store", Path(root, "other"))
        assert back.json["dataset"]["id"] == identity


def _run(name, speed, slope):
    time = np.linspace(0.0, 2.0, 41)
    columns = {"time_s": time, "rear_x_m": speed * time, "rear_y_m": np.full(41, 0.24), "speed_mps": np.full(41, speed)}
    return Run(name, "a set", slope, 430.0, 60.0, 2.0, columns)


def test_a_name_is_taken_once_and_can_be_taken_away(store, tmp_path):
    folder = write_runs(tmp_path / "runs")
    scenario = ("--slope-deg", "20", "--mass-kg", "430", "--torque-nm", "60", "--passport", folder / "passport.json")
    upload = ("datasets", "upload", folder / "runs" / "s20.csv.gz", *scenario, "--store", store, "--name")
    first = call(*upload, "born", "--json").json["id"]
    assert call(*upload, "twin").code == 0
    other = ("datasets", "import", folder, "--store", store, "--name", "twin")
    refused = call(*other)
    assert refused.code == ExitCode.REFUSED
    assert first in refused.error
    assert call("datasets", "forget-name", first, "twin", "--store", store).code == 0
    assert call("datasets", "forget-name", first, "twin", "--store", store).code == ExitCode.NOT_FOUND
    assert call("datasets", "forget-name", first, "born", "--store", store).code == ExitCode.FAILED
    assert call(*other).code == 0
