"""Clients of a service that wants a token for everything: all of them send theirs, with every call."""

from __future__ import annotations

import asyncio
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from rover_twin_client import AsyncRoverTwin, NotAllowedError, RoverTwin
from service.access.token_file import StoredToken, add
from service.access.tokens import digest_of, new_token
from tests.clients.test_driving import free_port, wait_until_ready

REPOSITORY = Path(__file__).parents[2]
SCENARIO = (28, 430, 60)

pytestmark = pytest.mark.processes


@pytest.fixture(scope="module")
def token() -> str:
    return new_token()


@pytest.fixture(scope="module")
def url(tmp_path_factory: pytest.TempPathFactory, token: str) -> Iterator[str]:
    folder, port = tmp_path_factory.mktemp("guarded"), free_port()
    add(folder / "tokens", StoredToken("joe", "read", digest_of(token.encode())))
    settings = {
        "ROVER_TWIN_TOKENS_FILE": str(folder / "tokens"),
        "ROVER_TWIN_REQUIRE_TOKEN": "true",
        "ROVER_TWIN_START_WORKER": "false",
    }
    kept = {name: value for name, value in os.environ.items() if not name.startswith("ROVER_TWIN_")}
    command = [sys.executable, "-m", "service", "serve", "--port", str(port)]
    with (
        (folder / "log.txt").open("w") as log,
        subprocess.Popen(command, cwd=REPOSITORY, env=kept | settings, stdout=log, stderr=log) as process,
    ):
        try:
            wait_until_ready(f"http://127.0.0.1:{port}", process, folder / "log.txt")
            yield f"http://127.0.0.1:{port}"
        finally:
            process.kill()


def test_with_the_token_everything_answers(url: str, token: str) -> None:
    with RoverTwin(url, token=token) as twin:
        assert twin.predict(*SCENARIO, 10).summary.final_x_m > 0
        for transport in ("websocket", "http"):
            with twin.live(transport=transport) as live:
                live.start("a", mass_kg=430)
                assert live.step("a", 10, 100, 0.5).x_m > 0
        with pytest.raises(NotAllowedError, match="insufficient-scope"):
            twin.move_alias("viper-lunar", "mine", 1, "to see")


async def _live_without(url: str) -> None:
    async with AsyncRoverTwin(url) as twin, twin.live() as live:
        live.start("a", mass_kg=430)
        await live.step("a", 10, 100, 0.5)


def test_without_it_nothing_does_and_the_error_says_so(url: str) -> None:
    with RoverTwin(url) as twin:
        assert twin.ready().model.name == "viper-lunar"
        with pytest.raises(NotAllowedError, match="HTTP 401"):
            twin.predict(*SCENARIO, 10)
        with twin.live() as live:
            live.start("a", mass_kg=430)
            with pytest.raises(NotAllowedError, match="HTTP 401"):
                live.step("a", 10, 100, 0.5)
    with pytest.raises(NotAllowedError, match="HTTP 401"):
        asyncio.run(_live_without(url))


@pytest.mark.skipif(shutil.which("curl") is None, reason="curl is not installed")
@pytest.mark.parametrize(
    ("script", "arguments", "text"),
    [
        ("predict.sh", ["28", "430", "60"], ""),
        ("drive.sh", ["430", "100", "2", "0:10"], ""),
        ("steps.sh", ["430"], "10 100 0.5\n15 100 0.5\n"),
    ],
)
def test_scripts_send_it_too(url: str, token: str, script: str, arguments: list[str], text: str) -> None:
    def run(**more: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            ["sh", str(REPOSITORY / "clients" / "curl" / script), *arguments],
            env=os.environ | {"ROVER_TWIN_URL": url} | more,
            input=text,
            capture_output=True,
            text=True,
            check=False,
            timeout=60,
        )

    done = run(ROVER_TWIN_TOKEN=token + "\n")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout
    for wrong in (run(), run(ROVER_TWIN_TOKEN='a "wrong" \\one')):
        assert wrong.returncode == 1
        assert "token" in wrong.stderr
        assert len(wrong.stderr.splitlines()) == 1
