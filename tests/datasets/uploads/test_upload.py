"""One dataset in all the shapes in which people send it."""

from __future__ import annotations

import bz2
import gzip
import io
import json
import lzma

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pyarrow import parquet as pq

from service.datasets import RejectedDatasetError, dataset_id, read_folder, to_parquet
from service.datasets.uploads.upload import read_upload
from service.datasets.uploads.upload_form import UploadForm, UploadLimits
from service.errors import InvalidValueError
from tests.datasets.conftest import PASSPORT, chrono_text, motion
from tests.datasets.hostile_files import HEADER, SCENARIO, headless, tarred, zipped

RUNS = {"a": (20.0, 1.0, "gentle"), "b": (25.0, 0.8, "gentle"), "c": (30.0, 0.5, "steep")}


def rounded(scale):
    """As read back from nine digits, so that every shape holds the very same numbers."""
    return {name: np.array([float(f"{v:.9g}") for v in column]) for name, column in motion(scale, rows=51).items()}


COLUMNS = {name: rounded(scale) for name, (_, scale, _) in RUNS.items()}


def members(below=""):
    rows = [f"{name}.csv,{set_name},{slope},430,60,10" for name, (slope, _, set_name) in RUNS.items()]
    files = {f"{name}.csv": chrono_text(columns) for name, columns in COLUMNS.items()}
    files |= {"passport.json": json.dumps(PASSPORT).encode(), "runs.csv": "\n".join([HEADER, *rows]).encode()}
    return {f"{below}{name}": data for name, data in files.items()}


def packed_runs():
    return {name: gzip.compress(data) if name[0] in "abc" else data for name, data in members().items()}


def long_columns(*, shuffled=False, run=True):
    parts = []
    for name, (slope, _, set_name) in RUNS.items():
        count = len(COLUMNS[name]["time_s"])
        labels = {"run": [name] * count} if run else {}
        parts.append({**labels, "set": [set_name] * count, "slope_deg": [slope] * count, "mass_kg": [430.0] * count,
                      "torque_nm": [60.0] * count, "horizon_s": [10.0] * count, **COLUMNS[name]})  # fmt: skip
    whole = {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
    if shuffled:
        # rows of all runs in turn, as a program that steps them together would write
        order = np.argsort(whole["time_s"], kind="stable")
        whole = {key: column[order] for key, column in whole.items()}
    return whole


def long_csv(columns, delimiter=","):
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    lines = [delimiter.join(columns), *(delimiter.join(map(str, row)) for row in rows)]
    return ("\r\n".join(lines) + "\r\n").encode()


def foreign_parquet(columns):
    sink = io.BytesIO()
    pq.write_table(pa.table(columns), sink)
    return sink.getvalue()


def read(tmp_path, data, filename="upload", limits=None, **form):
    path, workspace = tmp_path / "stored", tmp_path / "workspace"
    path.write_bytes(data)
    workspace.mkdir()
    return read_upload(path, filename=filename, workspace=workspace, form=UploadForm(**form), limits=limits)


@pytest.fixture(scope="module")
def identity(tmp_path_factory):
    folder = tmp_path_factory.mktemp("folder")
    for name, data in members().items():
        (folder / name).write_bytes(data)
    return dataset_id(read_folder(folder)[0])


def ours(tmp_path):
    (tmp_path / "folder").mkdir()
    for name, data in members().items():
        (tmp_path / "folder" / name).write_bytes(data)
    return to_parquet(read_folder(tmp_path / "folder")[0])


_GIVEN = {"passport": PASSPORT}
SHAPES = {
    "zip": (lambda: zipped(members()), {}),
    "zip below a folder": (lambda: zipped(members("chrono/out/")), {}),
    "zip of gzipped files": (lambda: zipped(packed_runs()), {}),
    "tar": (lambda: tarred(members()), {}),
    "tar.gz": (lambda: gzip.compress(tarred(members("./"))), {}),
    "tar.bz2": (lambda: bz2.compress(tarred(members())), {}),
    "tar.xz": (lambda: lzma.compress(tarred(members("x/"))), {}),
    "zip.gz": (lambda: gzip.compress(zipped(members())), {}),
    "long CSV": (lambda: long_csv(long_columns()), _GIVEN),
    "long CSV, gzipped": (lambda: gzip.compress(long_csv(long_columns())), _GIVEN),
    "long CSV, semicolons": (lambda: long_csv(long_columns(), ";"), _GIVEN),
    "long CSV, rows of all runs in turn": (lambda: long_csv(long_columns(shuffled=True)), _GIVEN),
    "long CSV alone in a zip": (lambda: zipped({"out/long.csv": long_csv(long_columns())}), _GIVEN),
    "long Parquet": (lambda: foreign_parquet(long_columns()), _GIVEN),
    "long Parquet, gzipped": (lambda: gzip.compress(foreign_parquet(long_columns())), _GIVEN),
}  # fmt: skip


@pytest.mark.parametrize("shape", SHAPES)
def test_the_same_runs_are_the_same_dataset_in_every_shape(shape, tmp_path, identity):
    build, form = SHAPES[shape]
    dataset, report = read(tmp_path, build(), **form)
    assert dataset_id(dataset) == identity
    assert report.rejections == ()
    assert report.findings_left_out == 0
    assert len(report.accepted) == 3


def test_our_own_parquet_comes_back_the_same(tmp_path, identity):
    assert dataset_id(read(tmp_path, ours(tmp_path))[0]) == identity


def test_without_names_runs_are_told_apart_by_scenario_and_by_time_that_starts_again(tmp_path):
    once = long_columns(run=False)
    twice = {key: np.concatenate([column, column]) for key, column in once.items()}
    twice["rear_x_m"][len(once["time_s"]) :] *= 0.9
    twice["speed_mps"][len(once["time_s"]) :] *= 0.9
    dataset, report = read(tmp_path, long_csv(twice), **_GIVEN)
    assert sorted(run.name for run in dataset.runs) == [
        *("s20_m430_t60", "s20_m430_t60_2", "s25_m430_t60", "s25_m430_t60_2", "s30_m430_t60", "s30_m430_t60_2")
    ]
    assert report.rejections == ()


def test_a_bad_run_of_a_long_table_is_left_out_with_its_line(tmp_path):
    columns = long_columns()
    columns["rear_y_m"][60] = np.nan
    dataset, report = read(tmp_path, long_csv(columns), filename="C:\\runs\\all.csv", **_GIVEN)
    assert sorted(run.name for run in dataset.runs) == ["a", "c"]
    assert [(f.file, f.row, f.column, f.code) for f in report.rejections] == [
        ("all.csv#b", 62, "rear_y_m", "non-finite")
    ]
    assert report.rejected == ("all.csv#b",)
    (tmp_path / "strict").mkdir()
    with pytest.raises(RejectedDatasetError, match="1 reasons"):
        read(tmp_path / "strict", long_csv(columns), strict=True, **_GIVEN)


def test_the_form_fills_what_a_table_does_not_say(tmp_path):
    columns = {name: column for name, column in long_columns().items() if name not in {"set", "mass_kg"}}
    dataset, _ = read(tmp_path, long_csv(columns), mass_kg=500.0, set_name="mine", **_GIVEN)
    assert {(run.mass_kg, run.set_name) for run in dataset.runs} == {(500.0, "mine")}


def test_one_file_takes_its_scenario_from_the_form_and_says_that_it_assumes_viper(tmp_path):
    dataset, report = read(tmp_path, chrono_text(COLUMNS["a"]), filename="my run.csv", horizon_s=10.0, **SCENARIO)
    assert dataset.name == "my-run"
    assert dataset.runs[0].scenario == (20.0, 430.0, 60.0, 10.0)
    assert dataset.passport.gravity_m_s2 == 1.62
    assert [(f.code, f.severity) for f in report.findings] == [("default-passport", "warn")]


def demo_viper_slope():
    """demo_ROBOT_Viper_WheelSlope_CRM.cpp: tabs, angular velocity under ax..az, its own place in a world frame."""
    x, time = COLUMNS["a"]["rear_x_m"], COLUMNS["a"]["time_s"]
    zero = np.zeros_like(x)
    header = ["time", "x", "y", "z", "vx", "vy", "vz", "ax", "ay", "az", "fx", "fy", "fz", "tx", "ty", "tz"]
    values = [time, x - 2.0, zero, COLUMNS["a"]["rear_y_m"], COLUMNS["a"]["speed_mps"], *[zero + 0.5] * 11]
    return "\n".join("\t".join(map(str, row)) for row in [header, *zip(*values, strict=True)]).encode()


def demo_lander():
    x, time = COLUMNS["a"]["rear_x_m"], COLUMNS["a"]["time_s"]
    zero = np.zeros_like(x)
    header = ["time", "px", "py", "pz", "vx", "vy", "vz", "wx", "wy", "wz"]
    values = [time, x + 1.0, zero, COLUMNS["a"]["rear_y_m"], COLUMNS["a"]["speed_mps"], *[zero] * 5]
    return "\n".join(",".join(map(str, row)) for row in [header, *zip(*values, strict=True)]).encode()


def demo_vehicle():
    a = COLUMNS["a"]
    zero = np.zeros_like(a["time_s"])
    return headless(zip(a["time_s"], a["rear_x_m"] + 4.0, zero, a["rear_y_m"], a["speed_mps"], strict=True))


@pytest.mark.parametrize(
    ("build", "column_map"),
    [(demo_viper_slope, None), (demo_viper_slope, "chrono-viper-slope"), (demo_lander, None),
     (demo_vehicle, "vehicle-python"),
     (demo_vehicle, {"time_s": 0, "rear_x_m": 1, "rear_y_m": 3, "zero_start": True})],
    ids=["viper slope, seen", "viper slope", "lander, seen", "vehicle", "a map"],
)  # fmt: skip
def test_what_the_demos_of_chrono_write_is_read(build, column_map, tmp_path):
    dataset, report = read(tmp_path, build(), column_map=column_map, **SCENARIO)
    assert report.rejections == ()
    np.testing.assert_allclose(dataset.runs[0].x_m, COLUMNS["a"]["rear_x_m"], atol=1e-5)
    np.testing.assert_allclose(dataset.runs[0].y_m, COLUMNS["a"]["rear_y_m"], atol=1e-5)


def test_five_columns_without_header_are_told_what_they_may_be(tmp_path):
    with pytest.raises(RejectedDatasetError, match=r"vehicle-python.*four wheel torques.*no position"):
        read(tmp_path, demo_vehicle(), **SCENARIO)


def test_the_passport_of_the_form_wins(tmp_path):
    dataset, report = read(tmp_path, zipped(members()), passport=PASSPORT | {"title": "mine"})
    assert dataset.passport.title == "mine"
    assert [finding.code for finding in report.findings] == ["passport"]


def test_a_map_of_the_form_that_is_not_allowed_is_the_callers_mistake(tmp_path):
    with pytest.raises(InvalidValueError, match="unheard-of"):
        read(tmp_path, zipped(members()), column_map="unheard-of")


@pytest.mark.parametrize(
    ("limits", "code"),
    [(UploadLimits(rows=100), "too-large"), (UploadLimits(members=4), "too-many-files"),
     (UploadLimits(total_bytes=5000), "too-large"), (UploadLimits(file_bytes=900), "too-large"),
     (UploadLimits(ratio=1.5, ratio_from_bytes=1000), "decompression-bomb")],
    ids=["rows", "members", "total", "file", "ratio"],
)  # fmt: skip
def test_each_limit_holds(limits, code, tmp_path):
    with pytest.raises(RejectedDatasetError) as caught:
        read(tmp_path, zipped(members()), limits=limits, strict=True)
    assert code in {finding.code for finding in caught.value.report.rejections}


def test_all_files_together_are_bounded_once_unpacked_twice(tmp_path):
    """A gzipped run in a zip expands after the archive has been measured."""
    largest = max(len(data) for data in members().values())
    with pytest.raises(RejectedDatasetError) as caught:
        read(tmp_path, zipped(packed_runs()), limits=UploadLimits(total_bytes=largest + 3000), strict=True)
    assert {finding.code for finding in caught.value.report.rejections} == {"too-large"}


@pytest.mark.parametrize(
    ("filename", "shown"),
    [
        ("../../etc/passwd", "passwd"),
        ("C:\\x\\run.csv", "run.csv"),
        ("a\x1b[2J\n.csv", "a\\x1b[2J\\n.csv"),
        ("  ", "upload"),
    ],
)
def test_what_the_sender_calls_it_is_only_shown_and_shown_safely(filename, shown, tmp_path):
    with pytest.raises(RejectedDatasetError) as caught:
        read(tmp_path, b"", filename=filename)
    assert caught.value.report.rejections[0].file == shown


_BASES = [
    zipped(members()),
    gzip.compress(tarred(members())),
    long_csv(long_columns()),
    foreign_parquet(long_columns()),
]


@pytest.mark.slow
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_damage_anywhere_is_read_or_rejected_never_anything_else(tmp_path_factory, data):
    content = bytearray(data.draw(st.sampled_from(_BASES)))
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(content) - 1))
        content[at] = data.draw(st.integers(0, 255))
    if data.draw(st.booleans()):
        del content[data.draw(st.integers(1, len(content))) :]
    try:
        dataset, report = read(tmp_path_factory.mktemp("fuzz"), bytes(content), **_GIVEN)
    except RejectedDatasetError as error:
        dataset, report = None, error.report
    assert len(report.accepted) == (len(dataset.runs) if dataset else 0)
    assert dataset or report.rejections
