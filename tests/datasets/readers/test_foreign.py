"""Files of other programs are refused by what they are, with what to do, wherever they stand."""

from __future__ import annotations

import gzip

import pytest

from service.datasets import RejectedDatasetError, read_folder
from service.datasets.readers.foreign import FORMATS, format_of
from service.datasets.readers.sniff import kind_of
from tests.datasets.foreign_files import FOREIGN, hdf5
from tests.datasets.hostile_files import honest, tarred, zipped
from tests.datasets.test_chrono_demos import read, refused

TABLE = b"file,slope_deg,mass_kg,torque_nm\nrun.csv,20,430,60\nother,20,430,60.1\n"


def ways(data):
    """The same bytes alone, packed, alone in an archive, one of several there, and listed by runs.csv."""
    return {
        "alone": data,
        "gzip": gzip.compress(data),
        "zip": zipped({"other": data}),
        "tar": tarred({"other": data}),
        "one of two": zipped({"other": data, "another": data}),
        "gzip in a zip": zipped({"other.gz": gzip.compress(data)}),
    }


@pytest.mark.parametrize("what", FOREIGN)
def test_a_file_of_another_program_is_named_with_a_remedy(what, tmp_path):
    form = format_of(FOREIGN[what][:520])
    assert what in form.what
    for way, data in ways(FOREIGN[what]).items():
        (tmp_path / way).mkdir()
        report = refused(tmp_path / way, data)
        assert {finding.code for finding in report.rejections} == {"unsupported-format"}, way
        assert form.what in report.rejections[0].message
        assert report.rejections[0].message.endswith(form.remedy)


@pytest.mark.parametrize("what", FOREIGN)
def test_it_does_not_keep_others_out_where_runs_csv_lists_it(what, tmp_path):
    members = honest({"other": FOREIGN[what]}, table=TABLE)
    (tmp_path / "zip").mkdir()
    for name, content in members.items():
        (tmp_path / name).write_bytes(content)
    for dataset, report in (read(tmp_path / "zip", zipped(members)), read_folder(tmp_path)):
        assert [run.name for run in dataset.runs] == ["run"]
        (rejection,) = report.rejections
        assert (rejection.file, rejection.code) == ("other", "unsupported-format")
        assert format_of(FOREIGN[what][:520]).what in rejection.message


def test_the_remedy_for_hdf5_names_the_page(tmp_path):
    report = refused(tmp_path, hdf5())
    assert "docs/training.md" in report.rejections[0].message


def test_a_tar_whose_first_file_is_foreign_is_a_tar():
    assert kind_of(tarred({"other": hdf5(), "run.csv": b"0"})[:520]) == "tar"


def test_every_format_says_what_to_do_and_none_hides_another():
    for at, each in enumerate(FORMATS):
        assert each.remedy
        for magic in each.magic:
            head = bytes(each.at)[len(each.within) :]
            assert format_of(each.within + head + magic + bytes(64)) is FORMATS[at]


def test_text_that_only_looks_a_little_like_them_is_text():
    for line in (
        b"time,x,y\n",
        b"Number,x\n",
        b"=====\n0,1\n",
        b"Result,x\n",
        b"# vtk\n",
        b"# ROS\n0 1 2\n",
        b"Feature,x\n",
    ):
        assert format_of(line) is None


def test_a_workbook_among_runs_in_a_zip_is_not_called_an_archive(tmp_path):
    book = FOREIGN["a workbook or another document of Office"]
    with pytest.raises(RejectedDatasetError, match="save each sheet as CSV"):
        read(tmp_path, zipped(honest({"run.csv": book})))
