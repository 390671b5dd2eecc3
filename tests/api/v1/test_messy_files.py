"""A sample of the messy files over HTTP and on the command line: the report is the intake's own, word for word."""

from __future__ import annotations

import json

import pytest

from tests.cli.conftest import call
from tests.datasets.messy.clean import passport
from tests.datasets.messy.files import MessyFile, every_way
from tests.datasets.messy.oracle import judged, read

DATASETS = "/v1/admin/datasets"
SAMPLE = 60
OVER_HTTP = 20  # each one takes a process of its own
EACH = 5


def sample(count):
    """Files from all over the list."""
    ways = every_way()
    return [MessyFile(ways[at * len(ways) // count]) for at in range(count)]


def told_by(report):
    """The findings of a report in JSON, as the judge has them."""
    return tuple(
        (each["code"], each["severity"], f"{each['column'] or ''}: {each['message']}") for each in report["findings"]
    )


@pytest.mark.slow
@pytest.mark.parametrize("part", range(SAMPLE // 20))
def test_the_command_line_says_what_the_intake_says(part, tmp_path):
    (tmp_path / "passport.json").write_text(json.dumps(passport()))
    for file in sample(SAMPLE)[part * 20 : (part + 1) * 20]:
        told = read(file, tmp_path)
        assert judged(file, told).complaint is None
        (tmp_path / "upload").write_bytes(file.data)
        options = [word for name, value in file.form.items()
                   for word in (f"--{name.replace('_', '-')}", json.dumps(value))]  # fmt: skip
        said = call(
            *("datasets", "validate", tmp_path / "upload", *options),
            *("--passport", tmp_path / "passport.json", "--json"),
        )
        assert told_by(said.json) == told.findings
        assert (said.code == 0) == (not any(severity == "reject" for _, severity, _ in told.findings))


@pytest.mark.processes
@pytest.mark.slow
@pytest.mark.parametrize("part", range(OVER_HTTP // EACH))
def test_the_service_says_what_the_intake_says(part, service_with_token, tmp_path):
    for file in sample(OVER_HTTP)[part * EACH : (part + 1) * EACH]:
        form = {name: json.dumps(value) for name, value in {**file.form, "passport": passport()}.items()}
        sent = service_with_token.client.post(
            DATASETS, params={"dry_run": True}, files={"file": ("upload", file.data)}, data=form
        )
        told = read(file, tmp_path).findings
        rejections_first = sorted(told, key=lambda finding: finding[1] != "reject")
        assert told_by(sent.json()["report"]) == tuple(rejections_first)
