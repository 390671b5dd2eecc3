"""What the programs of Project Chrono write is read as what it is, or refused with the reason and the remedy."""

from __future__ import annotations

import gzip
import io
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet as pq

from service.cli.commands.datasets import Columns
from service.datasets import PRESETS, RejectedDatasetError, read_folder
from service.datasets.readers.presets import DEMOS, SILENT
from service.datasets.uploads.upload import read_upload
from service.datasets.uploads.upload_form import UploadForm
from tests.datasets import chrono_demos as demos
from tests.datasets.conftest import PASSPORT
from tests.datasets.hostile_files import zipped

SEEN = {
    "chrono-viper-slope": demos.viper_slope,
    "chrono-fsi-body": demos.fsi_body,
    "chrono-viper-sph": demos.viper_sph,
    "chrono-tracked": demos.tracked,
    "lander": demos.lander,
}
NAMED = {
    "vehicle-python": demos.vehicle,
    "chrono-single-wheel": demos.single_wheel,
    "chrono-viper-sph-position": demos.viper_sph_position,
    "chrono-cosim-rover": demos.cosim_rover,
    "chrono-cosim-wheel": demos.cosim_wheel,
}
WITHOUT_POSITION = {
    "demo_ROBOT_Viper_SCM": demos.scm_torques,
    "demo_ROBOT_Curiosity_SCM": lambda: demos.scm_torques(6),
    "demo_ROBOT_Viper_WheelSlope_CRM": demos.drawbar,
    "demo_FSI_SingleWheelTest": lambda: demos.drawbar(header=""),
    "Chrono::FSI": demos.particles,
}


def read(tmp_path, data, filename="run.dat", **form):
    path, workspace = tmp_path / "stored", tmp_path / "workspace"
    path.write_bytes(data)
    workspace.mkdir()
    return read_upload(path, filename=filename, workspace=workspace, form=UploadForm(**demos.SCENARIO | form))


def refused(tmp_path, data, **form):
    with pytest.raises(RejectedDatasetError) as caught:
        read(tmp_path, data, **form)
    return caught.value.report


def of_code(report, code):
    return [finding for finding in report.findings if finding.code == code]


def assert_is_the_run(run, real, digits=2e-5):
    """Positions along and normal to the slope as Chrono computed them, from the first row on, but for the height."""
    np.testing.assert_allclose(run.time_s, real.time, atol=digits)
    np.testing.assert_allclose(run.x_m, real.position[:, 0], atol=digits)
    np.testing.assert_allclose(run.y_m - run.y_m[0], real.position[:, 2] - real.position[0, 2], atol=digits)
    if "speed_mps" in run.columns:
        np.testing.assert_allclose(run.columns["speed_mps"], real.velocity[:, 0], atol=digits)


def columns_of(data):
    """Name -> cells of a file with tabs."""
    header, *rows = (line.split("\t") for line in data.decode().splitlines())
    return dict(zip(header, zip(*rows, strict=True), strict=True))


def as_csv(*tables):
    """The tables, each name -> cells, below each other."""
    rows = [",".join(row) for table in tables for row in zip(*table.values(), strict=True)]
    return "\n".join([",".join(tables[0]), *rows]).encode()


def test_every_preset_has_a_file_here():
    assert {*SEEN, *NAMED} == set(DEMOS) == set(PRESETS) - {"rover-twin"}


@pytest.mark.parametrize("preset", SEEN)
def test_a_header_names_its_preset_and_the_report_says_which_column_is_which(preset, tmp_path):
    dataset, report = read(tmp_path, SEEN[preset]())
    assert report.rejections == ()
    assert_is_the_run(dataset.runs[0], demos.fixed_step())
    (told,) = of_code(report, "preset")
    assert f"the preset {preset}: written by {DEMOS[preset].program}" in told.message
    for name in ("time_s", "rear_x_m", "rear_y_m", "rear_lateral_m", "speed_mps"):
        assert f"{name} is '" in told.message
    (unused,) = of_code(report, "ignored-column")
    assert "'vy'" in unused.message.lower()


@pytest.mark.parametrize("preset", NAMED)
def test_without_a_header_a_preset_is_suggested_never_chosen(preset, tmp_path):
    report = refused(tmp_path, NAMED[preset]())
    assert f"column_map={preset}" in report.rejections[0].message
    assert report.accepted == ()
    (tmp_path / "named").mkdir()
    dataset, report = read(tmp_path / "named", NAMED[preset](), column_map=preset)
    assert report.rejections == ()
    assert_is_the_run(dataset.runs[0], demos.fixed_step())
    (told,) = of_code(report, "preset")
    assert told.message.startswith(f"read by the preset {preset}: written by {DEMOS[preset].program}; time_s is #0")


def test_what_c_plus_plus_and_python_write_of_one_demo_is_the_same_run(tmp_path):
    dataset, _ = read(tmp_path, demos.vehicle_python(), column_map="vehicle-python")
    assert_is_the_run(dataset.runs[0], demos.fixed_step(), digits=1e-6)


@pytest.mark.parametrize("program", WITHOUT_POSITION)
def test_files_without_position_are_refused_with_what_to_write_as_well(program, tmp_path):
    report = refused(tmp_path, WITHOUT_POSITION[program]())
    assert any(
        program in finding.message and "have no position" in finding.message and ("write csv" in finding.message
                                                                                  or "; take " in finding.message)
        for finding in report.rejections
    )  # fmt: skip
    assert "column_map=" not in report.rejections[0].message


def test_the_line_that_is_asked_for_is_enough(tmp_path):
    dataset, report = read(tmp_path, demos.scm_with_position())
    assert [finding.code for finding in report.findings] == ["default-passport"]
    assert_is_the_run(dataset.runs[0], demos.fixed_step())


def test_forces_are_not_taken_for_a_position_where_a_preset_is_named(tmp_path):
    assert refused(tmp_path, demos.scm_torques(), column_map="vehicle-python").accepted == ()


def test_a_variable_step_is_accepted_and_its_range_told(tmp_path):
    real = demos.variable_step()
    dataset, report = read(tmp_path, demos.viper_slope(real))
    assert_is_the_run(dataset.runs[0], real)
    (told,) = of_code(report, "step")
    assert "from 0.001 to 0.02 s" in told.message


def test_a_fixed_step_is_not_called_variable_whatever_its_digits(tmp_path):
    _, report = read(tmp_path, demos.viper_slope(demos.fixed_step(every_s=0.0005)))
    assert of_code(report, "step") == []


def test_angular_velocity_under_the_name_of_acceleration_is_found_by_differences(tmp_path):
    _, report = read(tmp_path, demos.viper_slope())
    (told,) = of_code(report, "mislabelled")
    assert (told.column, told.severity) == ("ax, ay, az", "warn")
    assert "hold no accelerations" in told.message
    assert "angular velocity" in told.message


@pytest.mark.parametrize("variable", [False, True])
def test_a_mended_demo_is_not_accused(variable, tmp_path):
    real = demos.variable_step() if variable else demos.fixed_step()
    _, report = read(tmp_path, demos.viper_slope(real, mended=True))
    (told,) = of_code(report, "mislabelled")
    assert told.message.startswith("do hold accelerations")


def test_true_accelerations_of_another_demo_are_not_worth_a_word(tmp_path):
    _, report = read(tmp_path, demos.tracked())
    assert of_code(report, "mislabelled") == []


@pytest.mark.parametrize(
    ("right", "wrong"),
    [("\ty\tz", "\tz\ty"), ("vy\tvz", "vz\tvy"), ("\tx\ty\tz", "\tz\ty\tx"), ("vx\tvy\tvz", "vz\tvy\tvx")],
    ids=["y and z", "vy and vz", "x and z", "vx and vz"],
)
def test_exchanged_names_are_refused_by_what_the_numbers_say(right, wrong, tmp_path):
    header = demos.SLOPE_HEADER.replace(right, wrong, 1)
    assert header != demos.SLOPE_HEADER
    report = refused(tmp_path, demos.viper_slope(header=header))
    assert len([finding for finding in of_code(report, "mislabelled") if finding.rejects]) == 2


def test_columns_in_another_order_with_their_names_are_the_same_run(tmp_path):
    columns = columns_of(demos.viper_slope())
    dataset, _ = read(tmp_path, as_csv({name: columns[name] for name in sorted(columns, reverse=True)}))
    assert_is_the_run(dataset.runs[0], demos.fixed_step())


@pytest.mark.parametrize(
    ("was", "became", "remedy"),
    [("az", "alpha", "column_map=chrono-viper-slope"), ("vx", "v", '"rear_y_m": "z"'), ("\tx\t", "\tx [mm]\t", "'x'")],
)
def test_a_renamed_column_is_named_with_what_to_pass(was, became, remedy, tmp_path):
    data = demos.viper_slope(header=demos.SLOPE_HEADER.replace(was, became, 1))
    report = refused(tmp_path, data)
    assert "close to that of the preset chrono-viper-slope" in report.rejections[0].message
    assert remedy in report.rejections[0].message


def test_a_renamed_column_that_nobody_needs_is_no_hindrance_to_a_named_preset(tmp_path):
    data = demos.viper_slope(header=demos.SLOPE_HEADER.replace("az", "alpha"))
    dataset, _ = read(tmp_path, data, column_map="chrono-viper-slope")
    assert_is_the_run(dataset.runs[0], demos.fixed_step())


@pytest.mark.parametrize(
    "spell",
    [str.upper, lambda text: text + "\t", lambda text: "\t".join(f'"{name}"' for name in text.split("\t")),
     lambda text: text.replace("time", "Time [s]").replace("\tx\t", "\tX (m)\t").replace("vx", "Vx [m/s]"),
     lambda text: text.replace("\t", ","), lambda text: "# " + text.replace("\t", " ")],
    ids=["upper case", "trailing tab", "quotes", "units", "commas", "comment"],
)  # fmt: skip
def test_a_header_is_known_however_it_is_spelled(spell, tmp_path):
    dataset, report = read(tmp_path, demos.viper_slope(header=spell(demos.SLOPE_HEADER)))
    assert_is_the_run(dataset.runs[0], demos.fixed_step())
    assert len(of_code(report, "preset")) == 1


def test_a_file_that_pandas_saved_again_is_still_known(tmp_path):
    columns = columns_of(demos.viper_slope())
    dataset, report = read(tmp_path, as_csv({"": map(str, range(1001)), **columns}))
    assert_is_the_run(dataset.runs[0], demos.fixed_step())
    assert len(of_code(report, "preset")) == 1


def test_gzip_makes_no_difference(tmp_path):
    dataset, _ = read(tmp_path, gzip.compress(demos.viper_slope()))
    assert_is_the_run(dataset.runs[0], demos.fixed_step())


def test_alone_in_an_archive_or_listed_there_or_in_a_folder(tmp_path):
    table = (
        b"file,slope_deg,mass_kg,torque_nm\n7/results_fixed_time_step.txt,28,430,60\n8/FSI_body2.csv.gz,28,430,60.1\n"
    )
    files = {
        "runs.csv": table,
        "7/results_fixed_time_step.txt": demos.viper_slope(),
        "8/FSI_body2.csv.gz": gzip.compress(demos.fsi_body()),
    }
    for number, data in enumerate([zipped({"results.txt": demos.viper_slope()}), zipped(files)]):
        (tmp_path / str(number)).mkdir()
        dataset, report = read(tmp_path / str(number), data)
        assert report.rejections == ()
        assert len(of_code(report, "preset")) == len(dataset.runs) == number + 1
        for run in dataset.runs:
            assert_is_the_run(run, demos.fixed_step())
    for name, content in files.items():
        (tmp_path / "folder" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "folder" / name).write_bytes(content)
    again, _ = read_folder(tmp_path / "folder")
    np.testing.assert_array_equal(again.runs[0].x_m, dataset.runs[0].x_m)


def test_runs_of_a_demo_in_one_long_table(tmp_path):
    every = {"a": demos.fixed_step(), "b": demos.variable_step()}
    tables = []
    for name, real in every.items():
        labels = {"run": name, "slope_deg": "28", "mass_kg": "430", "torque_nm": "60" if name == "a" else "60.1"}
        repeated = {label: [value] * len(real.time) for label, value in labels.items()}
        tables.append(columns_of(demos.viper_slope(real)) | repeated)
    dataset, report = read(tmp_path, as_csv(*tables), slope_deg=None, mass_kg=None, torque_nm=None)
    assert report.rejections == ()
    for run, real in zip(dataset.runs, every.values(), strict=True):
        assert_is_the_run(run, real)
    assert len(of_code(report, "preset")) == 1
    assert [finding.file for finding in of_code(report, "mislabelled")] == ["run.dat#a", "run.dat#b"]


def test_parquet_with_the_names_of_a_demo(tmp_path):
    sink = io.BytesIO()
    columns = {name: [float(cell) for cell in cells] for name, cells in columns_of(demos.viper_slope()).items()}
    pq.write_table(pa.table(columns), sink)
    dataset, report = read(tmp_path, sink.getvalue())
    assert_is_the_run(dataset.runs[0], demos.fixed_step())
    assert [len(of_code(report, code)) for code in ("preset", "mislabelled")] == [1, 1]


def test_a_preset_may_stand_in_the_passport(tmp_path):
    dataset, _ = read(tmp_path, demos.vehicle(), passport=PASSPORT | {"column_map": "vehicle-python"})
    assert_is_the_run(dataset.runs[0], demos.fixed_step())


def test_columns_that_are_only_looked_at_may_hold_anything(tmp_path):
    columns = columns_of(demos.viper_slope()) | {"ax": ["?"] * 1001, "vy": [""] * 1001}
    dataset, report = read(tmp_path, as_csv(columns))
    assert report.rejections == ()
    assert_is_the_run(dataset.runs[0], demos.fixed_step())


def test_no_two_kinds_share_a_header():
    headers = [tuple(sorted(each.header)) for each in (*DEMOS.values(), *SILENT) if each.header]
    assert len(set(headers)) == len(headers)
    assert all(each.width == len(each.header) for each in (*DEMOS.values(), *SILENT) if each.header)


@pytest.mark.parametrize("value", [1e300, -1e300, 1e12, float("nan"), float("inf"), 0.0])
@pytest.mark.parametrize("place", range(7))
@pytest.mark.parametrize("header", [demos.SLOPE_HEADER, ""], ids=["header", "none"])
def test_absurd_numbers_anywhere_are_refused_or_read_and_never_break_the_comparison(header, place, value, tmp_path):
    rows = [line.split(b"\t") for line in demos.viper_slope(demos.fixed_step(every_s=0.05), header="").splitlines()]
    rows[-1][place] = repr(value).encode()
    text = b"\n".join([*([header.encode()] if header else []), *(b"\t".join(row) for row in rows)])
    try:
        dataset, _ = read(tmp_path, text)
    except RejectedDatasetError:
        return
    assert place > 0
    assert header
    assert len(dataset.runs) == 1


def test_every_preset_stands_in_the_documentation_and_those_to_be_named_in_the_help():
    page = (Path(__file__).parents[2] / "docs" / "training.md").read_text()
    assert [name for name in DEMOS if f"`{name}`" not in page] == []
    assert [name for name in NAMED if name not in str(Columns.__metadata__[0].help)] == []
