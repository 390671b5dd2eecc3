"""What the generator of messy files found: each kind of fault as a small case of its own."""

from __future__ import annotations

import pytest

from tests.datasets.field_cases import COMMA, SPACE, joined, with_column
from tests.datasets.test_field_cases import (
    NAMES,
    SCENARIO,
    archive,
    codes,
    long_table,
    packed,
    read,
    refused,
    same,
    table,
)


def rejected(tmp_path, data, **form):
    """Code, column and message of the only reason."""
    (finding,) = [each for each in refused(tmp_path, data, **form) if each.rejects]
    return finding.code, finding.column, finding.message


@pytest.mark.parametrize("at", [1, 2, 3, 4])
def test_row_names_without_a_name_beside_a_column_without_values_are_refused_where_spaces_separate(at, tmp_path):
    """One surplus and one gap: the row has as many cells as the header, and time would be the number of the row."""
    header, rows = table()
    lines = [" ".join([*header[:at], "note", *header[at:]]), *(" ".join([str(n), *row]) for n, row in enumerate(rows))]
    code, column, message = rejected(tmp_path, "\n".join(lines).encode(), **SCENARIO)
    assert (code, column) == ("header-mismatch", "time_s")
    assert "row names" in message


@pytest.mark.parametrize("mass", ["1,430", "430"])
def test_a_comma_between_thousands_is_no_delimiter(mass, tmp_path):
    header, rows = long_table(("a",))
    assert header[-2:] == ["mass_kg", "torque_nm"]
    header, rows = [*header[:-2], "torque_nm", "mass_kg"], [[*row[:-2], row[-1], mass] for row in rows]
    data = with_column("note", lambda _: "")(header, rows)
    if mass == "430":
        assert read(tmp_path, data)[0].runs[0].mass_kg == 430.0
    else:
        code, column, message = rejected(tmp_path, data)
        assert (code, column) == ("header-mismatch", "mass_kg")
        assert "thousands" in message


@pytest.mark.parametrize(
    ("masses", "code"), [(["1,430"], "not-a-number"), (["1,430", "1,0"], None), (["1.430", "1,0"], "not-a-number")]
)
def test_commas_in_the_table_of_runs_are_decimal_only_beyond_doubt(masses, code, tmp_path):
    members = {"runs.csv": b"", **{f"{at}.csv": COMMA(*table(1.0 - at / 10)) for at in range(len(masses))}}
    rows = [f"{at}.csv;28;{mass};60" for at, mass in enumerate(masses)]
    members["runs.csv"] = "\n".join(["file;slope_deg;mass_kg;torque_nm", *rows]).encode()
    if code is None:
        dataset, report = read(tmp_path, packed(members))
        assert [run.mass_kg for run in dataset.runs] == [1.43, 1.0]
        assert codes(report) == ["decimal-comma"]
    else:
        assert code in {each.code for each in _rejections(tmp_path, packed(members))}


def _rejections(tmp_path, data):
    try:
        return read(tmp_path, data)[1].rejections
    except Exception as error:  # every run is refused
        return error.report.rejections


UNITS = ["Rear x (mm)", "rear_x_mm", "REAR_X_CM", "rear x [cm]", "rear_x_m [mm]", "rear x (ft)"]


@pytest.mark.parametrize("name", UNITS)
def test_a_column_in_another_unit_is_named(name, tmp_path):
    header, rows = table()
    code, column, message = rejected(
        tmp_path, COMMA([name if each == "rear_x_m" else each for each in header], rows), **SCENARIO
    )
    assert (code, column) == ("units", "rear_x_m")
    assert repr(name) in message


@pytest.mark.parametrize(("name", "fine"), [("Weg [m]", True), ("Weg [mm]", False), ("weg_cm", False), ("Weg", True)])
def test_a_column_map_does_not_make_metres_of_millimetres(name, fine, tmp_path):
    header, rows = table()
    data = COMMA([name if each == "rear_x_m" else each for each in header], rows)
    if fine:
        same(read(tmp_path, data, column_map={"rear_x_m": name}, **SCENARIO)[0].runs[0])
    else:
        assert rejected(tmp_path, data, column_map={"rear_x_m": name}, **SCENARIO)[:2] == ("units", "rear_x_m")


@pytest.mark.parametrize("units", ["ms,m,m,m/s", "s,mm,mm,m/s", "s,m,m,km/h", "[s],[cm],[m],[m/s]"])
def test_a_line_of_other_units_is_refused(units, tmp_path):
    header, rows = table()
    code, _, message = rejected(tmp_path, COMMA(header, [units.split(","), *rows]), **SCENARIO)
    assert code == "units"
    assert "expected" in message


def test_a_first_row_of_texts_is_no_line_of_units(tmp_path):
    """`m` and `s` may be names of runs."""
    header, rows = long_table(("m", "s"))
    keep = [header.index(name) for name in ("run", *NAMES, *SCENARIO)]
    dataset, report = read(tmp_path, COMMA([header[at] for at in keep], [[row[at] for at in keep] for row in rows]))
    assert [run.name for run in dataset.runs] == ["m", "s"]
    assert report.findings == ()


def test_row_names_of_r_are_not_looked_for_below_a_header_that_names_them(tmp_path):
    header, rows = long_table(("a",))
    lines = [["index", *header], *([str(at), *row, "1"] for at, row in enumerate(rows))]
    found = refused(tmp_path, "\n".join(",".join(line) for line in lines).encode())
    assert {each.code for each in found if each.rejects} == {"header-mismatch"}


def test_names_of_runs_in_quotes_are_no_row_names(tmp_path):
    header, rows = long_table(("a", "b"))
    lines = [",".join(header), *(",".join([f'"{row[0]}"', *row[1:], "1"]) for row in rows)]
    found = refused(tmp_path, "\n".join(lines).encode())
    assert {each.code for each in found if each.rejects} == {"header-mismatch"}


def test_single_quotes_after_spaces_belong_to_no_name(tmp_path):
    header, rows = long_table(("a", "b"))
    turned = [[*row[1:], f"'{row[0]}'"] for row in rows]
    dataset, _ = read(tmp_path, joined(", ")([*header[1:], "run"], turned))
    assert [run.name for run in dataset.runs] == ["a", "b"]


@pytest.mark.parametrize("turn", [lambda rows: rows[::-1], lambda rows: rows[::2] + rows[1::2][::-1]])
def test_rows_of_unnamed_runs_out_of_order_are_refused_by_that_word(turn, tmp_path):
    header, rows = long_table(("a",))
    found = refused(tmp_path, COMMA(header[1:], [row[1:] for row in turn(rows)]))
    assert {(each.code, each.column) for each in found} == {("time-backward", "time_s")}


def test_a_header_in_a_comment_may_leave_out_the_name_above_row_names(tmp_path):
    header, rows = table()
    text = "\n".join(["# " + ",".join(header), *(",".join([str(at), *row]) for at, row in enumerate(rows))])
    dataset, report = read(tmp_path, text.encode(), **SCENARIO)
    same(dataset.runs[0])
    assert codes(report) == ["comment", "ignored-column"]


@pytest.mark.parametrize("spoil", ["oops", ""])
def test_a_refused_file_tells_its_warnings_too(spoil, tmp_path):
    header, rows = table()
    rows[7][1] = spoil
    text = b"# by hand\n" + with_column("phase", lambda _: "H\u00fcgel")(header, rows).decode().encode("cp1252")
    warnings = ["comment", "encoding", "ignored-column"]
    (tmp_path / "archive").mkdir()
    for folder, data, form in ((tmp_path, text, SCENARIO), (tmp_path / "archive", packed(archive(text)), {})):
        with pytest.raises(Exception) as caught:  # noqa: PT011 - the report is what is looked at
            read(folder, data, **form)
        found = caught.value.report.findings
        assert sorted(each.code for each in found if not each.rejects) == warnings
        assert len(caught.value.report.rejections) == 1


@pytest.mark.parametrize(
    ("listed", "form"),
    [("file\nrun.csv", SCENARIO), ("file,mass_kg\nrun.csv,430", {"slope_deg": 28.0, "torque_nm": 60.0}),
     ("file,slope_deg,mass_kg,torque_nm,horizon_s\nrun.csv,28,,60,", {"mass_kg": 430.0, "horizon_s": 10.0})],
)  # fmt: skip
def test_fields_of_the_form_fill_what_the_table_of_runs_does_not_say(listed, form, tmp_path):
    members = archive(COMMA(*table())) | {"runs.csv": f"{listed}\n".encode()}
    dataset, report = read(tmp_path, packed(members), **form)
    assert dataset.runs[0].scenario == (28.0, 430.0, 60.0, 10.0)
    assert report.findings == ()


def test_rows_that_say_it_come_before_the_form(tmp_path):
    data = with_column("slope_deg", lambda at: str(20 + at // 10))(*table())
    members = archive(data) | {"runs.csv": b"file,mass_kg\nrun.csv,430\n"}
    dataset, report = read(tmp_path, packed(members), slope_deg=28.0, torque_nm=60.0)
    assert dataset.runs[0].slope_deg == 20.0
    assert [(each.code, each.column) for each in report.findings] == [("ignored-field", "slope_deg")]


def test_aligned_words_above_numbers_with_spaces_stay_what_they_were(tmp_path):
    same(read(tmp_path, SPACE(*table()), **SCENARIO)[0].runs[0])
