"""One run, written in every way that people's programs have, alone, in an archive and in a long table: the same run."""

from __future__ import annotations

import io
import json
import unicodedata
import zipfile

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet as pq

from service.datasets import RejectedDatasetError, read_folder
from service.datasets.uploads.upload import read_upload
from service.datasets.uploads.upload_form import UploadForm
from tests.datasets.conftest import PASSPORT, motion
from tests.datasets.field_cases import COMMA, SPACE, WAYS, readable, with_column

NAMES = ["time_s", "rear_x_m", "rear_y_m", "speed_mps"]
SCENARIO = {"slope_deg": 28.0, "mass_kg": 430.0, "torque_nm": 60.0}


def table(scale=1.0):
    columns = motion(scale, rows=41)
    return NAMES, [[f"{float(f'{columns[name][row]:.9g}')!r}" for name in NAMES] for row in range(41)]


def long_table(runs=("s26", "#27", "%slip28")):
    rows = []
    for number, run in enumerate(runs):
        rows += [[run, *row, str(26 + number), "430", "60"] for row in table(1.0 - 0.2 * number)[1]]
    return ["run", *NAMES, *SCENARIO], rows


def read(tmp_path, data, filename="upload", **form):
    path, workspace = tmp_path / "stored", tmp_path / "workspace"
    path.write_bytes(data)
    workspace.mkdir()
    return read_upload(path, filename=filename, workspace=workspace, form=UploadForm(passport=PASSPORT, **form))


def refused(tmp_path, data, filename="upload", **form):
    with pytest.raises(RejectedDatasetError) as caught:
        read(tmp_path, data, filename, **form)
    return caught.value.report.rejections


def packed(members, system=3, flags=None):
    """A zip as another system makes it; `flags` replace those of every member."""
    sink = io.BytesIO()
    with zipfile.ZipFile(sink, "w") as archive:
        for name, data in members.items():
            info = zipfile.ZipInfo("x" * len(name) if isinstance(name, bytes) else name)
            info.create_system = system
            archive.writestr(info, data)
    content = sink.getvalue()
    for name in members:
        if isinstance(name, bytes):
            content = content.replace(b"x" * len(name), name)
    return content


def archive(data, name="run.csv", rows=None):
    listed = f"file,slope_deg,mass_kg,torque_nm\n{rows or f'{name},28,430,60'}\n"
    return {"runs.csv": listed.encode(), name: data}


def same(run, scale=1.0):
    expected = np.array(table(scale)[1], dtype=np.float64).T
    assert list(run.columns) == NAMES
    for name, column in zip(NAMES, expected, strict=True):
        np.testing.assert_allclose(run.columns[name], column, rtol=0, atol=2e-9)


def codes(report):
    return sorted(finding.code for finding in report.findings)


PLAIN = [pytest.param(way, id=readable(way.name)) for way in WAYS]


@pytest.mark.parametrize("way", PLAIN)
def test_a_run_alone(way, tmp_path):
    dataset, report = read(tmp_path, way.write(*table()), **SCENARIO)
    (run,) = dataset.runs
    same(run)
    assert run.scenario[:3] == (28.0, 430.0, 60.0)
    also = ["ignored-column"] if "optional label" in way.name else []
    assert codes(report) == sorted([*way.codes, *also])


@pytest.mark.parametrize("way", PLAIN)
def test_a_run_in_an_archive(way, tmp_path):
    dataset, report = read(tmp_path, packed(archive(way.write(*table()))))
    same(dataset.runs[0])
    also = ["ignored-column"] if "optional label" in way.name else []
    assert codes(report) == sorted([*way.codes, *also])


@pytest.mark.parametrize("way", PLAIN)
def test_runs_in_a_long_table(way, tmp_path):
    dataset, report = read(tmp_path, way.write(*long_table()))
    assert [run.name for run in dataset.runs] == ["s26", "#27", "%slip28"]
    for number, run in enumerate(dataset.runs):
        same(run, 1.0 - 0.2 * number)
        assert run.slope_deg == 26 + number
    also = ["empty-column"] if "optional label" in way.name else []
    assert set(codes(report)) == {*way.codes, *also}


@pytest.mark.parametrize("way", PLAIN)
def test_the_table_of_runs_itself(way, tmp_path):
    spaces = b" " not in way.write(["a", "b"], []).strip() or b"  " in way.write(["a", "b"], []).strip()
    header = ["file", "set", *(["Slope [deg]", "Mass (kg)"] if spaces else ["slope_deg", "mass_kg"]), "torque_nm"]
    rows = [["a.csv", "x", "28", "430", "60"], ["#b.csv", "y", "20.5", "431", "60"]]
    text = way.write(header, rows)
    members = archive(b"") | {"runs.csv": text, "a.csv": COMMA(*table()), "#b.csv": COMMA(*table(0.8))}
    del members["run.csv"]
    dataset, report = read(tmp_path, packed(members))
    assert [(run.name, run.set_name, run.slope_deg, run.mass_kg) for run in dataset.runs] == [
        ("a", "x", 28.0, 430.0),
        ("#b", "y", 20.5, 431.0),
    ]
    assert {code for code in codes(report) if code != "empty-column"} <= {*way.codes, "ignored-column"}


@pytest.mark.parametrize("runs", [("#1", "#2", "#3"), ("1", "#2", "%3"), ("a", "%b", "!c"), ("#a", "b", "c")])
def test_no_run_is_a_comment(runs, tmp_path):
    dataset, report = read(tmp_path, COMMA(*long_table(runs)))
    assert [run.name for run in dataset.runs] == list(runs)
    assert report.findings == ()


def test_a_line_that_is_taken_for_a_comment_is_told(tmp_path):
    header, rows = table()
    rows[20] = [f"#{rows[20][0]}", *rows[20][1:]]
    _, report = read(tmp_path, COMMA(header, rows), **SCENARIO)
    (finding,) = report.findings
    assert (finding.code, finding.severity, finding.row) == ("comment", "warn", 22)
    assert rows[20][0] in finding.message


def test_a_line_of_the_table_of_runs_is_a_comment_where_there_is_no_such_file(tmp_path):
    rows = "run.csv,28,430,60\n#old.csv,20,430,60\n# steep ones"
    dataset, report = read(tmp_path, packed(archive(COMMA(*table()), rows=rows)))
    assert [run.name for run in dataset.runs] == ["run"]
    assert [(f.code, f.row) for f in report.findings] == [("comment", 4), ("comment", 3)]


# 03: labels without values
@pytest.mark.parametrize("label", ["run", "set", "horizon_s", "Horizon [s]"])
def test_an_empty_optional_label_is_as_if_absent(label, tmp_path):
    header, rows = long_table(("one",))
    header, rows = header[1:], [row[1:] for row in rows]
    dataset, report = read(tmp_path, with_column(label, lambda _: "")(header, rows))
    assert (dataset.runs[0].set_name, dataset.runs[0].horizon_s) == ("default", 10.0)
    assert codes(report) == ["empty-column"]


def test_an_empty_label_that_is_needed_is_the_forms(tmp_path):
    header, rows = table()
    text = with_column("mass_kg", lambda _: "")(header, rows)
    assert read(tmp_path, text, **SCENARIO)[0].runs[0].mass_kg == 430.0
    (tmp_path / "other").mkdir()
    (missing,) = refused(tmp_path / "other", text, slope_deg=28.0, torque_nm=60.0)
    assert (missing.code, missing.column) == ("scenario-missing", "mass_kg")


def test_labels_and_columns_that_some_runs_have_are_theirs_alone(tmp_path):
    """As pandas' concat makes of tables with different columns."""
    header, rows = long_table(("a", "b"))
    rows = [[*row, "10" if row[0] == "a" else "", "0.01" if row[0] == "b" else ""] for row in rows]
    dataset, report = read(tmp_path, COMMA([*header, "horizon_s", "pitch_rad"], rows))
    assert [set(run.columns) - set(NAMES) for run in dataset.runs] == [set(), {"pitch_rad"}]
    assert [(f.file, f.code, f.column) for f in report.findings] == [("upload#a", "empty-column", "pitch_rad")]


@pytest.mark.parametrize(("at", "column"), [(2, "rear_x_m"), (4, "speed_mps"), (5, "slope_deg"), (0, "run")])
def test_a_cell_without_a_value_where_there_are_others_is_named(at, column, tmp_path):
    header, rows = long_table(("a",))
    rows[10][at] = ""
    (finding,) = refused(tmp_path, COMMA(header, rows))
    assert (finding.code, finding.row, finding.column) == ("empty-cell", 12, column)


# 10 and 14: two columns for one thing
@pytest.mark.parametrize(
    ("name", "other"),
    [("rear_x_m", "rear_x_m"), ("rear_x_m", "Rear X [m]"), ("time_s", "Time (s)"), ("time_s", "t"),
     ("speed_mps", "speed (m/s)")],
)  # fmt: skip
def test_two_readings_of_one_thing_are_refused_naming_both(name, other, tmp_path):
    data = with_column(other, str)(*table())
    (finding,) = refused(tmp_path, data, **SCENARIO)
    assert (finding.code, finding.column) == ("duplicate-column", name)
    assert repr(name) in finding.message
    assert repr(other) in finding.message
    (tmp_path / "archive").mkdir()
    (again,) = refused(tmp_path / "archive", packed(archive(data)))
    assert again.message == finding.message


@pytest.mark.parametrize(
    ("label", "other"),
    [("slope_deg", "Slope (deg)"), ("slope_deg", "slope_angle_deg"), ("slope_deg", "Slope [\u00b0]"),
     ("mass_kg", "Mass [kg]"), ("torque_nm", "Torque (N m)"), ("torque_nm", "torque_nm"), ("run", "Run"),
     ("set", "SET"), ("horizon_s", "horizon (s)")],
)  # fmt: skip
def test_two_columns_of_one_label_are_refused_naming_both(label, other, tmp_path):
    header, rows = long_table(("a",))
    if label not in header:
        header, rows = [*header, label], [[*row, "10"] for row in rows]
    (finding,) = refused(tmp_path, with_column(other, lambda _: "10")(header, rows))
    assert (finding.code, finding.column) == ("duplicate-column", label)
    assert repr(label) in finding.message
    assert repr(other) in finding.message


def test_a_column_map_says_which_of_two_is_meant(tmp_path):
    data = with_column("Rear X [m]", lambda _: "0")(*table())
    dataset, report = read(tmp_path, data, column_map={"rear_x_m": "rear_x_m"}, **SCENARIO)
    same(dataset.runs[0])
    assert codes(report) == ["ignored-column"]


def parquet(columns, names):
    sink = io.BytesIO()
    pq.write_table(pa.Table.from_arrays([pa.array(column) for column in columns], names=names), sink)
    return sink.getvalue()


def test_a_name_twice_in_parquet_is_told_where_it_is_used_and_only_there(tmp_path):
    columns = list(np.array(table()[1], dtype=np.float64).T)
    (finding,) = refused(tmp_path, parquet([*columns, columns[1]], [*NAMES, "rear_x_m"]), **SCENARIO)
    assert (finding.code, finding.column) == ("duplicate-column", "rear_x_m")
    (tmp_path / "other").mkdir()
    data = parquet([*columns, ["x"] * 41, ["y"] * 41], [*NAMES, "note", "note"])
    dataset, report = read(tmp_path / "other", data, **SCENARIO)
    same(dataset.runs[0])
    assert codes(report) == ["ignored-column"]


def test_parquet_has_columns_nobody_asked_for_empty_ones_and_blank_rows(tmp_path):
    columns = [[*map(float, column), None] for column in np.array(table()[1], dtype=np.float64).T]
    text = [*["x"] * 41, None]
    data = parquet([*columns, text, [None] * 42, [[1]] * 41 + [None]], [*NAMES, "note", "pitch_rad", "lists"])
    dataset, report = read(tmp_path, data, **SCENARIO)
    same(dataset.runs[0])
    assert codes(report) == ["empty-column", "ignored-column"]


# 06 and 07: names in archives
@pytest.mark.parametrize("system", [0, 10, 11, 14])
def test_backslashes_separate_where_windows_packed(system, tmp_path):
    members = archive(COMMA(*table()), "runs/a/s.csv")
    members["runs\\a\\s.csv"] = members.pop("runs/a/s.csv")
    dataset, report = read(tmp_path, packed(members, system))
    assert [run.name for run in dataset.runs] == ["s"]
    assert codes(report) == ["renamed"]


def test_the_table_of_runs_may_have_backslashes_too(tmp_path):
    members = archive(COMMA(*table()), "runs/s.csv", rows="runs\\s.csv,28,430,60")
    dataset, report = read(tmp_path, packed(members))
    assert [run.name for run in dataset.runs] == ["s"]
    assert [(f.code, f.file, f.row) for f in report.findings] == [("renamed", "runs.csv", 2)]


@pytest.mark.parametrize("name", ["..\\..\\x.csv", "\\x.csv", "C:\\x.csv", "a\\..\\..\\..\\x.csv"])
def test_backslashes_lead_out_no_more_than_slashes_do(name, tmp_path):
    members = archive(COMMA(*table())) | {name: b"1"}
    assert {finding.code for finding in refused(tmp_path, packed(members, 0))} == {"unsafe-path"}
    (tmp_path / "unix").mkdir()
    assert {finding.code for finding in refused(tmp_path / "unix", packed(members, 3))} == {"unsafe-path"}


NAME = "Sch\u00f6ner H\u00fcgel \u2013 \u00e9.csv"


@pytest.mark.parametrize("form", ["NFC", "NFD"])
@pytest.mark.parametrize("listed", ["NFC", "NFD"])
@pytest.mark.parametrize("flagged", [True, False])
def test_letters_are_the_same_however_they_are_composed(form, listed, flagged, tmp_path):
    name = unicodedata.normalize(form, NAME)
    members = archive(COMMA(*table()), rows=f"{unicodedata.normalize(listed, NAME)},28,430,60")
    members[name if flagged else name.encode()] = members.pop("run.csv")
    dataset, report = read(tmp_path, packed(members))
    assert [run.name for run in dataset.runs] == [NAME.removesuffix(".csv")]
    assert codes(report) == ([] if flagged and form == "NFC" else ["renamed"])


@pytest.mark.parametrize("form", ["NFC", "NFD"])
@pytest.mark.parametrize("listed", ["NFC", "NFD"])
def test_the_same_holds_for_a_folder(form, listed, tmp_path):
    members = archive(COMMA(*table()), rows=f"{unicodedata.normalize(listed, NAME)},28,430,60")
    members[unicodedata.normalize(form, NAME)] = members.pop("run.csv")
    members["passport.json"] = json.dumps(PASSPORT).encode()
    for name, data in members.items():
        (tmp_path / name).write_bytes(data)
    dataset, report = read_folder(tmp_path)
    assert [run.name for run in dataset.runs] == [NAME.removesuffix(".csv")]
    assert report.findings == ()


def test_a_name_in_the_code_page_of_a_pc_stays_as_it_is(tmp_path):
    members = archive(COMMA(*table()), rows="H\u00fcgel.csv,28,430,60")
    members["H\u00fcgel.csv".encode("cp437")] = members.pop("run.csv")
    dataset, report = read(tmp_path, packed(members, 0))
    assert [run.name for run in dataset.runs] == ["H\u00fcgel"]
    assert report.findings == ()


# one table among other files
def test_a_readme_beside_a_long_table_does_not_hide_it(tmp_path):
    notes = b"Runs of 2026\n\nslope  mass\n1 2\n"
    members = {"README.txt": notes, "notes.txt": notes, "about.csv": notes, "long.csv": COMMA(*long_table())}
    dataset, report = read(tmp_path, packed(members))
    assert len(dataset.runs) == 3
    assert codes(report) == ["unlisted-file"]
    assert "3 more files" in report.findings[0].message or "2 more files" in report.findings[0].message


def test_the_passport_beside_a_long_table_counts(tmp_path):
    path = tmp_path / "stored"
    path.write_bytes(packed({"passport.json": json.dumps(PASSPORT), "long.csv": COMMA(*long_table())}))
    (tmp_path / "workspace").mkdir()
    dataset, report = read_upload(path, filename="x.zip", workspace=tmp_path / "workspace", form=UploadForm())
    assert dataset.passport.title == "synthetic"
    assert report.findings == ()


def test_files_that_nobody_reads_are_told_wherever_they_are(tmp_path):
    members = {f"data/{name}": data for name, data in archive(COMMA(*table())).items()}
    members |= {"data/deeper/forgotten.DAT": b"1", "beside.csv": b"1", "data/deeper/runs.csv": b"1", ".DS_Store": b"1",
                "__MACOSX/data/._run.csv": b"1", "README.md": b"1"}  # fmt: skip
    _, report = read(tmp_path, packed(members))
    assert {finding.file for finding in report.findings if finding.code == "unlisted-file"} == {
        "upload",
        "beside.csv",
        "deeper/forgotten.DAT",
        "deeper/runs.csv",
    }


def test_fields_of_the_form_that_files_answer_themselves_are_told(tmp_path):
    _, report = read(tmp_path, COMMA(*long_table()), slope_deg=12.0, horizon_s=10.0)
    assert [(f.code, f.column) for f in report.findings] == [("ignored-field", "slope_deg")]
    (tmp_path / "archive").mkdir()
    dataset, report = read(tmp_path / "archive", packed(archive(COMMA(*table()))), slope_deg=12.0, set_name="x")
    assert [(f.code, f.column) for f in report.findings] == [("ignored-field", "slope_deg")]
    assert dataset.runs[0].set_name == "x"


def test_a_header_that_may_be_one_column_off_is_refused(tmp_path):
    """R leaves out the name above its row names; the last column of this one has no values."""
    header, rows = table()
    text = "\n".join([";".join([*header, "note"]), *(";".join([str(at), *row, ""]) for at, row in enumerate(rows))])
    (finding,) = refused(tmp_path, text.encode(), **SCENARIO)
    assert finding.code == "header-mismatch"
    assert "row names" in finding.message


def test_times_that_count_rows_are_told_where_a_missing_cell_would_leave_no_trace(tmp_path):
    header, rows = table()
    rows = [[str(at), f"{0.1 * at:g}", row[2]] for at, row in enumerate(rows)]
    dataset, report = read(tmp_path, SPACE(header[:3], rows), **SCENARIO)
    assert dataset.runs[0].time_s[-1] == 40
    assert [(f.code, f.column) for f in report.findings] == [("header-mismatch", "time_s")]


def test_a_first_row_in_quotes_is_no_header(tmp_path):
    _, rows = table()
    text = "\n".join(",".join(f'"{cell:>12}"' for cell in row) for row in rows).encode()
    mapping = {"time_s": 0, "rear_x_m": 1, "rear_y_m": 2, "speed_mps": 3}
    same(read(tmp_path, text, column_map=mapping, **SCENARIO)[0].runs[0])


def test_columns_that_do_not_belong_to_the_header_are_refused(tmp_path):
    rows = "run.csv,28,5,430,60"
    found = refused(tmp_path, packed(archive(COMMA(*table()), rows=rows)))
    assert (found[0].code, found[0].file, found[0].row) == ("ragged-row", "runs.csv", 2)


def test_three_columns_without_a_header_are_told_what_to_pass_first(tmp_path):
    rows = "\n".join(
        " ".join(f"{float(cell):.8E}".replace("E", "D") for cell in row[:3]) for row in table()[1]
    ).encode()

    findings = [each for each in refused(tmp_path, rows, **SCENARIO) if each.rejects]

    first, *_, last = findings
    assert '{"time_s": 0, "rear_x_m": 1, "rear_y_m": 2}' in first.message
    assert last.message.startswith("3 columns without a header: if they are time, force and torque")
