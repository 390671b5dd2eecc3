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
EACH = 5


def sample():
    """Files from all over the list."""
    ways = every_way()
    return [MessyFile(ways[at * len(ways) // SAMPLE]) for at in range(SAMPLE)]


@pytest.mark.processes
@pytest.mark.slow
@pytest.mark.parametrize("part", range(SAMPLE // EACH))
def test_every_way_in_says_the_same(part, service_with_token, tmp_path):
    for file in sample()[part * EACH : (part + 1) * EACH]:
        told = read(file, tmp_path)
        assert judged(file, told).complaint is None
        form = {name: json.dumps(value) for name, value in {**file.form, "passport": passport()}.items()}
        sent = service_with_token.client.post(
            DATASETS, params={"dry_run": True}, files={"file": ("upload", file.data)}, data=form
        ).json()["report"]
        assert tuple((each["code"], each["severity"], f"{each['column'] or ''}: {each['message']}")
                     for each in sent["findings"]) == told.findings  # fmt: skip

        (tmp_path / "upload").write_bytes(file.data)
        (tmp_path / "passport.json").write_text(json.dumps(passport()))
        options = [word for name, value in file.form.items()
                   for word in (f"--{name.replace('_', '-')}", json.dumps(value))]  # fmt: skip
        said = call(
            "datasets", "validate", tmp_path / "upload", *options, "--passport", tmp_path / "passport.json", "--json"
        )
        assert {name: said.json[name] for name in ("accepted", "rejected", "findings")} == {
            name: sent[name] for name in ("accepted", "rejected", "findings")
        }
        assert (said.code == 0) == (not any(each["severity"] == "reject" for each in sent["findings"]))
