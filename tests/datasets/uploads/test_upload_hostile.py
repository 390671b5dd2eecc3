"""Every file of the table gets its answer: a reason with a place, soon, and nothing written outside the workspace."""

from __future__ import annotations

import json
import time

import pytest

from service.datasets import RejectedDatasetError
from service.datasets.uploads.upload import read_upload
from service.datasets.uploads.upload_form import UploadForm
from tests.datasets.hostile_files import HOSTILE_FILES

SLOW = ("tar.gz: 11,001 members",)


def test_names_are_distinct_and_there_are_enough():
    assert len({each.name for each in HOSTILE_FILES}) == len(HOSTILE_FILES) >= 40
    assert len({each.code for each in HOSTILE_FILES}) >= 30


@pytest.mark.parametrize(
    "hostile",
    [pytest.param(each, id=each.name, marks=[pytest.mark.slow] if each.name in SLOW else []) for each in HOSTILE_FILES],
)
def test_it_is_rejected_with_its_reason(hostile, tmp_path):
    path, workspace = tmp_path / "stored", tmp_path / "workspace"
    path.write_bytes(hostile.build())
    workspace.mkdir()
    begun = time.process_time()
    with pytest.raises(RejectedDatasetError) as caught:
        read_upload(path, filename=hostile.filename, workspace=workspace, form=UploadForm(**hostile.form))
    assert time.process_time() - begun < 20
    report = caught.value.report
    assert hostile.code in {finding.code for finding in report.rejections}
    assert report.accepted == ()
    assert report.summary is None
    json.dumps(report.as_json(), allow_nan=False).encode()
    for finding in report.findings:
        assert finding.file.isprintable()
        assert finding.message.isprintable()
        assert len(finding.message) < 1500
    assert {each.name for each in tmp_path.iterdir()} == {"stored", "workspace"}
    assert sum(each.stat().st_size for each in workspace.rglob("*")) < 40 << 20
    assert not any(each.is_symlink() for each in workspace.rglob("*"))
