"""Children of ours: given their task, restrained, killed in time, and gone with their parent."""

from __future__ import annotations

import functools
import json
import os
import resource
import signal
import subprocess
import sys
import time
from types import SimpleNamespace

import anyio
import psutil
import pytest
import structlog

from service import child

HERE = "tests.test_child"
pytestmark = pytest.mark.kills


# ---- what the children of these tests run


def tell():
    """What a child finds: its task, arguments, import path, signals and priority."""
    task = json.loads(child.given_task())
    child.restrain(cpu_s=7, wall_s=60, memory_bytes=1 << 30)
    found = {
        "task": task,
        "arguments": sys.argv[1:],
        "path": sys.path,
        "signals": [signal.getsignal(each).name for each in (signal.SIGINT, signal.SIGTERM)],
        "niceness": os.nice(0),
        "session": os.getsid(0),
        "pid": os.getpid(),
        "processor": resource.getrlimit(resource.RLIMIT_CPU)[0],
        "bounded": resource.getrlimit(resource.RLIMIT_AS)[0] != resource.RLIM_INFINITY,
        "alarm": signal.alarm(0),
    }
    print(json.dumps(found))
    print("and on stderr", file=sys.stderr)
    return 3


def wait():
    """Tells its task, then waits for its end."""
    print(child.given_task().decode().strip(), flush=True)
    time.sleep(600)


def wait_on():
    """As `wait`, but does not heed SIGTERM."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    wait()


def parent():
    """Has a child of its own until it is ended itself."""

    async def have_a_child():
        async with child.started(f"{HERE}:wait", task=b"ready") as process:
            await process.wait()

    child.reset_signals()
    anyio.run(have_a_child)


# ---- what is true of all of them


@pytest.fixture(params=[False, True], ids=["asyncio", "uvloop"])
def run(request):
    """`anyio.run` on the loop of the command line, and on that of the server."""
    return functools.partial(anyio.run, backend_options={"use_uvloop": request.param})


def asked(run, function, task=b"{}", *, within_s=60.0):
    return run(lambda: child.ask(function, task, within_s=within_s))


def test_a_child_finds_its_task_its_parents_imports_and_ordinary_signals(run):
    done = asked(run, f"{HERE}:tell", json.dumps({"text": "ä" * 200_000}).encode())
    found = json.loads(done.stdout)

    assert (done.returncode, done.stderr) == (3, b"and on stderr\n")
    assert found["task"] == {"text": "ä" * 200_000}  # more than a pipe holds
    assert found["path"] == sys.path
    assert found["arguments"] == []
    assert found["signals"] == ["SIG_DFL", "SIG_DFL"]
    assert found["session"] == found["pid"]
    assert (found["niceness"], found["processor"]) == (os.nice(0) + child.NICENESS, 7)
    assert 0 < found["alarm"] <= 70
    assert found["bounded"] == (sys.platform == "linux")


def test_modules_of_the_folder_that_a_parent_stands_in_do_not_take_the_place_of_ours(tmp_path, monkeypatch):
    (tmp_path / "json.py").write_text("raise SystemExit(9)")
    monkeypatch.chdir(tmp_path)
    assert asked(anyio.run, f"{HERE}:tell").returncode == 3


def test_one_that_dies_unread_tells_its_exit_code(run):
    assert asked(run, "os:abort", b" " * 10_000_000).returncode == -signal.SIGABRT


@pytest.mark.parametrize("function", ["wait", "wait_on"])
def test_a_deadline_ends_it_for_good(run, function):
    before = psutil.Process().children()
    with pytest.raises(TimeoutError):
        asked(run, f"{HERE}:{function}", within_s=1.5)
    assert psutil.Process().children() == before


def test_no_child_is_left_when_the_block_is_cancelled(run):
    pids = []

    async def cancelled():
        async with child.started(f"{HERE}:wait_on", task=b"") as process:
            pids.append(process.pid)
            with anyio.CancelScope() as scope:
                scope.cancel()
                await process.wait()

    run(cancelled)
    assert not psutil.pid_exists(pids[0])


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_a_child_ends_with_its_parent_however_that_ends(number):
    with subprocess.Popen(
        [sys.executable, "-c", f"from {HERE} import parent; parent()"],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
    ) as process:
        try:
            assert process.stdout.readline().startswith(b"ready")
            process.send_signal(number)
            process.wait(timeout=60)
            assert process.stdout.read() == b""  # which the child holds open as long as it lives
        finally:
            process.kill()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_child_and_a_reset_process_also_where_it_was_ignored(run, number):
    before = signal.signal(number, signal.SIG_IGN)
    try:

        async def ended():
            async with child.started(f"{HERE}:wait", task=b"", captured=True) as process:
                await process.stdout.receive()
                process.send_signal(number)
                return await process.wait()

        assert run(ended) == -number
        reset = f"from service.child import reset_signals as r; r(); import signal; signal.raise_signal({number.value})"
        done = subprocess.run([sys.executable, "-c", reset], capture_output=True, timeout=60)
        assert done.returncode == -number
    finally:
        signal.signal(number, before)


def test_a_child_is_started_again_after_growing_pauses_until_the_end(monkeypatch):
    lasted_s = [0.0, 0.001, 0.0039, 0.0, 0.004, 0.0, 0.0]  # the fifth is as long as the longest pause
    clock, lives = [0.0], []
    monkeypatch.setattr(child, "time", SimpleNamespace(monotonic=lambda: clock[0]))

    async def kept():
        ending = anyio.Event()

        async def live():
            lives.append(len(lives))
            clock[0] += lasted_s[lives[-1]]
            if len(lives) == len(lasted_s):
                ending.set()
            if lives[-1] == 3:
                raise OSError("no more processes")
            return lives[-1]

        with anyio.fail_after(60):
            await child.keep(live, ending, (0.001, 0.004), "a child", index=5)

    with structlog.testing.capture_logs() as lines:
        anyio.run(kept)
    ends = [each for each in lines if each["event"] == "a child ended, it is started again"]
    assert [each["pause_s"] for each in ends] == [0.001, 0.002, 0.004, 0.004, 0.001, 0.002]
    assert [each["code"] for each in ends] == [0, 1, 2, None, 4, 5]
    assert {each["index"] for each in lines} == {5}
    assert lives == list(range(7))
