"""What runs are called by those who send them: names that can become files, and nothing is renamed in silence."""

from __future__ import annotations

import io
import unicodedata
from pathlib import PurePosixPath

import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyarrow import parquet as pq

from service.datasets import Dataset, RejectedDatasetError, Run, parse_passport, read_folder, to_parquet
from service.datasets.file_names import name_fault, run_name
from service.datasets.uploads.upload import read_upload
from service.datasets.uploads.upload_form import UploadForm
from tests.datasets.conftest import motion


def sent(tmp_path, data, filename):
    source, workspace = tmp_path / "sent", tmp_path / "work"
    source.write_bytes(data)
    workspace.mkdir()
    try:
        dataset, report = read_upload(source, filename=filename, workspace=workspace, form=UploadForm())
    except RejectedDatasetError as error:
        return [], error.report.findings
    return [run.name for run in dataset.runs], report.findings


def long_parquet(names):
    columns = {name: [] for name in ("run", "slope_deg", "mass_kg", "torque_nm", *motion())}
    for count, name in enumerate(names):
        run = motion(1.0 + 0.1 * count)
        rows = len(run["time_s"])
        columns["run"] += [name] * rows
        for label, value in (("slope_deg", 20.0 - count), ("mass_kg", 430.0), ("torque_nm", 60.0)):
            columns[label] += [value] * rows
        for column, values in run.items():
            columns[column] += values.tolist()
    sink = io.BytesIO()
    pq.write_table(pa.table(columns), sink)
    return sink.getvalue()


def long_text(names):
    table = pq.read_table(io.BytesIO(long_parquet(names))).to_pydict()
    quoted = ['"' + name.replace('"', '""') + '"' for name in table.pop("run")]
    rows = [
        ",".join([name, *map(repr, row)]) for name, row in zip(quoted, zip(*table.values(), strict=True), strict=True)
    ]
    return ("\n".join([",".join(["run", *table]), *rows]) + "\n").encode()


def ours(names):
    runs = [
        Run(name, "a", 20.0 - count, 430.0, 60.0, 10.0, motion(1.0 + 0.1 * count)) for count, name in enumerate(names)
    ]
    return to_parquet(Dataset("any", _passport(), tuple(runs)))


def _passport():
    text = b'{"format": "rover-twin-passport/1", "gravity_m_s2": 1.62, "frame": "slope frame", "reference_body": "rear"'
    return parse_passport(text + b', "rover": {"wheel_radius_m": 0.25}}')


PACKED = pytest.mark.parametrize("pack", [long_text, long_parquet, ours])


@PACKED
@pytest.mark.parametrize(
    "name", ["../../evil", "a/../../evil", "/abs", "//b", "\\abs", "..\\evil", "C:\\evil", "C:evil", ".", "..."]
)
def test_names_that_lead_elsewhere_are_rejected(pack, name, tmp_path):
    names, findings = sent(tmp_path, pack(["good", name]), "runs")
    assert names == ["good"]
    (rejected,) = [each for each in findings if each.rejects]
    assert (rejected.code, rejected.column) == ("unsafe-path", "run")


@PACKED
@pytest.mark.parametrize(
    ("name", "kept"), [("a\\b", "a/b"), ("a\u202eb", "a_b"), ("a.", "a"), ("x" * 300, "x" * 200), ("a//b", "a/b"),
                       ("a\u0308", "\u00e4")]
)  # fmt: skip
def test_a_name_that_is_written_in_another_way_is_told(pack, name, kept, tmp_path):
    names, findings = sent(tmp_path, pack([name]), "runs")
    assert names == [kept]
    assert [each.column for each in findings if each.code == "renamed"] == ["run"]


@PACKED
def test_two_names_that_become_one_are_both_rejected(pack, tmp_path):
    names, findings = sent(tmp_path, pack(["good", "a\u0308", "\u00e4"]), "runs")
    assert names == ["good"]
    assert [each.code for each in findings if each.rejects] == ["duplicate-name"] * 2


@given(st.text(st.characters(), max_size=260))
def test_kept_names_stay_inside_their_folder_and_stay_as_they_are(text):
    name, unsafe = run_name(text)
    if unsafe is None:
        assert run_name(name) == (name, None)
        assert len(name) <= 200
        assert unicodedata.is_normalized("NFC", name)
        path = PurePosixPath(name)
        assert not path.is_absolute()
        assert ".." not in path.parts
        assert name_fault(name[:50], path_length=512, depth=300) is None or name.startswith("~")


def test_runs_csv_may_call_the_runs(folder):
    for count in (1, 2):
        folder.add(f"runs/{count}.csv", motion(1.0 + 0.1 * count), slope=19.0 + count)
    folder.table = [f"{line},{name}" for line, name in zip(folder.table, ("run", "a/one", "a/two"), strict=True)]
    assert [run.name for run in read_folder(folder.write())[0].runs] == ["a/one", "a/two"]


@pytest.mark.parametrize("names", [("one", "one"), ("one", ""), ("../one", "two"), ("one.", "two")])
def test_names_in_runs_csv_that_do_not_tell_runs_apart_are_not_used(names, folder):
    for count in (1, 2):
        folder.add(f"runs/{count}.csv", motion(1.0 + 0.1 * count), slope=19.0 + count)
    folder.table = [f"{line},{name}" for line, name in zip(folder.table, ("run", *names), strict=True)]
    dataset, report = read_folder(folder.write())
    assert [run.name for run in dataset.runs] == ["1", "2"]
    assert [each.code for each in report.findings if each.column == "run"] == ["ignored-column"]


def test_no_ending_is_taken_off_a_name_of_dots(folder):
    folder.add("runs/...csv", motion())
    assert [run.name for run in read_folder(folder.write())[0].runs] == ["...csv"]
