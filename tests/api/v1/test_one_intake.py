"""Over HTTP and on the command line the same file gets the same report."""

from __future__ import annotations

import json
import re

import pytest

from tests.cli.conftest import call
from tests.datasets import chrono_demos
from tests.datasets.field_cases import COMMA, WAYS
from tests.datasets.foreign_files import hdf5
from tests.datasets.test_field_cases import archive, long_table, packed, table

DATASETS = "/v1/admin/datasets"
SCENARIO = {"slope_deg": "28", "mass_kg": "430", "torque_nm": "60"}
BY_NAME = {way.name: way.write for way in WAYS}

FILES = {
    "aligned": (BY_NAME["aligned to the right"](*table()), SCENARIO),
    "comments": (BY_NAME["comments between the rows"](*table()), SCENARIO),
    "unused texts over several lines": (BY_NAME["texts over several lines"](*table()), SCENARIO),
    "R": (BY_NAME["R, write.table"](*long_table()), {}),
    "backslashes": (packed(archive(COMMA(*table())) | {"runs\\x.csv": b"1"}, system=0), {}),
    "other fields": (COMMA(*long_table()), {"slope_deg": "3"}),
    "two slopes": (COMMA([*long_table()[0], "Slope (deg)"], [[*row, "1"] for row in long_table()[1]]), {}),
    "a demo of Chrono": (chrono_demos.viper_slope(), SCENARIO),
    "a demo without position": (chrono_demos.scm_torques(), SCENARIO),
    "HDF5": (hdf5(), SCENARIO),
    "not a number": (COMMA(table()[0], [*table()[1], ["0", "1", "x", "2"]]), SCENARIO),
}


@pytest.mark.processes
@pytest.mark.parametrize("name", FILES)
def test_the_command_line_says_what_the_service_says(name, service_with_token, tmp_path):
    data, form = FILES[name]
    sent = service_with_token.client.post(
        DATASETS, params={"dry_run": True}, files={"file": ("my.dat", data)}, data=form
    )
    (tmp_path / "my.dat").write_bytes(data)
    (tmp_path / "store").mkdir()
    options = [word for field, value in form.items() for word in (f"--{field.replace('_', '-')}", value)]
    told = call("datasets", "upload", tmp_path / "my.dat", "--dry-run", *options, "--store", tmp_path / "store")

    report = sent.json()["report"]
    assert (told.code == 0) == (sent.status_code == 200), told.err
    lines = [re.sub(r"^(rejected|note): ", "", line) for line in told.err.splitlines() if line[:4] in ("note", "reje")]
    for finding in report["findings"]:
        assert any(finding["message"] in line and f"[{finding['code']}]" in line for line in lines), told.err
    assert len(lines) == len(report["findings"])
    if sent.status_code == 200:
        assert json.dumps(sent.json()["id"])[1:-1] in told.out
