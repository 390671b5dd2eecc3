"""Each reason for refusing a run, with the line and the column that a user will look at."""

from __future__ import annotations

import numpy as np
import pytest

from service.datasets.checks.motion import fastest_m_s
from service.datasets.passport import Passport
from service.datasets.readers.folder import read_folder
from service.datasets.report import RejectedDatasetError


def edit(name, index, value):
    def apply(columns):
        columns[name] = columns[name].copy()
        columns[name][index] = value
        return columns

    return apply


def scale(factor, *names):
    return lambda columns: columns | {name: columns[name] * factor for name in names}


def keep(rows):
    return lambda columns: {name: column[rows] for name, column in columns.items()}


def shift(name, offset):
    return lambda columns: columns | {name: columns[name] + offset}


def without(rows):
    return lambda columns: {name: np.delete(column, rows) for name, column in columns.items()}


POSITIONS = ("rear_x_m", "rear_y_m", "front_x_m", "front_y_m")
LAST = 201 + 2  # line of the last row

REJECTED = [
    ("nan", edit("rear_y_m", 7, np.nan), "non-finite", 10, "rear_y_m"),
    ("infinite", edit("speed_mps", 0, np.inf), "non-finite", 3, "speed_mps"),
    ("few rows", keep(slice(0, 9)), "too-few-rows", None, None),
    ("same time twice", edit("time_s", 50, 2.45), "time-duplicate", 53, "time_s"),
    ("time goes back", edit("time_s", 50, 2.4), "time-backward", 53, "time_s"),
    ("time in ms", scale(1000.0, "time_s"), "units", LAST, "time_s"),
    ("lengths in mm", scale(1000.0, *POSITIONS), "units", None, "rear_y_m"),
    ("lengths in cm", scale(100.0, *POSITIONS), "units", None, "rear_y_m"),
    ("front in mm", scale(1000.0, "front_x_m"), "units", 3, "front_x_m"),
    ("height out of range", shift("rear_y_m", 9.0), "out-of-range", 3, "rear_y_m"),
    ("starts late", shift("time_s", 3.0), "start-time", 3, "time_s"),
    ("starts elsewhere", shift("rear_x_m", 0.4), "start-position", 3, "rear_x_m"),
    ("stopped early", keep(slice(0, 150)), "horizon", 152, "time_s"),
    ("long hole", without(slice(100, 110)), "sampling-gap", 103, "time_s"),
    ("x jumps", edit("rear_x_m", 120, 5.0), "jump", 123, "rear_x_m"),
    ("y jumps", edit("rear_y_m", 120, 0.9), "jump", 123, "rear_y_m"),
    ("speed has another sign", scale(-1.0, "speed_mps"), "speed-mismatch", None, "speed_mps"),
    ("speed in km/h", scale(3.6, "speed_mps"), "speed-mismatch", None, "speed_mps"),
]

WARNED = [
    ("small hole", without(slice(100, 104)), "sampling-gap", 103, "time_s"),
    ("a little off the origin", shift("rear_x_m", 0.001), "start-position", 3, "rear_x_m"),
    ("goes on", lambda columns: columns, "horizon", LAST, "time_s"),
    ("wheel in the air", shift("rear_y_m", 0.2), "wheel-band", 3, "rear_y_m"),
    ("another rover's front", shift("front_x_m", 0.8), "wheelbase", 3, "front_x_m"),
]


@pytest.mark.slow
@pytest.mark.parametrize(("change", "code", "row", "column"), [c[1:] for c in REJECTED], ids=[c[0] for c in REJECTED])
def test_a_bad_run_is_rejected_with_its_place_and_the_good_one_stays(folder, make_motion, change, code, row, column):
    folder.add("good.csv", make_motion(0.8), slope=10).add("bad.csv", change(make_motion()))
    dataset, report = read_folder(folder.write())
    assert [run.name for run in dataset.runs] == ["good"]
    assert (report.accepted, report.rejected) == (("good.csv",), ("bad.csv",))
    first = report.rejections[0]
    assert (first.file, first.code, first.column) == ("bad.csv", code, column)
    if row is not None:
        assert first.row == row


@pytest.mark.parametrize(("change", "code", "row", "column"), [c[1:] for c in WARNED], ids=[c[0] for c in WARNED])
def test_what_may_be_meant_is_only_warned_about(folder, make_motion, change, code, row, column):
    folder.add("run.csv", change(make_motion()), horizon=9.0 if code == "horizon" else 10.0)
    dataset, report = read_folder(folder.write())
    assert len(dataset.runs) == 1
    assert [(f.code, f.row, f.column) for f in report.findings] == [(code, row, column)]


def test_a_clean_run_has_no_findings(folder, make_motion):
    _, report = read_folder(folder.add("run.csv", make_motion(), step=0.05).write())
    assert report.findings == ()


def test_step_that_disagrees_with_the_table_is_told(folder, make_motion):
    _, report = read_folder(folder.add("run.csv", make_motion(), step=0.001).write())
    assert [finding.code for finding in report.findings] == ["step"]


def test_variable_step_is_fine_and_told(folder, make_motion):
    columns = make_motion(rows=2001)
    rows = np.unique(np.concatenate([[0, 2000], np.cumsum(np.random.default_rng(3).integers(4, 14, 300))]))
    _, report = read_folder(folder.add("run.csv", keep(rows[rows <= 2000])(columns)).write())
    assert [(finding.code, finding.severity) for finding in report.findings] == [("step", "warn")]
    assert "from 0.02 to 0.065 s" in report.findings[0].message


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("slope=500", "scenario-range"),
        ("mass=430000", "units"),
        ("torque=60000", "units"),
        ("horizon=10000", "units"),
        ("torque=-1", "scenario-range"),
        ("mass=nan", "non-finite"),
        ("mass=heavy", "not-a-number"),
        ("mass=", "scenario-missing"),
    ],
)
def test_a_scenario_that_cannot_be_is_rejected_with_its_line(folder, make_motion, text, code):
    field, value = text.split("=")
    folder.add("good.csv", make_motion(0.8), slope=10).add("bad.csv", make_motion(), **{field: value})
    _, report = read_folder(folder.write())
    [found] = report.rejections
    assert (found.file, found.code, found.row) == ("runs.csv", code, 3)
    assert found.column.startswith(field)
    assert report.accepted == ("good.csv",)


def test_slopes_in_radians_reject_the_dataset(folder, make_motion):
    for index, degrees in enumerate((20, 21, 22)):
        folder.add(f"{index}.csv", make_motion(1 + index / 10), slope=round(np.radians(degrees), 6))
    with pytest.raises(RejectedDatasetError, match="radians"):
        read_folder(folder.write())


def test_gentle_slopes_in_round_degrees_are_only_suspicious(folder, make_motion):
    for index, degrees in enumerate((0.0, 0.25, 0.5)):
        folder.add(f"{index}.csv", make_motion(1 + index / 10), slope=degrees)
    dataset, report = read_folder(folder.write())
    assert len(dataset.runs) == 3
    assert "radians" in report.findings[0].message


def test_the_same_run_twice_keeps_the_first(folder, make_motion):
    folder.add("one.csv", make_motion()).add("two.csv", make_motion())
    _, report = read_folder(folder.write())
    assert report.accepted == ("one.csv",)
    assert report.rejections[0].code == "duplicate-content"


def test_one_trajectory_under_two_scenarios_rejects_both(folder, make_motion):
    folder.add("one.csv", make_motion()).add("two.csv", make_motion(), mass=500).add(
        "c.csv", make_motion(0.5), mass=600
    )
    _, report = read_folder(folder.write())
    assert report.accepted == ("c.csv",)
    assert {finding.file for finding in report.rejections} == {"one.csv", "two.csv"}


def test_one_scenario_simulated_twice_is_a_warning(folder, make_motion):
    folder.add("one.csv", make_motion()).add("two.csv", make_motion(0.99))
    dataset, report = read_folder(folder.write())
    assert len(dataset.runs) == 2
    assert [finding.code for finding in report.findings] == ["duplicate-scenario"]


def test_speed_bound_is_rim_speed_plus_free_slide(passport_content):
    passport = Passport.model_validate(passport_content)
    flat, slope = fastest_m_s(passport, 0.0, np.array([10.0])), fastest_m_s(passport, -30.0, np.array([10.0]))
    assert flat == pytest.approx(1.5 * 0.25 * 3.14159)
    assert slope - flat == pytest.approx(1.62 * 0.5 * 10.0)


def test_a_free_slide_is_possible_and_passes(folder):
    time = np.linspace(0.0, 10.0, 201)
    x = -0.5 * 1.62 * np.sin(np.radians(30.0)) * time**2
    folder.add("slide.csv", {"time_s": time, "rear_x_m": x, "rear_y_m": np.full(201, 0.23)}, slope=30)
    _, report = read_folder(folder.write())
    assert report.findings == ()


def test_a_frame_that_is_not_the_slope_frame_is_told(folder, make_motion):
    folder.passport["frame"] = "world"
    _, report = read_folder(folder.add("run.csv", make_motion()).write())
    assert [(finding.file, finding.code) for finding in report.findings] == [("passport.json", "frame")]
