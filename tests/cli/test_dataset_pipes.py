"""`datasets validate` and `--passport`: what is no plain file, and how people's programs write JSON."""

from __future__ import annotations

import json
import os

import pytest

from service.cli.failures import ExitCode
from tests.cli.conftest import PASSPORT, SCENARIO, call, write_runs


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no named pipes here")
@pytest.mark.parametrize("command", ["validate", "upload"])
def test_a_pipe_is_no_file(command, tmp_path, store):
    os.mkfifo(tmp_path / "pipe")
    more = ("--store", store, "--name", "x") if command == "upload" else ()
    refused = call("datasets", command, tmp_path / "pipe", *more)
    assert refused.code == ExitCode.USAGE
    assert "pipe" in refused.error


@pytest.mark.parametrize("coding", ["utf-16", "utf-8-sig"])
def test_a_passport_of_powershell_is_read(coding, tmp_path):
    folder = write_runs(tmp_path / "runs")
    (tmp_path / "p.json").write_bytes(json.dumps(PASSPORT).encode(coding))
    file = folder / "runs" / "s22.csv.gz"
    assert call("datasets", "validate", file, *SCENARIO, "--passport", tmp_path / "p.json").code == 0


def test_a_passport_in_another_coding_is_told(tmp_path):
    folder = write_runs(tmp_path / "runs")
    (tmp_path / "p.json").write_bytes(json.dumps(PASSPORT | {"title": "ü"}, ensure_ascii=False).encode("latin-1"))
    refused = call("datasets", "validate", folder / "runs" / "s22.csv.gz", *SCENARIO, "--passport", tmp_path / "p.json")
    assert refused.code == ExitCode.USAGE
    assert "UTF-8" in refused.error
