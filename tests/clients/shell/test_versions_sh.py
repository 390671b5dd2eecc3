"""The shell script for versions against a real service: what it prints, and how it exits."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.api.conftest import TOKEN, Running

SCRIPT = Path(__file__).parents[3] / "clients" / "curl" / "versions.sh"
pytestmark = [
    pytest.mark.processes,
    pytest.mark.skipif(shutil.which("curl") is None, reason="curl is not installed"),
]


@pytest.fixture
def run(service: Running):
    def script(*arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            ["sh", str(SCRIPT), *arguments],
            env=os.environ | {"ROVER_TWIN_URL": service.url, "ROVER_TWIN_TOKEN": TOKEN},
            capture_output=True,
            text=True,
            check=False,
            timeout=60,
        )

    return script


def test_a_version_goes_through_its_states(run) -> None:
    for word, state in (("archive", "archived"), ("restore", "published"), ("delete", "deleted")):
        done = run(word, "viper-lunar", "2", 'a "reason" \\ here')
        assert (done.returncode, done.stderr) == (0, "")
        said = json.loads(done.stdout)
        assert said["state"] == state
        assert said["reason"] == 'a "reason" \\ here'
    assert json.loads(run("state", "viper-lunar", "2").stdout)["state"] == "deleted"
    assert json.loads(run("list", "viper-lunar").stdout)["deleted"] == [2]


def test_a_version_that_is_named_is_refused_with_the_reason(run) -> None:
    done = run("delete", "viper-lunar", "1")
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == "versions.sh: viper-lunar@1 is named by champion: point that elsewhere first\n"


@pytest.mark.parametrize(
    "arguments", [[], ["list"], ["archive", "x"], ["archive", "a/b", "1"], ["delete", "x", "../1"]]
)
def test_wrong_usage(run, arguments: list[str]) -> None:
    assert run(*arguments).returncode == 2
