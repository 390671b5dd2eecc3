from __future__ import annotations

import numpy as np
import pytest

from service.datasets.columns import COLUMNS, canonical_name
from service.datasets.findings import UnusableFileError
from service.datasets.readers.column_map import PRESETS, ColumnMap, resolve
from service.datasets.readers.folder import read_folder
from service.errors import InvalidValueError

VIPER_SLOPE = ["time", "x", "y", "z", "vx", "vy", "vz", "ax", "ay", "az", "fx", "fy", "fz", "tx", "ty", "tz"]
LANDER = ["time", "px", "py", "pz", "vx", "vy", "vz", "wx", "wy", "wz"]


@pytest.mark.parametrize("column", COLUMNS, ids=lambda column: column.name)
def test_canonical_names_are_recognised_however_they_are_spelled(column):
    for text in (
        column.name,
        column.name.upper(),
        f' "{column.name}" ',
        column.name.replace("_", " "),
        *column.aliases,
    ):
        assert canonical_name(text) == column.name


def test_units_may_stand_in_brackets():
    assert canonical_name("Time (s)") == canonical_name("time [s]") == "time_s"
    assert canonical_name("rear x [m]") == "rear_x_m"
    assert canonical_name("speed [m/s]") == "speed_mps"
    assert canonical_name("rear omega (rad/s)") == "rear_omega_radps"


@pytest.mark.parametrize("bare", ["x", "y", "z", "px", "rear_x_mm", "time_ms"])
def test_names_that_leave_a_doubt_are_not_guessed(bare):
    assert canonical_name(bare) is None


@pytest.mark.parametrize("header", [VIPER_SLOPE, LANDER])
def test_headers_of_demos_are_recognised_with_z_as_height(header):
    found = resolve(header, len(header), None)
    assert header[found.indices["rear_y_m"]] in {"z", "pz"}
    assert header[found.indices["speed_mps"]] == "vx"
    assert found.zero_start
    assert [finding.code for finding in found.findings] == ["preset", "ignored-column"]
    assert "'vy'" in found.findings[1].message  # told, not silently dropped


def test_without_a_header_a_map_by_index_is_required():
    with pytest.raises(UnusableFileError, match="0-based indices"):
        resolve(None, 5, None)
    found = resolve(None, 5, PRESETS["vehicle-python"])
    assert found.indices == {"time_s": 0, "rear_x_m": 1, "rear_y_m": 3, "rear_lateral_m": 2, "speed_mps": 4}


def test_a_map_wins_over_names_and_leaves_the_others():
    header = ["time_s", "rear_x_m", "rear_y_m", "better_x"]
    found = resolve(header, 4, ColumnMap.of({"rear_x_m": "better_x"}))
    assert found.indices == {"time_s": 0, "rear_x_m": 3, "rear_y_m": 2}


@pytest.mark.parametrize("sources", [{"rear_x_m": "absent"}, {"rear_x_m": 7}])
def test_a_map_to_a_column_that_is_not_there_is_told(sources):
    with pytest.raises(UnusableFileError, match="missing-column"):
        resolve(["time_s", "x", "rear_y_m"], 3, ColumnMap.of(sources))


@pytest.mark.parametrize(
    "value", ["no-such-preset", {"height": 1}, {"rear_x_m": -1}, {"rear_x_m": True}, {"time_s": 1.5}]
)
def test_a_map_that_says_nothing_sensible_is_refused(value):
    with pytest.raises(InvalidValueError, match="allowed is"):
        ColumnMap.of(value)


def test_a_demo_file_becomes_a_run_that_starts_at_zero(folder, make_motion):
    own = make_motion()
    rows = np.zeros((len(own["time_s"]), 16))
    rows[:, 0], rows[:, 1], rows[:, 3] = own["time_s"], own["rear_x_m"] - 2.5, own["rear_y_m"]
    rows[:, 4], rows[:, 8] = own["speed_mps"], 3.0  # the demo's `ay` is an angular velocity
    text = "\t".join(VIPER_SLOPE) + "\n" + "\n".join("\t".join(f"{v:.9g}" for v in row) for row in rows)
    folder.add("results_fixed_time_step.txt", text.encode())
    dataset, report = read_folder(folder.write())
    run = dataset.runs[0]
    np.testing.assert_allclose(run.x_m, own["rear_x_m"], atol=1e-8)
    assert set(run.columns) == {"time_s", "rear_x_m", "rear_y_m", "speed_mps", "rear_lateral_m"}
    assert [finding.code for finding in report.findings] == ["preset", "ignored-column", "mislabelled"]


def test_taking_the_demos_angular_velocity_for_speed_is_caught(folder, make_motion, as_text):
    own = make_motion()
    own["ax"] = np.full_like(own["time_s"], 2.0)
    folder.add("a.csv", as_text(own))
    folder.passport["column_map"] = {"speed_mps": "ax"}
    with pytest.raises(Exception, match="mislabelled column"):
        read_folder(folder.write())
