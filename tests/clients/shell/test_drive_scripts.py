"""The shell scripts for drives and steps against the real service: what they print, and how they exit."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.clients.test_driving import free_port, serving

REPOSITORY = Path(__file__).parents[3]
pytestmark = [
    pytest.mark.processes,
    pytest.mark.skipif(shutil.which("curl") is None, reason="curl is not installed"),
]


@pytest.fixture(scope="module")
def url(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    port = free_port()
    with serving(tmp_path_factory.mktemp("service"), port):
        yield f"http://127.0.0.1:{port}"


def run(url: str, script: str, *arguments: str, text: str = "") -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["sh", str(REPOSITORY / "clients" / "curl" / script), *arguments],
        env=os.environ | {"ROVER_TWIN_URL": url},
        input=text,
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )


def test_a_drive(url: str) -> None:
    done = run(url, "drive.sh", "--csv", "430", "100", "2", "0:10", "2:-20.5")

    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("time_s,x_m,y_m,speed_m_s,slope_deg,torque_nm,brake,slip_ratio\n")
    assert len(done.stdout.splitlines()) == 42


@pytest.mark.parametrize("knots", [["0:80"], ["2:1", "1:1"]])
def test_a_refused_drive(url: str, knots: list[str]) -> None:
    done = run(url, "drive.sh", "430", "100", "2", *knots)

    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr.startswith("drive.sh: track.")


@pytest.mark.parametrize("arguments", [[], ["430"], ["430", "100", "2", "steep"], ["430", "1}", "2", "0:1"]])
def test_wrong_usage(url: str, arguments: list[str]) -> None:
    assert run(url, "drive.sh", *arguments).returncode == 2


def test_steps(url: str) -> None:
    done = run(url, "steps.sh", "430", text="10 100 0.5\n15 100 0.5\n15 brake 0.5\n")

    assert (done.returncode, done.stderr) == (0, "")
    rows = [[float(number) for number in line.split()] for line in done.stdout.splitlines()]
    assert [row[0] for row in rows] == [0.5, 1.0, 1.5]
    assert rows[1][2] > 0.1 > abs(rows[2][2])


@pytest.mark.parametrize(
    "text", ["10 100 0.5\n10 brake 5e-1", "10 100 0.5\r\n10 brake 0.5\r\n", "10 100 0.5\r\n-0 0 0.5\r"]
)
def test_lines_may_end_in_any_way(url: str, text: str) -> None:
    done = run(url, "steps.sh", "430", text=text)

    assert (done.returncode, done.stderr) == (0, "")
    assert [line.split()[0] for line in done.stdout.splitlines()] == ["0.5", "1.0"]


@pytest.mark.parametrize("number", ["01", "1.", ".5", "+1", "--1", "1-2", "e", "1e", "", "1\n2", "1.2.3", "nan", "0x1"])
def test_what_is_no_json_number_is_not_sent(number: str) -> None:
    nowhere = "http://127.0.0.1:9"
    drive = run(nowhere, "drive.sh", "430", number, "2", "0:1")
    knot = run(nowhere, "drive.sh", "430", "100", "2", f"{number}:1")
    steps = run(nowhere, "steps.sh", number)

    assert [each.returncode for each in (drive, knot, steps)] == [2, 2, 2]
    assert f"TORQUE_NM is '{number}', which is no number" in drive.stderr
    assert f"MASS_KG is '{number}', which is no number" in steps.stderr


@pytest.mark.parametrize("torque", ["100", "1e2", "1.0E+2", "100.0", "1000e-1"])
def test_a_number_may_be_written_as_in_json(url: str, torque: str) -> None:
    assert run(url, "drive.sh", "430", torque, "1", "-0.5:10").stdout.count('"time_s"') > 0


def test_a_refused_step_says_why(url: str) -> None:
    done = run(url, "steps.sh", "430", text="10 100 0.5\n99 100 0.5\n")

    assert done.returncode == 1
    assert len(done.stdout.splitlines()) == 1
    assert done.stderr == "steps.sh: slope_deg is 99, allowed is -45 to 45\n"
