"""A child process of ours, both sides: how it is started and told what to do, how it ends and is waited for.

A child runs one function, `module:function`, with its parent's import path: a checkout that is not installed works
too. What to do is one line on its stdin, because arguments and environment show in the list of processes. The pipe
stays open while the parent lives; when it closes, the child sends itself SIGTERM. Ctrl+C in a terminal does not reach
a child, its parent tells it to end.
"""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import sys
import threading
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from contextlib import asynccontextmanager, suppress
from pathlib import Path

import anyio
import structlog
from anyio.abc import ByteReceiveStream, Process

NICENESS = 10
_MOST_SAID_BYTES = 64 << 20
# First of all the signals: until its function says otherwise, each of the two ends a child without a word.
_PROGRAM = """
import signal
for number in signal.SIGINT, signal.SIGTERM:
    signal.signal(number, signal.SIG_DFL)
import importlib, json, sys
sys.path[:] = json.loads(sys.argv.pop(1))
module, function = sys.argv.pop(1).split(":")
sys.exit(getattr(importlib.import_module(module), function)())
"""

_log = structlog.get_logger(__name__)


def reset_signals() -> None:
    """Let SIGINT and SIGTERM end this process again: a script that starts it in the background has SIGINT ignored."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)


# ---- the parent's side


@asynccontextmanager
async def started(
    function: str, *arguments: str, task: bytes, pass_fds: Sequence[int] = (), captured: bool = False
) -> AsyncIterator[Process]:
    """A child that has been given its `task`, one line; when the block ends it is killed, if need be, and reaped.

    Its stdout and stderr are those of this process, or pipes when `captured`. Raises OSError when it cannot be started.
    """
    output = subprocess.PIPE if captured else None
    process = await anyio.open_process(
        [sys.executable, "-P", "-c", _PROGRAM, json.dumps(sys.path), function, *arguments],
        stdout=output,
        stderr=output,
        pass_fds=pass_fds,
        start_new_session=True,
    )
    try:
        assert process.stdin is not None
        with suppress(anyio.BrokenResourceError):  # it died before it read: its exit code says so
            await process.stdin.send(task + b"\n")
        yield process
    finally:
        with anyio.CancelScope(shield=True):
            if process.returncode is None:
                process.kill()
            await process.aclose()


async def ask(function: str, task: bytes, *, within_s: float) -> subprocess.CompletedProcess[bytes]:
    """What a child wrote to stdout and stderr, and how it ended. When the awaiting task is cancelled, it is killed.

    Raises TimeoutError after `within_s`; the child is killed then, too.
    """
    said, complained = bytearray(), bytearray()
    with anyio.fail_after(within_s):
        async with started(function, task=task, captured=True) as process:
            async with anyio.create_task_group() as tasks:
                tasks.start_soon(_collect, process.stdout, said)
                tasks.start_soon(_collect, process.stderr, complained)
            code = await process.wait()
    return subprocess.CompletedProcess(function, code, bytes(said), bytes(complained))


async def _collect(stream: ByteReceiveStream | None, into: bytearray) -> None:
    assert stream is not None
    async for piece in stream:
        into += piece[: _MOST_SAID_BYTES - len(into)]  # the rest is read, so that the child can end, and dropped


async def keep(
    live: Callable[[], Awaitable[int]], ending: anyio.Event, pauses_s: tuple[float, float], what: str, **facts: object
) -> None:
    """Start a child again whenever it dies, until `ending`. `live` is one life of it and returns its exit code.

    `pauses_s` are the first and the longest pause; in between they double. After a life as long as the longest one,
    the next pause is the first one again. `what` and `facts` name the child in the log.
    """
    pause, longest = pauses_s
    while not ending.is_set():
        code, began = None, time.monotonic()
        try:
            code = await live()
        except OSError as error:
            _log.warning(f"{what} cannot be started", **facts, reason=str(error))
        if ending.is_set():
            return
        if time.monotonic() - began >= longest:
            pause = pauses_s[0]
        _log.warning(f"{what} ended, it is started again", **facts, code=code, pause_s=pause)
        with anyio.move_on_after(pause):
            await ending.wait()
        pause = min(2 * pause, longest)


# ---- the child's side


def given_task() -> bytes:
    """The line that the parent wrote. From here on this process ends with its parent."""
    line = sys.stdin.buffer.readline()
    threading.Thread(target=_end_with_the_parent, name="parent's pipe", daemon=True).start()
    return line


def _end_with_the_parent() -> None:
    while os.read(0, 1024):  # not through sys.stdin, whose lock would be held when this process ends by itself
        pass
    os.kill(os.getpid(), signal.SIGTERM)


def restrain(*, cpu_s: int, wall_s: int, memory_bytes: int | None = None) -> None:
    """Low priority and hard bounds for this process, for `memory_bytes` beyond the address space that it has now.

    `wall_s` is the parent's deadline; an alarm keeps it, seconds later, where the parent cannot any more.
    """
    os.nice(NICENESS)
    resource.setrlimit(resource.RLIMIT_CPU, (cpu_s, cpu_s + 5))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    signal.alarm(wall_s + 10)
    if memory_bytes is not None and sys.platform == "linux":
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
        most = pages * resource.getpagesize() + memory_bytes
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
