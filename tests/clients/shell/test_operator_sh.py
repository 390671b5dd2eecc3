"""The operator's script against a real service: data in, checked first; a job; a version into use and back."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import socket
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.api.chrono_uploads import archive
from tests.api.conftest import TOKEN, Running, serving
from tests.api.training import HEADERS, admin_serving, job_store, submit, working

ROOT = Path(__file__).parents[3]
SCRIPT = ROOT / "clients" / "curl" / "operator.sh"
Run = Callable[..., "subprocess.CompletedProcess[str]"]
pytestmark = [
    pytest.mark.processes,
    pytest.mark.skipif(shutil.which("curl") is None, reason="curl is not installed"),
]


@pytest.fixture
def run(service: Running) -> Run:
    def script(*arguments: str, token: str = TOKEN, **more: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            ["sh", str(SCRIPT), *arguments],
            env=os.environ | {"ROVER_TWIN_URL": service.url, "ROVER_TWIN_TOKEN": token} | more,
            capture_output=True,
            text=True,
            check=False,
            timeout=120,
        )

    return script


def said(done: subprocess.CompletedProcess[str]) -> dict:
    assert (done.returncode, done.stderr) == (0, "")
    return json.loads(done.stdout)


def test_data_is_checked_stored_listed_trained_on_and_deleted(run: Run, tmp_path: Path) -> None:
    packed = tmp_path / "runs.zip"
    packed.write_bytes(archive())

    checked = said(run("check", str(packed)))
    assert (checked["stored"], checked["dry_run"]) == (False, True)
    stored = said(run("upload", str(packed), "mine"))
    assert stored["created"]
    assert stored["id"] == checked["id"]
    assert [each["name"] for each in said(run("datasets"))["datasets"]] == ["mine"]
    assert said(run("datasets", "mine"))["id"] == stored["id"]

    job = said(run("train", "rover", "mine", ROVER_TWIN_TRAIN='"architecture": "drive_model", "promote": "never"'))
    assert said(run("jobs", job["id"]))["state"] == "queued"
    assert [each["id"] for each in said(run("jobs"))["jobs"]] == [job["id"]]
    refused = run("delete-dataset", stored["id"])
    assert (refused.returncode, refused.stdout) == (1, "")
    assert "(HTTP 409)" in refused.stderr
    said(run("cancel", job["id"]))
    followed = run("follow", job["id"])
    assert followed.returncode == 1
    assert json.loads(followed.stdout)["state"] == "cancelled"
    assert followed.stderr.endswith(f"operator.sh: job {job['id']} is cancelled\n")
    assert run("delete-dataset", stored["id"]).returncode == 0


def test_a_version_comes_into_use_and_goes_again(run: Run) -> None:
    reason = 'half the "error" \\ on slopes'
    moved = said(run("promote", "viper-lunar", "2", reason))
    assert (moved["version"], moved["reason"]) == (2, reason)
    assert said(run("rollback", "viper-lunar", "slides"))["version"] == 1
    assert [each["version"] for each in said(run("history", "viper-lunar", token=""))["history"]][:2] == [1, 2]


def test_two_versions_are_compared_without_a_token(run: Run) -> None:
    found = said(run("compare", "viper-lunar", "2", token=""))
    assert (found["candidate"], found["against"]) == ("viper-lunar@2", "viper-lunar@1")
    assert said(run("compare", "viper-lunar", "1", "viper-lunar@2"))["against"] == "viper-lunar@2"


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        ((), 2), (("train", "rover"), 2), (("promote", "viper-lunar", "x", "r"), 2), (("jobs", "../x"), 2),
        (("check", "/nowhere/at all"), 2), (("rollback", "viper-lunar", "two\nlines"), 2), (("upload", "x"), 2),
        (("promote", "viper-lunar", "9", "r"), 1), (("train", "rover", "absent"), 1), (("compare", "nobody", "1"), 1),
        (("follow", "absent"), 1), (("jobs", "absent"), 1),
    ],
)  # fmt: skip
def test_what_cannot_be_is_told_and_changes_nothing(run: Run, arguments: tuple[str, ...], code: int) -> None:
    done = run(*arguments)

    assert (done.returncode, done.stdout) == (code, "")
    assert done.stderr
    if code == 1:
        assert len(done.stderr.splitlines()) == 1
        assert "(HTTP 4" in done.stderr


def test_without_a_token_nothing_is_sent(run: Run) -> None:
    done = run("jobs", token="")

    assert (done.returncode, done.stderr) == (2, "operator.sh: ROVER_TWIN_TOKEN is not set\n")


@pytest.mark.parametrize("words", [("follow", "any"), ("jobs", "any")], ids=lambda words: words[0])
def test_without_a_service_one_line_says_so(run: Run, words: tuple[str, ...]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as closed:
        port = closed.getsockname()[1]
    done = run(*words, ROVER_TWIN_URL=f"http://127.0.0.1:{port}")

    assert (done.returncode, done.stdout) == (1, "")
    (line,) = done.stderr.splitlines()
    assert line.startswith("curl: (7) ")


def test_a_stream_that_breaks_off_promises_nothing(run: Run) -> None:
    """A service that knows the job, begins its events and is gone."""
    answers = [
        b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\nConnection: close\r\n\r\n{}",
        b"HTTP/1.1 200 OK\r\nContent-Length: 99\r\nConnection: close\r\n\r\nevent: state\n\n",
    ]

    def answer_both(listener: socket.socket) -> None:
        for answer in answers:
            connection, _ = listener.accept()
            with connection:
                connection.recv(65536)
                connection.sendall(answer)

    with socket.create_server(("127.0.0.1", 0)) as listener:
        listener.settimeout(60)
        thread = threading.Thread(target=answer_both, args=(listener,))
        thread.start()
        done = run("follow", "any", ROVER_TWIN_URL=f"http://127.0.0.1:{listener.getsockname()[1]}")
        thread.join()

    assert (done.returncode, done.stdout) == (1, "")
    line = done.stderr.splitlines()[-1]
    assert line == (
        "operator.sh: the events of any broke off (exit code 18 of curl); operator.sh jobs any says how it stands"
    )


@pytest.mark.parametrize("words", [("check", "."), ("upload", ".", "mine")], ids=lambda words: words[0])
def test_a_directory_is_called_one(run: Run, words: tuple[str, ...]) -> None:
    done = run(*words)

    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("operator.sh: . is a directory; ")


@pytest.mark.slow
def test_a_job_that_succeeds_is_followed_to_its_end(run: Run, tmp_path: Path) -> None:
    store = job_store(tmp_path)
    with admin_serving(store) as running, working(store):
        job = submit(running.client, budget={"max_epochs": 1})
        followed = run("follow", job["id"], ROVER_TWIN_URL=running.url, ROVER_TWIN_TOKEN=HEADERS["Authorization"][7:])

    assert followed.returncode == 0, followed.stderr
    assert json.loads(followed.stdout)["state"] == "succeeded"
    assert "event: " in followed.stderr


def test_the_commands_of_the_first_results_page_check_a_file(tmp_path: Path) -> None:
    page = (ROOT / "docs" / "quickstart.md").read_text()
    made, checked = re.findall(
        r"^    (?!.*make run)(.*)$", page.partition("## An operator")[2].partition("\nThen")[0], re.M
    )
    program = f"{shlex.quote(sys.executable)} -m service"
    with serving(tmp_path / "store", admin_token="a-long-secret-of-yours", start_worker=False) as running:
        for line in (made.replace(".venv/bin/rover-twin", program), checked.replace("clients/", f"sh {ROOT}/clients/")):
            environment = os.environ | {"ROVER_TWIN_URL": running.url, "PYTHONPATH": str(ROOT)}
            done = subprocess.run(
                line,
                shell=True,
                cwd=tmp_path,
                env=environment,
                capture_output=True,
                text=True,
                timeout=120,
                check=False,
            )
            assert done.returncode == 0, done.stderr

    assert json.loads(done.stdout)["dry_run"]


def test_help_is_the_usage(run: Run) -> None:
    assert "operator.sh promote MODEL VERSION REASON" in run("--help").stdout
