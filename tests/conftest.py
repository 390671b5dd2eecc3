"""One behaviour of the test tools for everybody.

The same examples each time and no gating by the clock. Test runs beside each other, or beside anything else on the
machine, share no temporary files and leave each other their processors. What a marker says of a test is true.
"""

from __future__ import annotations

import os
import signal
import sys
import tempfile
from collections.abc import Iterator
from typing import Any

import pytest
import uvloop
from hypothesis import HealthCheck, settings

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before torch and numpy read it; idle threads of theirs spin

settings.register_profile(
    "rover-twin", derandomize=True, deadline=None, max_examples=50, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("rover-twin")

_STARTS_A_PROCESS = ("subprocess.Popen", "os.fork", "os.forkpty", "os.posix_spawn")
_ASKED = ("git", "file", "fc-list")  # they answer at once: which version this is, which machine, which fonts
_started: list[str] = []


@pytest.fixture(scope="session", autouse=True)
def own_temporary_files(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """A folder for the temporary files of this run and of the processes that it starts; its path is short."""
    tmp_path_factory.getbasetemp()  # remains where pytest keeps the last ones
    with (
        tempfile.TemporaryDirectory(prefix="rover", ignore_cleanup_errors=True) as folder,
        pytest.MonkeyPatch.context() as patch,
    ):
        patch.setenv("TMPDIR", folder)
        patch.setattr(tempfile, "tempdir", folder)
        yield


@pytest.fixture(scope="session", autouse=True)
def interruptible_processes() -> Iterator[None]:
    """Processes that tests start can be interrupted, also where these tests run in the background of a shell.

    There they ignore SIGINT, which a new process inherits; it does not inherit a handler that does nothing.
    """
    before = signal.getsignal(signal.SIGINT)
    if before == signal.SIG_IGN:
        signal.signal(signal.SIGINT, lambda *_: None)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(scope="session")
def processes() -> None:
    """For fixtures that start processes: who asks for one of them gets the marker of this name."""


@pytest.fixture(scope="session")
def slow() -> None:
    """The same for fixtures that take seconds."""


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Add the markers that follow from fixtures and from other markers. Files whose tests kill take longest: first."""
    for item in items:
        for name in {"processes", "slow"}.intersection(getattr(item, "fixturenames", ())):
            item.add_marker(name)
        if any(item.get_closest_marker(name) for name in ("kills", "e2e", "image")):
            item.add_marker("processes")
    killing = {item.path for item in items if item.get_closest_marker("kills")}
    items.sort(key=lambda item: item.path not in killing)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> Iterator[None]:
    return (yield from _watched(item))


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_call(item: pytest.Item) -> Iterator[None]:
    return (yield from _watched(item))


def _watched(item: pytest.Item) -> Iterator[None]:
    _started.clear()
    result = yield
    if _started and not item.get_closest_marker("processes"):
        pytest.fail(f"starts a process and is not marked `processes`: {_started}", pytrace=False)
    return result


def _hear_of_processes(event: str, arguments: tuple[Any, ...]) -> None:
    """An audit hook: it hears of every process, whichever thread of this one starts it."""
    if event in _STARTS_A_PROCESS and (not arguments or arguments[0] not in _ASKED):
        _started.append(f"{event} {arguments[:1]}")


sys.addaudithook(_hear_of_processes)


@pytest.fixture(scope="session", autouse=True)
def processes_of_services() -> Iterator[None]:
    """A service in one of our threads starts its processes through uvloop, which tells no audit hook: here it does."""
    start = uvloop.Loop.subprocess_exec

    async def subprocess_exec(loop: uvloop.Loop, make: Any, program: str, *arguments: Any, **how: Any) -> Any:
        sys.audit("subprocess.Popen", program, arguments, None, None)
        return await start(loop, make, program, *arguments, **how)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(uvloop.Loop, "subprocess_exec", subprocess_exec)
        yield
