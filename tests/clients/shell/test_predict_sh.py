"""The shell script against a real server: what it prints, and how it exits."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

SCRIPT = Path(__file__).parents[3] / "clients" / "curl" / "predict.sh"

pytestmark = [
    pytest.mark.processes,
    pytest.mark.skipif(shutil.which("curl") is None, reason="curl is not installed"),
]


def run(*arguments: str, url: str = "http://127.0.0.1:9") -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"ROVER_TWIN_URL": url}
    return subprocess.run(
        ["sh", str(SCRIPT), *arguments], env=environment, capture_output=True, text=True, check=False, timeout=60
    )


def test_json_is_printed_as_the_service_sent_it(contract_service: Any) -> None:
    done = run("28", "430", "60", "20", url=contract_service.url)

    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout)["trajectory"]["time_s"][-1] == 20.0


def test_the_horizon_is_ten_seconds_unless_said(contract_service: Any) -> None:
    assert json.loads(run("28", "430", "60", url=contract_service.url + "/").stdout)["scenario"]["horizon_s"] == 10


def test_downhill_slopes_are_numbers_not_options(contract_service: Any) -> None:
    done = run("-5", "430", "60", url=contract_service.url)

    assert json.loads(done.stdout)["scenario"]["slope_deg"] == -5


def test_csv_has_a_header_and_a_row_per_time(contract_service: Any) -> None:
    done = run("--csv", "28", "430", "60", url=contract_service.url)

    assert done.returncode == 0
    assert done.stdout.splitlines()[0] == "time_s,x_m,y_m"
    assert len(done.stdout.splitlines()) == 4


def test_a_refusal_is_one_line_and_a_non_zero_exit(contract_service: Any) -> None:
    done = run("28", "0", "60", url=contract_service.url)

    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr == "predict.sh: mass_kg is 0, allowed is 1 to 10000 (HTTP 422)\n"


@pytest.mark.parametrize("behaviour", ["broken", "corrupt", "proxy-page"])
def test_a_failing_service_is_one_line_too(contract_service: Any, behaviour: str) -> None:
    done = run("28", "430", "60", url=f"{contract_service.url}/{behaviour}")

    assert done.returncode == 1
    assert done.stdout == ""
    assert len(done.stderr.splitlines()) == 1
    assert "(HTTP 50" in done.stderr


def test_input_stays_inside_its_own_parameter(contract_service: Any) -> None:
    done = run("28", "430", "60", "10&horizon_s=20", url=contract_service.url)

    assert done.returncode == 1


def test_nobody_there_says_so() -> None:
    done = run("28", "430", "60")

    assert done.returncode == 1
    assert "127.0.0.1" in done.stderr
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize("arguments", [[], ["28"], ["28", "430"], ["1", "2", "3", "4", "5"], ["--xml", "1", "2", "3"]])
def test_wrong_usage_exits_two_and_explains(arguments: list[str]) -> None:
    done = run(*arguments)

    assert done.returncode == 2
    assert done.stdout == ""
    assert "predict.sh" in done.stderr


@pytest.mark.parametrize("option", ["-h", "--help"])
def test_help_teaches(option: str) -> None:
    done = run(option)

    assert done.returncode == 0
    assert "ROVER_TWIN_URL" in done.stdout
    assert "--csv" in done.stdout


@pytest.mark.skipif(shutil.which("shellcheck") is None, reason="shellcheck is not installed")
def test_shellcheck_finds_nothing() -> None:
    done = subprocess.run(["shellcheck", str(SCRIPT)], capture_output=True, text=True, check=False)

    assert (done.returncode, done.stdout) == (0, "")
