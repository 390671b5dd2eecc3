"""Units in headers: a value in another unit, or in one that is not known, is never read as ours; nor does a header of
any length or kind cost time."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from service.datasets.alignment import NOTHING_SAID, Alignment
from service.datasets.columns import meaning_of
from service.datasets.findings import Code, UnusableFileError
from service.datasets.report import RejectedDatasetError, ValidationReport
from service.datasets.run_table import parse_run_table
from service.datasets.uploads.upload import read_upload
from service.datasets.uploads.upload_form import UploadForm
from service.errors import DatasetError

SCENARIO = {"slope_deg": 10.0, "mass_kg": 430.0, "torque_nm": 60.0}
RUN = ("time_s", "rear_x_m", "rear_y_m")


def taken(tmp_path: Path, header: str, *more: float | str, units: str = "", above: str = "") -> ValidationReport:
    """The report on a run that creeps uphill, under this header; `more` are cells at the end of each row."""
    rows = [[f"{0.02 * at:.2f}", f"{0.002 * at * at * 0.02:.6f}", "0.25", *map(str, more)] for at in range(60)]
    lines = [*([above] if above else []), header, *([units] if units else []), *map(",".join, rows)]
    path = tmp_path / "upload"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    workspace = tmp_path / "work"
    workspace.mkdir(exist_ok=True)
    try:
        return read_upload(path, filename="run.csv", workspace=workspace, form=UploadForm(**SCENARIO))[1]
    except RejectedDatasetError as error:
        return error.report


def rejections(report: ValidationReport) -> set[tuple[str, str | None]]:
    return {(finding.code.value, finding.column) for finding in report.findings if finding.rejects}


@pytest.mark.parametrize(
    "cell",
    [
        '"time_s' + " " * 100_000 + 'x"',
        "(" * 100_000,
        "[" + " " * 100_000,
        "a_" * 50_000,
        "time_s" * 16_000,
        " (" * 50_000 + ")",
        "1" * 100_000 + "x",
        "1,".join([""] * 200) + "1" * 100_000 + "x",
        "'" * 100_000,
        "\u00b5" * 100_000,
        "\U0010ffff" * 100_000,
    ],
    ids=lambda cell: f"{cell[:3]!r}",
)
def test_no_header_cell_costs_time_or_makes_a_long_message(cell, tmp_path):
    for header in (f"{cell},b,c", f"time_s,rear_x_m,{cell}", f"time_s,rear_x_m,rear_y_m,{cell}"):
        before = time.process_time()
        report = taken(tmp_path, header, *([1] if header.count(",") > 2 else []))
        assert time.process_time() - before < 1.0
        assert all(len(finding.message) < 2000 for finding in report.findings)


@pytest.mark.parametrize("cell", ["(" * 100_000, '"x' + " " * 100_000 + 'x"', "slope_deg [" + "m" * 100_000 + "]"])
def test_nor_does_one_of_runs_csv(cell):
    before = time.process_time()
    with pytest.raises(DatasetError) as caught:
        parse_run_table(f"{cell},a\nrun.csv,2\n".encode())
    assert time.process_time() - before < 1.0
    assert len(str(caught.value)) < 2000


@pytest.mark.parametrize(
    ("name", "header"),
    [
        ("time_s", "Time [\u00b5s]"), ("time_s", "Time [\u03bcs]"), ("rear_x_m", "rear_x [\u00b5m]"),
        ("rear_x_m", "rear_x_\u00b5m"), ("rear_x_m", "rear_x_\u043c\u043c"), ("rear_x_m", "rear_x_m ['']"),
        ("rear_x_m", "rear_x_m [\"]"), ("rear_x_m", "rear_x_m\u00b2"), ("rear_x_m", "rear_x_m'"),
        ("rear_x_m", "rear_x_m%"), ("rear_y_m", "rear y [dm]"),
    ],
)  # fmt: skip
def test_a_required_column_in_another_unit_is_refused(name, header, tmp_path):
    report = taken(tmp_path, ",".join(header if each == name else each for each in RUN))
    assert ("units", name) in rejections(report)


@pytest.mark.parametrize(
    "header", ["-rear_x_m", "\u0394rear_x_m", "\u2212rear_x_m", "rear_x_m\u00b2", "Mass [\u00b5kg]"]
)
def test_a_name_with_a_character_that_may_mean_something_names_nothing(header):
    assert meaning_of(header) is None


@pytest.mark.parametrize(
    ("name", "header"),
    [
        ("slope_deg", "Slope [rad]"), ("slope_deg", "slope_rad"), ("slope_deg", "Slope (%)"),
        ("slope_deg", "slope_mdeg"), ("slope_deg", "Slope [\u00b5deg]"), ("mass_kg", "Mass [g]"),
        ("mass_kg", "mass_lb"),
        ("mass_kg", "Mass [\u00b5kg]"), ("torque_nm", "torque [kNm]"), ("torque_nm", "torque_nmm"),
        ("torque_nm", "Torque [\u00b5N\u00b7m]"), ("torque_nm", "Torque [\u03bcN\u22c5m]"),
    ],
)  # fmt: skip
def test_a_label_in_another_unit_is_refused_whatever_the_form_says(name, header, tmp_path):
    assert ("units", name) in rejections(taken(tmp_path, ",".join((*RUN, header)), 0.2))
    assert ("units", name) in rejections(taken(tmp_path, ",".join((*RUN, header, "run")), 0.2, "a"))
    others = [each for each in ("slope_deg", "mass_kg", "torque_nm") if each != name]
    with pytest.raises(UnusableFileError) as caught:
        parse_run_table(f"file,{header},{','.join(others)}\nrun.csv,0.2,20,60\n".encode())
    assert [(each.code, each.column) for each in caught.value.findings] == [(Code.UNITS, name)]


@pytest.mark.parametrize(
    ("header", "name"),
    [
        ("Slope (\u00b0)", "slope_deg"), ("Torque [N\u00b7m]", "torque_nm"), ("Torque [N*m]", "torque_nm"),
        ("Torque (N m)", "torque_nm"), ("t [s]", "time_s"), ("'rear x [m]'", "rear_x_m"), ("Speed [m/s]", "speed_mps"),
        ("Time\u00a0[s]", "time_s"), ("\u201cMass (kg)\u201d", "mass_kg"),
    ],
)  # fmt: skip
def test_our_units_are_read_in_every_spelling(header, name):
    assert meaning_of(header) == name


@pytest.mark.parametrize("units", ["s,mm,m", "s,m,\u00b5m", "s,furlong,m", "[s],[dm],[m]", "\u03bcs,m,m"])
@pytest.mark.parametrize("place", ["units", "above"])
def test_a_line_of_units_is_compared_above_the_header_and_below_it(units, place, tmp_path):
    report = taken(tmp_path, ",".join(RUN), **{place: units})
    assert [finding.code for finding in report.findings if finding.rejects] == ["units"]


@pytest.mark.parametrize("place", ["units", "above"])
def test_a_line_of_our_units_is_told(place, tmp_path):
    report = taken(tmp_path, ",".join((*RUN, "other")), 1, **{place: "s,m,[m],[-]"})
    assert not rejections(report)
    assert any(finding.code is Code.COMMENT and "units" in finding.message for finding in report.findings)


@pytest.mark.parametrize("words", [("True", "False"), ("TRUE", "FALSE"), ("true", "false"), ("1", "0")])
@pytest.mark.parametrize("quote", ["", '"'])
def test_a_brake_may_be_true_or_false_and_nothing_else_may(words, quote, tmp_path):
    on, off = (f"{quote}{word}{quote}" for word in words)
    alone = _brake(tmp_path, ",".join((*RUN, "brake")), off, on)
    labelled = _brake(tmp_path, ",".join((*RUN, "brake", "run", "mass_kg")), off, on, "a,430")
    for columns in (alone, labelled):
        assert columns["brake"].tolist() == [0.0] * 30 + [1.0] * 30
    if words[0] != "1":
        assert rejections(taken(tmp_path, ",".join((*RUN, "pitch_rad")), off)) == {("not-a-number", "pitch_rad")}


def _brake(tmp_path: Path, header: str, off: str, on: str, *more: str):
    """The columns of a run that stands still and is braked halfway."""
    rows = [f"{0.02 * at:.2f},0,0.25,{','.join((on if at >= 30 else off, *more))}" for at in range(60)]
    path, workspace = tmp_path / "upload", tmp_path / "work"
    path.write_text("\n".join([header, *rows]) + "\n\x1a")  # DOS programs end a text so
    workspace.mkdir(exist_ok=True)
    return read_upload(path, filename="run.csv", workspace=workspace, form=UploadForm(**SCENARIO))[0].runs[0].columns


@pytest.mark.parametrize("second", ["1732800000.250001", "-0.000001", "1000000", "0"])
def test_a_start_is_shown_with_all_digits_and_taken_as_it_is_shown(second):
    shown = NOTHING_SAID.at(float(second)).removeprefix("--start ")
    assert float(shown) == float(second)
    assert UploadForm(start=shown).said().start == Alignment.said(start=shown).start == float(second)
