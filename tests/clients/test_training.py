"""The operator's half of both clients against a real service with its real worker."""

from __future__ import annotations

import gzip
import hashlib
import io
import os
import re
import subprocess
import sys
import time
import zipfile
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from model_store import ModelStore
from rover_twin_client import (
    ConflictError,
    ConnectionFailedError,
    DatasetRejectedError,
    InvalidInputError,
    NotAllowedError,
    NotFoundError,
    TimedOutError,
    TrainingFailedError,
    training_calls,
)
from tests.api.chrono_uploads import archive, run_text
from tests.api.conftest import publish_version
from tests.clients.conftest import ask_async, ask_sync
from tests.clients.operated import REPOSITORY, TOKEN, BreakingLine, OperatedService

pytestmark = pytest.mark.processes

Do = Callable[..., Any]
QUICK = {"architecture": "paper_network", "max_epochs": 2}
LONG = {"architecture": "paper_network", "max_epochs": 10_000}


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[OperatedService]:
    """Ready, with its worker on the way."""
    service = OperatedService(tmp_path_factory.mktemp("operated"))
    service.start()
    yield service
    service.stop()


@pytest.fixture(params=[ask_sync, ask_async], ids=["sync", "async"])
def do(request: pytest.FixtureRequest, service: OperatedService) -> Do:
    """Asks the service, with the token, through one of the clients."""
    settings = {"token": TOKEN}

    def ask(word: str, *args: Any, url: str = service.url, **options: Any) -> Any:
        return request.param(url, word, *args, settings=settings, **options)

    return ask


@pytest.fixture(scope="module")
def runs(service: OperatedService) -> str:
    """The id of a stored dataset of eight runs."""
    packed = io.BytesIO(archive(8))
    identity: str = ask_sync(
        service.url, "upload_dataset", packed, name="eight", filename="e.zip", settings={"token": TOKEN}
    ).id
    return identity


def test_an_upload_becomes_a_dataset_and_again_is_the_same_one(do: Do, tmp_path: Path) -> None:
    file = tmp_path / "runs.zip"
    file.write_bytes(archive(3, seed=time.time_ns() % 1000 / 1e6, broken=[1]))

    tried = do("upload_dataset", file, name="broken-one", dry_run=True)
    kept = do("upload_dataset", str(file), name="broken-one", description="for a test")
    again = do("upload_dataset", io.BytesIO(file.read_bytes()), filename="other.zip")

    assert (tried.created, tried.stored, tried.dry_run) == (False, False, True)
    assert (kept.created, kept.stored, kept.name) == (True, True, "broken-one")
    assert (again.created, again.id) == (False, kept.id)
    assert kept.report.accepted == ("runs/run0.csv", "runs/run2.csv")
    (finding,) = [each for each in kept.report.findings if each.severity == "reject"]
    assert (finding.file, finding.column) == ("runs/run1.csv", "time_s")
    assert finding.row is not None
    assert kept.report.summary is not None
    assert kept.report.summary["runs"] == 2
    do("delete_dataset", kept.id)
    with pytest.raises(NotFoundError, match="HTTP 404, dataset-not-found"):
        do("dataset", kept.id)


def test_one_plain_run_takes_its_scenario_from_the_call(do: Do, tmp_path: Path) -> None:
    file = tmp_path / "run.csv.gz"
    file.write_bytes(gzip.compress(run_text()))

    with file.open("rb") as opened:
        told = do("upload_dataset", opened, slope_deg=21, mass_kg=430, torque_nm=60.5, dry_run=True)

    assert told.report.summary is not None
    assert told.report.summary["torque_nm"] == {"lowest": 60.5, "highest": 60.5}


def test_what_cannot_be_rewound_can_be_sent_too(do: Do) -> None:
    class Pipe(io.RawIOBase):
        def __init__(self) -> None:
            self.source = io.BytesIO(archive(3))

        def readable(self) -> bool:
            return True

        def readinto(self, room: Any) -> int:
            return self.source.readinto(room)

    assert do("upload_dataset", Pipe(), filename="runs.zip", dry_run=True).report.accepted


def test_a_rejected_upload_says_what_is_wrong_with_which_file(do: Do) -> None:
    hostile = io.BytesIO()
    with zipfile.ZipFile(hostile, "w") as out:
        out.writestr("../runs.csv", "file\n")

    with pytest.raises(DatasetRejectedError) as caught:
        do("upload_dataset", hostile, filename="hostile.zip")

    assert caught.value.report is not None
    assert any("runs.csv" in finding.file + finding.message for finding in caught.value.report.findings)


def test_a_wrong_field_is_named(do: Do) -> None:
    with pytest.raises(InvalidInputError) as caught:
        do("upload_dataset", io.BytesIO(b"x"), name="no/name")

    assert [fault.field for fault in caught.value.faults] == ["name"]


def test_datasets_are_listed_described_drawn_and_downloaded(do: Do, runs: str, tmp_path: Path) -> None:
    assert runs in [each.id for each in do("datasets")]
    found = do("dataset", "eight")
    drawn = do("preview_dataset", runs, "png")
    saved = do("download_dataset", runs, tmp_path / "runs.parquet")
    again = do("upload_dataset", saved, dry_run=True)

    assert (found.id, found.summary["runs"], found.unreadable) == (runs, 8, None)
    assert found.passport["gravity_m_s2"] == 1.62
    assert found.created_at.tzinfo is not None
    assert drawn.startswith(b"\x89PNG")
    assert again.id == runs
    assert list(tmp_path.iterdir()) == [saved]


def test_what_is_not_there_leaves_no_file(do: Do, tmp_path: Path) -> None:
    with pytest.raises(NotFoundError):
        do("download_dataset", "nobody", tmp_path / "runs.parquet")

    assert list(tmp_path.iterdir()) == []


def test_pages_of_datasets_are_turned(do: Do, runs: str, monkeypatch: pytest.MonkeyPatch) -> None:
    other = do("upload_dataset", io.BytesIO(archive(2)), filename="two.zip").id
    everything = do("datasets")
    monkeypatch.setattr(training_calls, "PAGE", 1)

    assert [each.id for each in do("datasets")] == [each.id for each in everything]
    assert {runs, other} <= {each.id for each in everything}


def test_without_the_token_nothing_is_told(service: OperatedService, ask: Do) -> None:
    for settings in ({}, {"token": "another one, long enough"}):
        with pytest.raises(NotAllowedError, match="HTTP 401") as caught:
            ask(service.url, "datasets", settings=settings)
        assert isinstance(caught.value, PermissionError)
        assert "another" not in str(caught.value)


def test_a_job_is_started_followed_and_awaited(do: Do, runs: str, service: OperatedService) -> None:
    job = do("start_training_job", "rover", [runs], test_fraction=0.25, seed=7, description="a test", **QUICK)
    events = do("job_events", job.id)
    told: list[tuple[int, int]] = []
    ended = do("wait_for_job", job.id, 30, progress=lambda done, total: told.append((done, total)))
    assert told == sorted(set(told))
    assert told[-1] == (100, 100)

    assert job.actor == "admin"
    assert job.request["split"]["test_fraction"] == 0.25
    assert [event.number for event in events] == list(range(len(events)))
    assert events[0].data["state"] == "queued"
    assert events[-1].is_last
    assert {event.kind for event in events} == {"state", "progress", "log"}
    assert ended.result is not None
    assert events[-1].data["result"]["version"] == ended.result.version
    assert ended.created_at <= ended.started_at
    assert ended.progress.fraction == 1.0
    assert do("job_events", job.id, after=events[-2].number) == events[-1:]
    assert do("job_events", job.id, after=events[-1].number) == []
    assert job.id in [each.id for each in do("training_jobs", state="succeeded", model="rover")]
    assert ended.result.version in ask_sync(service.url, "model", "rover").versions


def test_the_same_key_is_the_same_job_and_no_key_is_a_new_one(do: Do, runs: str) -> None:
    key = f"monday-{time.monotonic_ns()}"
    first = do("start_training_job", "rover", [runs], idempotency_key=key, **LONG)
    try:
        assert do("start_training_job", "rover", [runs], idempotency_key=key, **LONG).id == first.id
        with pytest.raises(InvalidInputError, match="idempotency"):
            do("start_training_job", "rover", [runs], idempotency_key=key, **QUICK)
        other = do("start_training_job", "rover", [runs], **LONG)
        assert other.id != first.id
        assert do("cancel_training_job", other.id).state == "cancelled"
        assert [job.id for job in do("training_jobs", limit=1, before=other.id)] == [first.id]
        with pytest.raises(ConflictError, match="dataset-in-use"):
            do("delete_dataset", runs)
    finally:
        do("cancel_training_job", first.id)
    with pytest.raises(TrainingFailedError, match="cancelled") as caught:
        do("wait_for_job", first.id, 10)
    assert caught.value.job.id == first.id
    with pytest.raises(ConflictError, match="job-ended"):
        do("cancel_training_job", first.id)


def test_a_job_that_takes_longer_than_one_waits_goes_on(do: Do, runs: str) -> None:
    job = do("start_training_job", "rover", [runs], **LONG)
    try:
        with pytest.raises(TimedOutError, match="goes on"):
            do("wait_for_job", job.id, 0.5)
        assert not do("training_job", job.id).ended
    finally:
        do("cancel_training_job", job.id)


def test_a_start_whose_answer_is_lost_is_sent_again_and_stays_one_job(
    do: Do, runs: str, service: OperatedService
) -> None:
    before = len(do("training_jobs", limit=500))
    line = BreakingLine(service.port, breaks=1, after_bytes=20)
    with line.listening() as url:
        job = do("start_training_job", "rover", [runs], url=url, **LONG)
    do("cancel_training_job", job.id)

    assert line.cut == 1
    assert len(do("training_jobs", limit=500)) == before + 1


def test_events_come_once_each_over_a_line_that_breaks(
    do: Do, runs: str, service: OperatedService, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rover_twin_client.following._LONGEST_PAUSE_S", 0.05)
    job = do("start_training_job", "rover", [runs], **QUICK)
    whole = do("job_events", job.id)
    line = BreakingLine(service.port, breaks=4, after_bytes=900)
    with line.listening() as url:
        pieces = do("job_events", job.id, url=url)

    assert line.cut == 4
    assert pieces == whole


@pytest.mark.timeout(60)  # followed like others, they would be asked for again and again
def test_events_of_no_job_and_of_nobody_are_told_at_once(do: Do) -> None:
    with pytest.raises(NotFoundError):
        do("job_events", "0f0e3b5c-6b43-4d0f-a5a5-3a7d3f0b8a10")
    with pytest.raises(InvalidInputError, match="after is -1"):
        do("job_events", "0f0e3b5c-6b43-4d0f-a5a5-3a7d3f0b8a10", after=-1)
    with pytest.raises(ConnectionFailedError):
        do("job_events", "0f0e3b5c-6b43-4d0f-a5a5-3a7d3f0b8a10", url="http://127.0.0.1:9")


@pytest.mark.kills
def test_a_job_is_followed_over_a_killed_service(runs: str, service: OperatedService) -> None:
    asked = {**QUICK, "max_epochs": 10_000, "max_minutes": 0.15}
    settings = {"token": TOKEN}
    job = ask_sync(service.url, "start_training_job", "rover", [runs], settings=settings, **asked)
    with ThreadPoolExecutor() as pool:
        waiting = pool.submit(ask_sync, service.url, "wait_for_job", job.id, 120, settings=settings)
        following = pool.submit(ask_sync, service.url, "job_events", job.id, settings=settings)
        time.sleep(1.0)
        service.kill()
        service.start()
        events, ended = following.result(120), waiting.result(120)

    assert [event.number for event in events] == list(range(len(events)))
    assert events[-1].is_last
    assert ended.state == "succeeded"


def test_the_readmes_example_runs(service: OperatedService, tmp_path: Path) -> None:
    text = (REPOSITORY / "clients" / "python" / "README.md").read_text(encoding="utf-8")
    (example,) = [block for block in re.findall(r"```python\n(.*?)```", text, re.DOTALL) if "TOKEN" in block]
    (tmp_path / "runs.tar.gz").write_bytes(archive(12))  # a zip by another name: what it is counts
    printed = subprocess.run(
        [sys.executable, "-W", "error", "-c", example.replace("http://127.0.0.1:8000", service.url)],
        cwd=tmp_path,
        env=os.environ | {"ROVER_TWIN_TOKEN": TOKEN},
        capture_output=True,
        text=True,
        check=True,
    ).stdout

    assert "published viper-lunar@" in printed
    assert ask_sync(service.url, "alias", "viper-lunar").reason == "the other is better"


def test_an_alias_moves_only_from_where_it_was_seen(do: Do) -> None:
    seen = do("alias", "viper-lunar")
    moved = do("move_alias", "viper-lunar", "champion", 1, "to compare", expected=seen)
    try:
        assert (moved.version, moved.actor, moved.reason) == (1, "admin", "to compare")
        for expected in (seen, seen.etag, None):
            with pytest.raises(ConflictError):
                do("move_alias", "viper-lunar", "champion", 2, "too late", expected=expected)
            with pytest.raises(ConflictError):
                do("rollback_alias", "viper-lunar", expected=expected)
    finally:
        back = do("rollback_alias", "viper-lunar", "champion", "it was worse", expected=moved)
    assert (back.version, back.reason) == (seen.version, "it was worse")
    history = do("alias_history", "viper-lunar")
    assert [record.version for record in history[:2]] == [seen.version, 1]
    assert history[0] == do("alias", "viper-lunar") == back


def test_an_alias_that_is_new_needs_no_precondition(do: Do) -> None:
    name = f"test-{time.monotonic_ns()}"

    assert do("move_alias", "viper-lunar", name, 1, "new").seq == 1
    assert do("move_alias", "viper-lunar", name, 5, "wherever it is", expected="*").seq == 2


@pytest.mark.parametrize(
    ("word", "args", "field"),
    [
        ("dataset", ("..",), "dataset"),
        ("training_job", ("",), "job_id"),
        ("move_alias", ("viper-lunar", "champion", 1.5, "why"), "version"),
        ("alias", ("viper-lunar", "no/alias"), "alias"),
        ("start_training_job", ("rover", ["a"], "zero"), None),
    ],
)
def test_what_cannot_be_sent_is_refused_before(do: Do, word: str, args: tuple[Any, ...], field: str | None) -> None:
    with pytest.raises((InvalidInputError, TypeError)) as caught:
        do(word, *args)
    if field is not None:
        assert [fault.field for fault in caught.value.faults] == [field]


def test_numbers_and_keys_are_checked_by_name() -> None:
    with pytest.raises(InvalidInputError, match="margin is nan"):
        training_calls.job_request("m", ["a"], **_request(margin=float("nan")))
    with pytest.raises(InvalidInputError, match="seed is "):
        training_calls.job_request("m", ["a"], **_request(seed=1.5))
    with pytest.raises(InvalidInputError, match="idempotency_key is"):
        training_calls.start({}, 'a"b')
    with pytest.raises(InvalidInputError, match="expected is"):
        training_calls.move_alias("m", "champion", 1, "why", "3")


def _request(**given: Any) -> dict[str, Any]:
    names = ("test_fraction", "max_epochs", "max_minutes", "seed", "margin", "inputs")
    return dict.fromkeys(names) | {"test_slopes_deg": ()} | given


@pytest.mark.parametrize("token", ["", " ", "a\nb", "tök"])
def test_a_token_that_no_header_carries_is_refused_and_not_shown(token: str) -> None:
    from rover_twin_client import RoverTwin

    with pytest.raises(ValueError, match="token must be visible ASCII") as caught:
        RoverTwin(token=token)
    assert not token.strip() or token not in str(caught.value)


def test_a_download_that_does_not_have_its_digest_is_no_file(tmp_path: Path) -> None:
    from rover_twin_client import UnexpectedAnswerError
    from rover_twin_client.saving import whole_file

    target = tmp_path / "runs.parquet"
    target.write_bytes(b"before")
    told = {"etag": f'"{hashlib.sha256(b"runs").hexdigest()}"'}

    with pytest.raises(UnexpectedAnswerError, match="digest"), whole_file(target, told) as take:
        take(b"ruins")
    assert target.read_bytes() == b"before"
    with whole_file(target, told) as take:
        take(b"ru")
        take(b"ns")
    assert target.read_bytes() == b"runs"
    assert list(tmp_path.iterdir()) == [target]


def test_a_version_is_taken_out_of_use_and_back(do: Do, service: OperatedService) -> None:
    store = ModelStore.open(str(service.store))
    name = f"retired-{time.monotonic_ns()}"
    made = [publish_version(store, name) for _ in range(2)]
    archived = do("archive_version", name, made[0], "for a test")
    assert (archived.state, archived.actor, archived.reason) == ("archived", "admin", "for a test")
    assert do("version_state", name, made[0]) == do("archive_version", name, made[0]) == archived
    assert made[0] in do("model", name).archived
    with pytest.raises(ConflictError, match="version-archived"):
        do("move_alias", name, "archived-one", made[0], "x")
    assert do("restore_version", name, made[0]).state == "published"
    assert do("delete_version", name, made[0], "a reason").reason == "a reason"
    assert (made[0] in do("model", name).deleted, made[0] in do("model", name).versions) == (True, False)
    with pytest.raises(NotFoundError, match="version-deleted"):
        do("restore_version", name, made[0])
    do("move_alias", name, "kept", made[1], "x")
    with pytest.raises(ConflictError, match="version-in-use"):
        do("delete_version", name, made[1])


def test_known_content_says_so_and_is_found_by_both_names(do: Do) -> None:
    packed = archive(3, seed=time.time_ns() % 1000 / 1e6)
    first = do("upload_dataset", io.BytesIO(packed), name="known-first", filename="a.zip")
    again = do("upload_dataset", io.BytesIO(packed), name="known-again", filename="a.zip")
    assert (first.already_known_as, again.already_known_as, again.name) == ((), ("known-first",), "known-again")
    assert do("dataset", "known-again").id == do("dataset", "known-first").id == first.id
    do("delete_dataset", first.id)
