"""What an archive leaves on the disk: the plain files it names, and nothing else."""

from __future__ import annotations

import stat
import tarfile
import zipfile

import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.datasets.file_names import folded, name_fault, shown, upload_name
from service.datasets.findings import UnusableFileError
from service.datasets.readers.sniff import Kind
from service.datasets.uploads.archive import unpack_archive
from service.datasets.uploads.unpacking import Meter
from service.datasets.uploads.upload_form import UploadLimits
from tests.datasets.hostile_files import tarred, zipped

MEMBERS = {"runs.csv": b"file\n", "runs/one.csv": b"1,2,3\n", "runs/ä ö.csv": b"4,5,6\n", "empty.csv": b""}
LIMITS = UploadLimits()


def unpack(tmp_path, data, kind):
    source, target = tmp_path / "archive", tmp_path / "target"
    source.write_bytes(data)
    target.mkdir()
    meter = Meter(LIMITS, len(data), "archive")
    unpack_archive(source, kind, target, file="archive", limits=LIMITS, meter=meter)
    return {each.relative_to(target).as_posix(): each.read_bytes() for each in target.rglob("*") if each.is_file()}


@pytest.mark.parametrize(("pack", "kind"), [(zipped, Kind.ZIP), (tarred, Kind.TAR)], ids=["zip", "tar"])
def test_files_come_out_as_they_went_in(pack, kind, tmp_path):
    assert unpack(tmp_path, pack(MEMBERS), kind) == MEMBERS


@pytest.mark.parametrize(("pack", "kind"), [(zipped, Kind.ZIP), (tarred, Kind.TAR)], ids=["zip", "tar"])
def test_what_desktops_add_is_left_out(pack, kind, tmp_path):
    extra = {"__MACOSX/._runs.csv": b"x", ".DS_Store": b"x", "runs/._one.csv": b"x", "Thumbs.db": b"x"}
    assert unpack(tmp_path, pack({**MEMBERS, **extra}), kind) == MEMBERS


@pytest.mark.parametrize("method", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2])
def test_usual_methods_of_zip_are_read(method, tmp_path):
    assert unpack(tmp_path, zipped(MEMBERS, method=method), Kind.ZIP) == MEMBERS


def test_modes_and_owners_of_the_archive_do_not_count(tmp_path):
    info = tarfile.TarInfo("run.sh")
    info.mode, info.uid, info.uname = 0o6777, 0, "root"
    unpack(tmp_path, tarred({}, info), Kind.TAR)
    written = (tmp_path / "target" / "run.sh").stat().st_mode
    assert not written & (stat.S_ISUID | stat.S_ISGID | stat.S_IXUSR)


def test_all_faults_are_told_at_once_up_to_a_bound(tmp_path):
    members = {f"../{index}.csv": b"" for index in range(50)}
    with pytest.raises(UnusableFileError) as caught:
        unpack(tmp_path, tarred(members), Kind.TAR)
    assert len(caught.value.findings) == 20


def test_a_member_with_a_fault_keeps_the_later_ones_from_being_written(tmp_path):
    with pytest.raises(UnusableFileError):
        unpack(tmp_path, tarred({"first.csv": b"1", "../x": b"2", "last.csv": b"3"}), Kind.TAR)
    assert [each.name for each in (tmp_path / "target").iterdir()] == ["first.csv"]


@given(st.text(max_size=40))
def test_a_name_without_fault_stays_inside_and_is_printable(name):
    if name_fault(name, path_length=512, depth=16) is None:
        parts = name.split("/")
        assert ".." not in parts
        assert not name.startswith("/")
        assert "\\" not in name
        assert "\0" not in name
        name.encode()


@given(st.text(max_size=300))
def test_shown_names_are_printable_short_and_text(name):
    for text in (shown(name), upload_name(name)):
        assert text.isprintable()
        assert len(text) <= 200
        text.encode()
    assert upload_name(name)


@pytest.mark.parametrize(("one", "other"), [("A/b", "a/B"), ("a//b", "a/b"), ("./a", "a"), ("e\u0301", "é")])
def test_names_that_some_file_system_takes_for_one_are_one(one, other):
    assert folded(one) == folded(other)
