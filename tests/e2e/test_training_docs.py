"""docs/training.md, followed word by word on a fresh clone, while predictions are asked for all the time."""

from __future__ import annotations

import json
import re
import shlex
import signal
import socket
import subprocess
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.databases import start_postgres
from tests.e2e.test_readme import ROOT, SET_UP_S, is_ready, newcomer

pytestmark = [pytest.mark.e2e, pytest.mark.timeout(2400)]

PAGE = ROOT / "docs" / "training.md"
QUESTION = {"slope_deg": 28, "mass_kg": 430, "torque_nm": 60}
ENDLESS = re.compile(r"rover-twin (serve|worker)\b")


def blocks() -> list[list[str]]:
    """The lines of each sh block."""
    found = re.findall(r"^```sh\n(.*?)^```$", PAGE.read_text(), re.MULTILINE | re.DOTALL)
    return [text.splitlines() for text in found]


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port: int = listener.getsockname()[1]
        return port


class Shell:
    """One shell, as the reader's: what a line sets, later ones use. Every line must succeed, curl's answers too."""

    def __init__(self, folder: Path, environment: dict[str, str]) -> None:
        self._started: list[int] = []
        self._process = subprocess.Popen(
            ["sh"],
            cwd=folder,
            env=environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    def run(self, line: str) -> str:
        """What it prints."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(f"{line}\necho; echo =done= $?\n")
        self._process.stdin.flush()
        printed = ""
        for part in self._process.stdout:
            if part.startswith("=done= "):
                assert part == "=done= 0\n", f"{line}\n{printed}"
                return printed
            printed += part
        raise AssertionError(f"the shell ended at {line}\n{printed}")

    def start(self, line: str, log: Path) -> None:
        """Leave it running in the background."""
        self._started.append(int(self.run(f"{line} >>{shlex.quote(str(log))} 2>&1 &\necho $!").split()[-1]))

    def end(self) -> None:
        """Stop what was started, as an operator does, and the shell."""
        for pid in reversed(self._started):
            self.run(f"kill -{signal.SIGTERM.value} {pid}; wait {pid} || true")
        self._process.communicate(timeout=60)
        assert self._process.returncode == 0


class SteadyLoad:
    """A prediction every twentieth of a second; what became of each."""

    def __init__(self, url: str) -> None:
        self._url = url
        self._ending = threading.Event()
        self.versions: Counter[int] = Counter()
        self.failures: list[str] = []

    @contextmanager
    def running(self) -> Iterator[None]:
        thread = threading.Thread(target=self._ask)
        thread.start()
        try:
            yield
        finally:
            self._ending.set()
            thread.join(60)

    def _ask(self) -> None:
        with httpx.Client(base_url=self._url, timeout=30, trust_env=False) as client:
            while not self._ending.wait(0.05):
                try:
                    answer = client.get("/v1/predictions", params=QUESTION)
                    answer.raise_for_status()
                    self.versions[answer.json()["model"]["version"]] += 1
                except httpx.HTTPError as error:
                    self.failures.append(repr(error))


@pytest.fixture(scope="module")
def clone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("operator") / "rover-twin"
    subprocess.run(["git", "clone", "--quiet", str(ROOT), str(folder)], check=True)
    return folder


@pytest.fixture
def postgres_url() -> Iterator[str]:
    for server in start_postgres():
        yield server.new_database()


def wait_ready(port: int) -> None:
    end = time.monotonic() + SET_UP_S
    while not is_ready(port):
        assert time.monotonic() < end
        time.sleep(0.2)


def test_the_page_holds_and_no_prediction_fails_meanwhile(clone: Path, tmp_path: Path, postgres_url: str) -> None:
    port, other_port = free_port(), free_port()
    (tmp_path / ".curlrc").write_text("fail\nsilent\nshow-error\n")
    shell = Shell(clone, newcomer() | {"CURL_HOME": str(tmp_path), "ROVER_TWIN_PORT": str(port)})
    load = SteadyLoad(f"http://127.0.0.1:{port}")
    first, *following = blocks()
    try:
        for line in first:
            shell.run(line)
        told = _up_to_the_service(shell, following, port, clone.parent / "serve.log")
        with load.running():
            for line in (line for block in following for line in block):
                line = line.replace(":8000/", f":{port}/").replace("--port 8001", f"--port {other_port}")
                line = line.replace("postgresql://rover:secret@db.example/rover", shlex.quote(postgres_url))
                if ENDLESS.search(line):
                    shell.start(line, clone.parent / "serve.log")
                    wait_ready(other_port)
                    continue
                told.append((line, shell.run(line)))
    finally:
        shell.end()

    assert load.failures == []
    assert sum(load.versions.values()) > 100
    assert set(load.versions) == {5, 6}
    _require_answers(told, clone.parent / "training")


def _up_to_the_service(shell: Shell, following: list[list[str]], port: int, log: Path) -> list[tuple[str, str]]:
    while following:
        for line in following.pop(0):
            if ENDLESS.search(line):
                shell.start(line, log)
                wait_ready(port)
                return []
            shell.run(line)
    raise AssertionError("the page starts no service")


def _require_answers(told: list[tuple[str, str]], made: Path) -> None:
    """What the page says of its commands' answers."""

    def printed(pattern: str) -> str:
        (text,) = [text for line, text in told if re.search(pattern, line)]
        return text

    def answer(pattern: str) -> Any:
        return json.loads(printed(pattern))

    tried, kept, raw = answer(r"/runs\.tar\.gz .*datasets\?dry_run"), answer("-F name=paper "), answer("-X POST -T ")
    assert (tried["stored"], kept["created"], raw["stored"]) == (False, True, True)
    assert tried["id"] == kept["id"] == raw["id"]
    assert answer("-F slope_deg=28 ")["report"]["summary"]["runs"] == 1
    assert (made / "paper.svg").read_bytes().startswith(b"<?xml")
    assert (made / "paper.parquet").read_bytes().startswith(b"PAR1")
    assert (made / "token").stat().st_mode & 0o077 == (made / "admin").stat().st_mode & 0o077 == 0

    events, rest = (
        re.findall(r"^id: (\d+)$", printed(f"{part}.*/events$"), re.MULTILINE) for part in ("admin http", "Last-")
    )
    assert rest == events[6:]
    result = answer(r"training-jobs/\$JOB$")["result"]
    assert (result["version"], result["promoted"]) == (6, False)
    assert result["comparison"]["sentence"].split() == _shown_sentence()
    assert "viper-lunar@candidate is version 6" in printed("/logs$")

    moved, back = answer("-X PUT "), answer("/rollback$")
    assert (moved["version"], moved["actor"], back["version"]) == (6, "admin", 5)
    assert answer("/v1/predictions")["model"]["version"] == 6
    assert [move["version"] for move in answer("/history$")["history"]] == [5, 6, 5, 4, 3, 2, 1]
    assert answer("/cancel$")["state"] == "cancelled"
    assert [job["id"] for job in answer("state=cancelled")["jobs"]] == [answer("/cancel$")["id"]]

    assert "viper-lunar@7" in printed("jobs start .*if_better")
    assert "viper-lunar@8" in printed("jobs start .*paper --watch")
    assert "the same weights" in printed("train --like")


def _shown_sentence() -> list[str]:
    (shown,) = re.findall(r"^    (viper-lunar@6 is .*?)\n\n", PAGE.read_text(), re.MULTILINE | re.DOTALL)
    words: list[str] = shown.split()
    return words
