"""`jobs`: a queue that the command line shares with the service, worked off by a real `worker`."""

from __future__ import annotations

import contextlib
import os
import pty
import re
import shutil
import signal
import subprocess
import sys
import time

import pytest
from typer.main import get_command

from model_store import ModelStore
from service.cli.failures import ExitCode
from service.cli.main import program
from service.jobs.request import Budget, SplitRequest, TrainingJobRequest
from tests.cli.conftest import call, start, write_runs

ABSENT = "0f0e3b5c-6b43-4d0f-a5a5-3a7d3f0b8a10"
_START = ("jobs", "start", "--model", "rover", "--architecture", "zero", "--actor", "tests", "--dataset")
START = (*_START, "small")


def queued(store, *more, dataset="small"):
    """The id of a new job that waits."""
    answer = call(*_START, dataset, *more, "--store", store)
    assert answer.code == 0, answer.err
    return answer.out.strip()


def jobs(store, *more):
    return call("jobs", "list", "--json", *more, "--store", store).json["jobs"]


@pytest.fixture(scope="module")
def worked(small_store, tmp_path_factory, processes):
    """A store on which a worker waits for jobs; dataset `broken` was cut off on disk."""
    store = shutil.copytree(small_store, tmp_path_factory.mktemp("worked") / "store")
    folder = write_runs(store.parent / "runs", slopes=(10.0, 12.0, 14.0))
    imported = call("datasets", "import", folder, "--name", "broken", "--store", store)
    assert imported.code == 0, imported.err
    runs = store / "datasets" / ModelStore.open(str(store)).dataset("broken").id / "runs.parquet"
    runs.write_bytes(runs.read_bytes()[:1000])
    worker = start("worker", "--store", store, "--log-level", "warning")
    yield store
    worker.terminate()
    _, err = worker.communicate(timeout=60)
    assert worker.returncode == 0, err


@pytest.mark.slow
def test_what_was_started_is_listed_and_shown(store):
    first, second = queued(store), queued(store, "--model", "other", "--seed", "5", "--description", "why not")
    shown = call("jobs", "show", second, "--json", "--store", store).json
    text = call("jobs", "show", second, "--store", store).out
    listed = call("jobs", "list", "--store", store).out

    assert [job["id"] for job in jobs(store)] == [second, first]
    assert [job["id"] for job in jobs(store, "--model", "rover")] == [first]
    assert jobs(store, "--state", "running") == []
    assert jobs(store, "--limit", "1") == [shown]
    assert (shown["state"], shown["actor"], shown["request"]["seed"]) == ("queued", "tests", 5)
    assert len(shown["request"]["datasets"][0]) == 64
    assert all(each in listed for each in (first, second, "queued", "other"))
    assert "why not" in text


def test_options_are_the_fields_of_a_request(store):
    answer = call(
        *("jobs", "start", "--model", "m", "--dataset", "small", "--prior", "rigid_slope"),
        *("--architecture", "paper_network", "--input", "time_s", "--input", "mass_kg", "--x-form", "position"),
        *("--test-slope-deg", "22", "--test-fraction", "0.25", "--description", "d", "--seed", "3"),
        *("--epochs", "7", "--minutes", "1.5", "--promote", "if_better", "--margin", "0.1", "--json", "--store", store),
    ).json["request"]
    (dataset,) = answer.pop("datasets")

    assert dataset == ModelStore.open(str(store)).dataset("small").id
    assert answer == {
        "model": "m",
        "prior": "rigid_slope",
        "architecture": "paper_network",
        "inputs": ["time_s", "mass_kg"],
        "x_form": "position",
        "split": {"test_slopes_deg": [22.0], "test_fraction": 0.25},
        "description": "d",
        "seed": 3,
        "budget": {"max_epochs": 7, "max_minutes": 1.5},
        "promote": "if_better",
        "margin": 0.1,
    }


def test_the_help_states_the_defaults_that_a_request_has():
    """The options have none of their own, so that a request left alone is the same everywhere."""
    defaults = {name: field.default for name, field in TrainingJobRequest.model_fields.items()}
    defaults |= {name: field.default for name, field in SplitRequest.model_fields.items()}
    defaults |= {"epochs": Budget().max_epochs, "minutes": Budget().max_minutes}
    options = {each.name: each for each in get_command(program()).commands["jobs"].commands["start"].params}
    names = ["architecture", "prior", "x_form", "test_fraction", "seed", "epochs", "minutes", "promote", "margin"]

    for name in names:
        stated = re.search(r"Default: (\S+)\.$", options[name].help)
        assert stated, name
        assert stated[1] == str(defaults[name]), name


def test_the_same_key_is_the_same_job(store):
    first = queued(store, "--key", "monday")
    again = call(*START, "--key", "monday", "--store", store)
    other = call(*START, "--key", "monday", "--seed", "9", "--store", store)

    assert again.out.strip() == first
    assert "before" in again.err
    assert (other.code, first in other.error) == (ExitCode.USAGE, True)
    assert len(jobs(store)) == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("more", "code", "says"),
    [
        (("--dataset", "absent"), ExitCode.NOT_FOUND, "absent"),
        (("--dataset", "small"), ExitCode.USAGE, "datasets"),
        (("--model", "Not A Name"), ExitCode.USAGE, "model"),
        (("--epochs", "0"), ExitCode.USAGE, "max_epochs"),
        (("--minutes", "0"), ExitCode.USAGE, "max_minutes"),
        (("--margin", "0.7"), ExitCode.USAGE, "margin"),
        (("--promote", "always"), ExitCode.USAGE, "--promote"),
        (("--input", "slope_deg"), ExitCode.USAGE, "time_s first"),
        (("--test-slope-deg", "77"), ExitCode.USAGE, "test_slopes_deg"),
        (("--database", "mysql://there"), ExitCode.USAGE, "jobs_database_url"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_what_cannot_work_is_refused_before_it_is_queued(store, more, code, says):
    answer = call(*START, *more, "--store", store)

    assert answer.code == code, answer.err
    assert says in answer.error
    assert jobs(store) == []


@pytest.mark.slow
@pytest.mark.parametrize("command", ["show", "watch", "cancel", "logs"])
def test_a_job_that_is_not_there(small_store, tmp_path, command):
    answer = call("jobs", command, ABSENT, "--store", small_store, "--database", f"sqlite:///{tmp_path / 'jobs'}")

    assert answer.code == ExitCode.NOT_FOUND
    assert ABSENT in answer.error


def test_cancelling_works_once(store):
    job = queued(store)
    cancelled = call("jobs", "cancel", job, "--store", store)
    again = call("jobs", "cancel", job, "--store", store)
    watched = call("jobs", "watch", job, "--store", store)

    assert (cancelled.code, cancelled.out) == (0, f"{job} cancelled\n")
    assert (again.code, "cancelled" in again.error) == (ExitCode.REFUSED, True)
    assert (watched.code, "was cancelled" in watched.error) == (ExitCode.REFUSED, True)
    assert "queued" in watched.err


def test_a_full_queue_is_a_failure_that_says_when_to_come_back(store, monkeypatch):
    monkeypatch.setenv("ROVER_TWIN_MAX_QUEUED_JOBS", "1")
    queued(store)
    answer = call(*START, "--store", store)

    assert answer.code == ExitCode.FAILED
    assert re.search(r"again in \d+ s", answer.error)


def test_a_database_that_is_down_is_a_failure_that_says_so(store):
    answer = call("jobs", "list", "--database", "postgresql://me:pass-word@127.0.0.1:9/jobs", "--store", store)

    assert answer.code == ExitCode.FAILED
    assert "does not answer" in answer.error
    assert "pass-word" not in answer.err


def test_starting_and_watching_shows_what_happens_and_ends_with_the_version(worked):
    answer = call(*START, "--test-slope-deg", "22", "--watch", "--store", worked)
    (job,) = (each for each in jobs(worked) if each["id"] in answer.out)
    logs = call("jobs", "logs", job["id"], "--store", worked)

    assert answer.code == 0, answer.err
    lines = answer.err.splitlines()
    assert [line for line in lines if line in ("queued", "running", "succeeded")] == ["queued", "running", "succeeded"]
    assert any("100 %" in line for line in lines)
    version = f"{job['result']['model']}@{job['result']['version']}"
    assert version in answer.out
    assert call("models", "show", version, "--store", worked).code == 0
    assert version in logs.out
    assert len(logs.out.splitlines()) == len(call("jobs", "logs", job["id"], "--json", "--store", worked).json["lines"])
    assert all(line.partition(" ")[2] in lines for line in logs.out.splitlines())


def test_watching_with_json_ends_with_the_job(worked):
    job = queued(worked)
    answer = call("jobs", "watch", job, "--json", "--store", worked)

    assert answer.code == 0, answer.err
    assert answer.json == call("jobs", "show", job, "--json", "--store", worked).json
    assert answer.json["state"] == "succeeded"


def test_on_a_terminal_a_bar_follows_the_job(worked):
    job = queued(worked)
    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-m", "service", "jobs", "watch", job, "--store", worked],
        stdout=subprocess.PIPE,
        stderr=theirs,
        text=True,
        env=os.environ | {"COLUMNS": "300", "TERM": "xterm"},
    )
    os.close(theirs)
    shown = b""
    with contextlib.suppress(OSError):  # how Linux says that nobody holds the other end any more
        while part := os.read(ours, 65536):
            shown += part
    os.close(ours)
    out, _ = process.communicate(timeout=60)
    log = call("jobs", "logs", job, "--json", "--store", worked).json["lines"]

    assert process.returncode == 0
    assert "succeeded" in out
    assert b"\x1b[" in shown  # drawn and drawn again
    assert "\u2501".encode() in shown
    assert all(line["message"].encode() in shown for line in log)


def test_a_job_that_fails_is_a_failure_with_its_reason(worked):
    job = queued(worked, dataset="broken")
    answer = call("jobs", "watch", job, "--store", worked)
    failure = call("jobs", "show", job, "--json", "--store", worked).json["failure"]

    assert answer.code == ExitCode.FAILED
    assert " ".join(failure["message"].split()) in answer.error
    assert failure["remedy"] in answer.out


def test_a_dataset_that_an_unfinished_job_names_is_not_deleted(store, tmp_path):
    folder = write_runs(tmp_path / "runs", slopes=(10.0, 12.0, 14.0))
    assert call("datasets", "import", folder, "--name", "held", "--store", store).code == ExitCode.DONE
    job = queued(store, dataset="held")
    refused = call("datasets", "delete", "held", "--store", store)
    assert (refused.code, job in refused.error) == (ExitCode.REFUSED, True)
    assert call("jobs", "cancel", job, "--store", store).code == ExitCode.DONE
    assert call("datasets", "delete", "held", "--store", store).code == ExitCode.DONE


@pytest.mark.processes
def test_interrupted_watching_leaves_the_job_alone(store):
    job = queued(store)
    process = start("jobs", "watch", job, "--store", store)
    deadline = time.monotonic() + 60
    while "queued" not in (line := process.stderr.readline()) and time.monotonic() < deadline:
        assert process.poll() is None, line
    process.send_signal(signal.SIGINT)
    try:
        out, err = process.communicate(timeout=30)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        raise

    assert process.returncode == ExitCode.INTERRUPTED
    assert (out, "Traceback" in err) == ("", False)
    assert f"rover-twin jobs watch {job}" in err
    assert call("jobs", "show", job, "--json", "--store", store).json["state"] == "queued"
