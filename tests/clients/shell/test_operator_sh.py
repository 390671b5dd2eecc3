"""The operator's script against a real service: data in, checked first; a job; a version into use and back."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.api.chrono_uploads import archive
from tests.api.conftest import TOKEN, Running, move_alias, publish_version, serving

SCRIPT = Path(__file__).parents[3] / "clients" / "curl" / "operator.sh"
Run = Callable[..., "subprocess.CompletedProcess[str]"]
pytestmark = [
    pytest.mark.processes,
    pytest.mark.skipif(shutil.which("curl") is None, reason="curl is not installed"),
]


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    with serving(tmp_path_factory.mktemp("store"), admin_token=TOKEN, start_worker=False) as running:
        move_alias(running.store, publish_version(running.store))
        publish_version(running.store)
        yield running


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


def test_help_is_the_usage(run: Run) -> None:
    assert "operator.sh promote MODEL VERSION REASON" in run("--help").stdout
