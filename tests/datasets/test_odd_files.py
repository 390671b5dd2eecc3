"""Files that the world has and honest programs rarely write: each is read, or its finding says what to do."""

from __future__ import annotations

import io
import json
import os
import subprocess
import tarfile
import zipfile

import pyarrow as pa
import pytest
from pyarrow import parquet as pq

from service.datasets import RejectedDatasetError, parse_passport, read_folder, to_parquet
from service.datasets.checks.validate import check_passport
from service.datasets.readers.sniff import Kind, kind_of
from service.datasets.uploads.upload import read_upload
from service.datasets.uploads.upload_form import UploadForm
from service.errors import DatasetError
from tests.datasets.conftest import PASSPORT, chrono_text, motion

TABLE = b"file,set,slope_deg,mass_kg,torque_nm,horizon_s\nruns/one.csv,a,20,430,60,10\n"
FILES = {"runs.csv": TABLE, "passport.json": json.dumps(PASSPORT).encode(), "runs/one.csv": chrono_text(motion())}


def sent(tmp_path, data):
    source, workspace = tmp_path / "sent", tmp_path / "work"
    source.write_bytes(data)
    workspace.mkdir()
    try:
        dataset, report = read_upload(source, filename="sent", workspace=workspace, form=UploadForm())
    except RejectedDatasetError as error:
        return [], [(each.code, each.message) for each in error.report.findings]
    return [run.name for run in dataset.runs], [(each.code, each.message) for each in report.findings]


def tar_of(files, kind=tarfile.USTAR_FORMAT):
    sink = io.BytesIO()
    with tarfile.open(fileobj=sink, mode="w", format=kind) as archive:
        for name, content in files.items():
            info = tarfile.TarInfo(name)
            info.size = len(content)
            archive.addfile(info, io.BytesIO(content))
    return sink.getvalue()


def zip_of(files):
    sink = io.BytesIO()
    with zipfile.ZipFile(sink, "w") as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return sink.getvalue()


def parquet_of(columns):
    sink = io.BytesIO()
    pq.write_table(pa.table(columns), sink)
    return sink.getvalue()


@pytest.mark.parametrize("target", ["loop.csv", "other.csv"])
def test_a_link_to_itself_is_a_finding(target, folder):
    folder.add("runs/good.csv", motion()).add("runs/loop.csv", slope=21)
    (folder.path / "runs" / "loop.csv").symlink_to(target)
    if target == "other.csv":
        (folder.path / "runs" / "other.csv").symlink_to("loop.csv")
    dataset, report = read_folder(folder.write())
    assert [run.name for run in dataset.runs] == ["good"]
    assert ("runs/loop.csv", "link") in [(each.file, each.code) for each in report.rejections]


def test_a_name_longer_than_the_system_has_is_a_finding(folder):
    folder.add("runs/good.csv", motion()).add(f"runs/{'x' * 300}.csv", slope=21)
    dataset, report = read_folder(folder.write())
    assert len(dataset.runs) == len(report.rejections) == 1


@pytest.mark.parametrize("coding", ["utf-16", "utf-8-sig", "utf-8"])
def test_a_passport_is_read_as_powershell_and_windows_write_it(coding, folder):
    folder.add("runs/good.csv", motion()).write()
    text = json.dumps(PASSPORT | {"title": "Hügel"}, ensure_ascii=False)
    (folder.path / "passport.json").write_bytes(text.encode(coding))
    assert read_folder(folder.path)[0].passport.title == "Hügel"


def test_a_passport_in_another_coding_is_told_which_one_is_expected():
    with pytest.raises(DatasetError, match=r"save it as UTF-8"):
        parse_passport(json.dumps(PASSPORT | {"title": "ü"}, ensure_ascii=False).encode("latin-1"))


def test_runs_in_parquet_may_be_listed(folder):
    folder.add("runs/one.csv", motion()).add("runs/two.parquet", parquet_of(motion(1.1)), slope=21)
    dataset, _ = read_folder(folder.write(), strict=True)
    assert [run.name for run in dataset.runs] == ["one", "two"]
    (folder.path / "runs" / "two.parquet").write_bytes(chrono_text(motion(1.1)))
    as_text, _ = read_folder(folder.path, strict=True)
    assert as_text.runs[1].x_m == pytest.approx(dataset.runs[1].x_m, abs=1e-7)


def test_runs_in_parquet_may_be_listed_in_an_archive(tmp_path):
    files = FILES | {
        "runs/two.parquet": parquet_of(motion(1.1)),
        "runs.csv": TABLE + b"runs/two.parquet,a,21,430,60,10\n",
    }
    assert sent(tmp_path, tar_of(files))[0] == ["one", "two"]


@pytest.mark.parametrize("content", [b"PAR1 and no more", b"PAR1" + b"\xff" * 100 + b"PAR1"])
def test_broken_parquet_in_a_folder_is_a_finding(content, folder):
    folder.add("runs/good.csv", motion()).add("runs/two.parquet", content, slope=21)
    dataset, report = read_folder(folder.write())
    assert len(dataset.runs) == 1
    assert [each.code for each in report.rejections] == ["broken-parquet"]


def test_a_whole_dataset_is_no_run_of_a_folder(folder):
    folder.add("runs/good.csv", motion())
    whole = to_parquet(read_folder(folder.write())[0])
    folder.add("runs/two.parquet", whole, slope=21).write()
    (rejected,) = read_folder(folder.path)[1].rejections
    assert "upload it alone" in rejected.message


@pytest.mark.parametrize("pack", [tar_of, zip_of])
def test_several_archives_in_one_file_are_told(pack, tmp_path):
    names, findings = sent(tmp_path, pack(FILES) + pack(FILES))
    assert names == ["one"]
    assert [message for code, message in findings if code == "unlisted-file" and "several archives" in message]


@pytest.mark.parametrize("pack", [tar_of, zip_of])
def test_one_archive_is_one(pack, tmp_path):
    assert sent(tmp_path, pack(FILES)) == (["one"], [])


def _by_tar(tmp_path, *options):
    for name, content in FILES.items():
        target = tmp_path / "files" / name
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(content)
    if "-S" in options:
        with (tmp_path / "files" / "runs" / "one.csv").open("ab") as stream:
            stream.truncate(1 << 20)
    command = ["tar", *options, "-cf", str(tmp_path / "made.tar"), "-C", str(tmp_path / "files"), "."]
    if subprocess.run(command, check=False, capture_output=True).returncode:
        pytest.skip("this tar is not GNU tar")
    return (tmp_path / "made.tar").read_bytes()


@pytest.mark.processes
@pytest.mark.parametrize("options", [("--format=v7",), ("-V", "label"), ("--format=gnu",)])
def test_old_tars_and_labelled_ones_are_read(options, tmp_path):
    assert sent(tmp_path, _by_tar(tmp_path, *options)) == (["one"], [])


@pytest.mark.processes
def test_a_sparse_member_has_a_remedy(tmp_path):
    _, findings = sent(tmp_path, _by_tar(tmp_path, "-S"))
    assert "sparse" in findings[0][1]


def test_a_sum_that_is_wrong_makes_no_tar():
    head = bytearray(tar_of(FILES)[:520])
    head[257:262] = b"\0" * 5
    assert kind_of(bytes(head)) is Kind.TEXT
    head[148:156] = b"%06o\0 " % (sum(head[:512]) - sum(head[148:156]) + 8 * 32)
    assert kind_of(bytes(head)) is Kind.TAR


@pytest.mark.parametrize(
    ("typed", "meant"), [("alignement", "alignment"), ("column_maps", "column_map"), ("Soil", "soil")]
)
def test_a_misspelt_field_of_a_passport_is_told(typed, meant):
    content = {name: value for name, value in PASSPORT.items() if name != meant} | {typed: {}}
    (found,) = check_passport(parse_passport(json.dumps(content).encode()))
    assert (found.code, found.column, found.rejects) == ("passport", typed, False)
    assert typed in found.message
    assert meant in found.message


@pytest.mark.parametrize("name", ["notes", "author", "chrono_version", "solver", "step_s", "date"])
def test_fields_of_its_own_are_no_mistake(name):
    assert list(check_passport(parse_passport(json.dumps(PASSPORT | {name: 1}).encode()))) == []


@pytest.mark.timeout(20)
@pytest.mark.parametrize("name", ["runs.csv", "passport.json"])
def test_a_pipe_in_a_folder_is_not_waited_for(name, tmp_path):
    for other, data in FILES.items():
        if other != name:
            (tmp_path / other).parent.mkdir(exist_ok=True)
            (tmp_path / other).write_bytes(data)
    os.mkfifo(tmp_path / name)

    with pytest.raises(DatasetError, match=f"{name} in the dataset's folder is no plain file"):
        read_folder(tmp_path)
