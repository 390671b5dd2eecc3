"""Runs in another frame, of another point, from another start: what is recognised, and what an option brings back."""

from __future__ import annotations

import json
import re
import tempfile
from pathlib import Path

import numpy as np
import pytest

from service.datasets import RejectedDatasetError, dataset_id, read_folder
from service.datasets.alignment import Alignment, Frame, Reference
from service.datasets.checks.candidate import Candidate
from service.datasets.checks.recording import settled_until
from service.datasets.checks.validate import check_run
from service.datasets.default_passport import VIPER_ON_LUNAR_REGOLITH
from service.datasets.run_table import RunEntry
from service.datasets.uploads.upload import read_upload
from service.datasets.uploads.upload_form import UploadForm
from service.errors import InvalidValueError
from tests.datasets.recordings import (
    CARRIERS,
    PLAIN,
    WHEELBASE_M,
    cut,
    elsewhere,
    later,
    of_chassis,
    of_front,
    plain_file,
    reversed_x,
    run_columns,
    settling,
    shipped,
    world,
)

ALL = tuple(run_columns(next(iter(shipped().values()))))
STEP = 10


def real(slope=28.0, mass=430.0, torque=60.0):
    told = (slope, mass, torque)
    return next(run for run in shipped().values() if run.scenario[:3] == told and not run.varies)


RUNS = {"steep": real(), "gentle": real(12.93, 416.1, 96.5), "downhill": real(-10.55, 566.5, 117.1)}


def read(tmp_path, sent, **form):
    path, workspace = tmp_path / "stored", Path(tempfile.mkdtemp(dir=tmp_path))
    path.write_bytes(sent.data)
    return read_upload(path, filename=sent.name, workspace=workspace, form=UploadForm(**sent.form, **form))


def refused(tmp_path, sent, **form):
    with pytest.raises(RejectedDatasetError) as caught:
        read(tmp_path, sent, **form)
    return {str(finding.code): finding.message for finding in caught.value.report.rejections}


def same(run, columns, atol=1e-6):
    assert set(run.columns) == set(columns)
    for name, column in columns.items():
        np.testing.assert_allclose(run.columns[name], column, rtol=0, atol=atol, err_msg=name)


# what is done to a run, what says so, and the finding that names it when nothing is said
WAYS = {
    "later": (lambda run, c: later(c, 5.0), {"start": "first-row"}, "start-time"),
    "later, by time": (lambda run, c: later(c, 5.0), {"start": "5"}, "start-time"),
    "settling": (lambda run, c: settling(c, 2.0), {"start": "2.0"}, "settling"),
    "settling later": (lambda run, c: later(settling(c, 1.5), 7.25), {"start": "8.75"}, "settling"),
    "settling before zero": (lambda run, c: later(settling(c, 2.0), -2.0), {"start": "0"}, "out-of-range"),
    "elsewhere": (lambda run, c: elsewhere(c, -3.2), {"start": "0"}, "start-position"),
    "world": (lambda run, c: world(c, run.slope_deg), {"frame": "world"}, "frame"),
    "world elsewhere": (lambda run, c: world(c, run.slope_deg, (2.5, 0.0)), {"frame": "world"}, "frame"),
    "world, downhill": (
        lambda run, c: reversed_x(world(c, run.slope_deg)),
        {"frame": "world-downhill"},
        "frame",
    ),
    "world, settling": (
        lambda run, c: settling(world(c, run.slope_deg), 2.0, drop_m=0.0),
        {"frame": "world", "start": "2"},
        "frame",
    ),
}


@pytest.mark.parametrize("columns", [PLAIN, ALL], ids=["positions", "all columns"])
@pytest.mark.parametrize("which", RUNS)
@pytest.mark.parametrize("way", WAYS)
def test_the_option_brings_the_canonical_run_back(way, which, columns, tmp_path):
    change, option, code = WAYS[way]
    run = RUNS[which]
    own = run_columns(run, columns, STEP)
    sent = plain_file(run, change(run, own))
    (name, value), *_ = option.items()
    (told,) = re.findall(rf"--{name} ([^ ,;]+)", refused(tmp_path, sent)[code])[:1]
    if code == "settling":  # without wheel speeds, the moment is seen when the rover has moved
        assert float(value) <= float(told) <= float(value) + 0.05
    elif value != "5":
        assert told in (value, "first-row")
    dataset, report = read(tmp_path, sent, **option)
    same(dataset.runs[0], own)
    assert [str(f.code) for f in report.findings if f.code != "default-passport"] == ["aligned"]


@pytest.mark.parametrize("carrier", CARRIERS)
@pytest.mark.parametrize("way", WAYS)
def test_it_does_so_in_each_carrier_and_the_dataset_is_the_same(way, carrier, tmp_path):
    change, option, code = WAYS[way]
    run = RUNS["steep"]
    own = run_columns(run, PLAIN, STEP)
    plain, _ = read(tmp_path, CARRIERS[carrier](run, own))
    sent = CARRIERS[carrier](run, change(run, own))
    assert code in refused(tmp_path, sent)
    dataset, _ = read(tmp_path, sent, **option)
    same(dataset.runs[0], own)
    rounded = {name: np.round(column, 6) for name, column in dataset.runs[0].columns.items()}
    assert rounded.keys() == plain.runs[0].columns.keys()
    assert dataset.passport == plain.passport


def test_a_settling_time_is_named_to_the_row_without_wheel_speeds_too(tmp_path):
    for run in RUNS.values():
        own = run_columns(run, PLAIN, STEP)
        told = refused(tmp_path, plain_file(run, settling(own, 2.0)))["settling"]
        named = float(told.split("--start ")[1].split()[0])
        assert 2.0 <= named <= 2.05
        turning = refused(tmp_path, plain_file(run, settling(run_columns(run, None, STEP), 2.0)))["settling"]
        assert "--start 2 " in turning


@pytest.mark.parametrize("columns", [PLAIN, ALL], ids=["positions", "all columns"])
def test_a_run_that_begins_under_way_is_refused_whatever_is_said_of_its_start(columns, tmp_path):
    run = real(20.0)
    moving = cut(run_columns(run, columns, STEP), 5.0)
    assert {"start-time", "moving-start"} <= set(refused(tmp_path, plain_file(run, moving)))
    assert "first-row" not in refused(tmp_path, plain_file(run, moving))["start-time"]
    for start in ("first-row", "5", "5.5"):
        assert set(refused(tmp_path, plain_file(run, moving), start=start)) == {"moving-start"}
    hidden = elsewhere(later(moving, -5.0), -float(moving["rear_x_m"][0]))
    assert set(refused(tmp_path, plain_file(run, hidden))) == {"moving-start"}


def test_a_slow_beginning_under_way_is_told_by_positions_and_refused_by_wheels(tmp_path):
    run = real(24.0)
    for columns, is_sure in ((PLAIN, False), (ALL, True)):
        sent = plain_file(run, cut(run_columns(run, columns, STEP), 3.0))
        if is_sure:
            assert "moving-start" in refused(tmp_path, sent, start=str(3.0))
        else:
            assert "moving-start" in {str(f.code) for f in read(tmp_path, sent, start=str(3.0))[1].findings}


@pytest.mark.parametrize(("point", "change", "within_m"), [
    ("front-wheel", of_front, (0.004, 0.026)),
    ("chassis", of_chassis, (0.002, 0.013)),
])  # fmt: skip
def test_another_point_of_the_rover(point, change, within_m, tmp_path):
    run = RUNS["steep"]
    own = run_columns(run, None, STEP)
    sent = plain_file(run, change(own))
    assert f"--reference {point}" in refused(tmp_path, sent)["reference"]
    dataset, report = read(tmp_path, sent, reference=point)
    back = dataset.runs[0]
    assert np.abs(back.x_m - own["rear_x_m"]).max() < within_m[0]
    assert np.abs(back.y_m - own["rear_y_m"]).max() < within_m[1]
    assert [str(f.code) for f in report.findings[1:]] == ["aligned"]
    shifted = own | {"rear_x_m": own["rear_x_m"] + WHEELBASE_M}
    exact, _ = read(tmp_path, plain_file(run, {n: c for n, c in shifted.items() if n in PLAIN}), reference=point)
    same(exact.runs[0], {name: own[name] for name in PLAIN})


def test_the_errors_that_are_named_for_other_points_hold_for_the_shipped_runs():
    along, normal = [], []
    for run in shipped().values():
        if np.ptp(run.y_m) < 0.15:  # the terrain of `kink` itself bends
            front = run.columns
            along.append(np.abs(front["front_x_m"] - front["front_x_m"][0] - run.x_m).max())
            normal.append(np.abs(front["front_y_m"] - run.y_m).max())
    assert len(along) > 150
    assert np.quantile(along, 0.9) <= 0.004
    assert max(normal) <= 0.0265


def test_only_the_front_wheel_is_recorded(tmp_path):
    run = RUNS["steep"]
    own = run_columns(run, None, STEP)
    only = {name: column for name, column in own.items() if name in ("time_s", "front_x_m", "front_y_m")}
    assert "--reference front-wheel" in refused(tmp_path, plain_file(run, only))["reference"]
    back = read(tmp_path, plain_file(run, only), reference="front-wheel")[0].runs[0]
    same(back, {"time_s": own["time_s"], "rear_x_m": own["front_x_m"] - own["front_x_m"][0],
                "rear_y_m": own["front_y_m"]})  # fmt: skip


WRONG = [
    {"frame": "world"},
    {"frame": "world-downhill"},
    {"frame": "slope-downhill"},
    {"reference": "front-wheel"},
    {"reference": "chassis"},
    {"start": "4"},
    {"start": "11"},
]


@pytest.mark.parametrize("said", WRONG, ids=str)
def test_a_right_run_of_which_something_wrong_is_said_is_refused(said, tmp_path):
    run = RUNS["steep"]
    assert refused(tmp_path, plain_file(run, run_columns(run, None, STEP)), **said)


@pytest.mark.parametrize("said", WRONG[:3], ids=str)
def test_a_wrong_frame_is_seen_from_positions_alone(said, tmp_path):
    run = RUNS["gentle"]
    assert "leave it out" in refused(tmp_path, plain_file(run, run_columns(run, PLAIN, STEP)), **said)["frame"]


def test_positions_that_grow_downhill_are_told_where_nothing_else_shows_it(tmp_path):
    run = RUNS["gentle"]
    sent = plain_file(run, reversed_x(run_columns(run, PLAIN, STEP)))
    (finding,) = [f for f in read(tmp_path, sent)[1].findings if f.code == "frame"]
    assert "--frame slope-downhill" in finding.message
    same(read(tmp_path, sent, frame="slope-downhill")[0].runs[0], run_columns(run, PLAIN, STEP))


def test_what_is_said_in_so_many_words_is_taken_with_a_warning(tmp_path):
    run = RUNS["steep"]
    own = run_columns(run, PLAIN, STEP)
    for columns, said, code in (
        (world(own, 28.0), {"frame": "slope", "start": "0"}, "frame"),
        (settling(own, 2.0, drop_m=0.0), {"start": "0"}, "settling"),
    ):
        _, report = read(tmp_path, plain_file(run, columns), **said)
        assert code in {str(f.code) for f in report.findings}


def test_a_slope_that_changes_is_not_turned(tmp_path):
    run = next(each for each in shipped().values() if "slope_deg" in each.varies)
    sent = plain_file(run, run_columns(run, (*PLAIN, *run.varies)))
    assert "the slope changes" in refused(tmp_path, sent, frame="world")["frame"]
    assert read(tmp_path, sent)[0].runs[0].varies


def test_no_shipped_run_raises_a_suspicion():
    for run in shipped().values():
        slope, torque = (None if name in run.varies else getattr(run, name) for name in ("slope_deg", "torque_nm"))
        entry = RunEntry(run.name, "a", slope, run.mass_kg, torque, run.horizon_s, None, 1)
        lines = np.arange(1, len(run) + 1)
        for names in (PLAIN, ALL):
            columns = {n: c for n, c in run.columns.items() if n in (*names, *run.varies)}
            found = check_run(Candidate(entry, columns, lines, VIPER_ON_LUNAR_REGOLITH))
            assert {str(f.code) for f in found} <= {"wheel-band"}, (run.name, found)


def test_no_shipped_run_with_coarse_rows_seems_to_settle():
    for run in shipped().values():
        step = max(1, round(0.25 / float(np.median(np.diff(run.time_s)))))
        slope, torque = (None if name in run.varies else getattr(run, name) for name in ("slope_deg", "torque_nm"))
        entry = RunEntry(run.name, "a", slope, run.mass_kg, torque, None, None, 1)
        columns = run_columns(run, step=step)
        rows = np.arange(len(columns["time_s"]))
        assert settled_until(Candidate(entry, columns, rows, VIPER_ON_LUNAR_REGOLITH)) is None


def test_the_horizon_counts_from_the_start(folder, tmp_path):
    run = RUNS["steep"]
    sent = plain_file(run, settling(run_columns(run, PLAIN, STEP), 2.0))
    for horizon in (10.0, 12.0):
        kept = read(tmp_path, type(sent)(sent.data, sent.name, sent.form | {"horizon_s": horizon}), start="2")[0].runs[
            0
        ]
        assert kept.horizon_s == 10.0


class TestSaidByPassport:
    """A campaign says once how all of its runs were recorded."""

    def write(self, folder, **alignment):
        run = RUNS["steep"]
        changed = settling(world(run_columns(run, PLAIN, STEP), 28.0), 2.0, drop_m=0.0)
        folder.passport["alignment"] = {"frame": "world", "start": 2.0} | alignment
        folder.passport["frame"] = "world frame: x horizontal, z up"
        return folder.add("run.csv", changed, slope=28.0).write()

    def test_it_holds_and_what_is_kept_is_canonical(self, folder):
        dataset, report = read_folder(self.write(folder))
        same(dataset.runs[0], run_columns(RUNS["steep"], PLAIN, STEP))
        assert [str(f.code) for f in report.findings] == ["aligned"]
        stored = json.loads(dataset.passport.canonical_json())
        assert "alignment" not in stored
        assert stored["frame"].startswith("slope frame")

    def test_an_option_outranks_it_and_that_is_told(self, folder):
        path = self.write(folder, start=7.0)
        dataset, report = read_folder(path, said=Alignment.said(start="2.0"))
        assert len(dataset.runs) == 1
        told = next(f for f in report.findings if f.code == "ignored-field")
        assert (told.file, told.column) == ("passport.json", "alignment.start")
        same_thing, _ = read_folder(path, said=Alignment.said(start=2.0))
        assert dataset_id(dataset) == dataset_id(same_thing)

    def test_a_word_that_is_none_is_refused(self, folder):
        with pytest.raises(Exception, match="alignment"):
            read_folder(self.write(folder, frame="sideways"))


@pytest.mark.parametrize(
    ("field", "value"),
    [("frame", "wold"), ("reference", "wheel"), ("start", "soon"), ("start", "nan"), ("start", "1e11")],
)
def test_other_words_are_refused_with_those_that_are_allowed(field, value):
    with pytest.raises(InvalidValueError, match="allowed is"):
        Alignment.said(**{field: value})


def test_the_form_knows_the_same_words():
    for field, words in (("frame", Frame), ("reference", Reference)):
        assert {UploadForm(**{field: each}).said().words()[field] for each in words} == set(words)
