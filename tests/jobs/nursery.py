"""Real worker and API processes for tests, in a tenth of a second each.

Run as a program this file is the nursery: it imports torch and dbos once, then forks a process per line on stdin. It
forks before anything is opened, because what is opened has threads.
"""

from __future__ import annotations

import functools
import json
import os
import queue
import signal
import subprocess
import sys
import tempfile
import threading
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

ROOT = Path(__file__).parents[2]
CHUNK_S = 0.25


class WorkerProcess:
    """One worker, or API; `code` is its exit code once it has ended."""

    def __init__(self, pid: int) -> None:
        self.pid = pid
        self.code: int | None = None
        self._ended = threading.Event()

    def kill(self) -> None:
        with suppress(ProcessLookupError):  # it has just ended by itself
            os.kill(self.pid, signal.SIGKILL)
        self.wait()

    def terminate(self) -> None:
        os.kill(self.pid, signal.SIGTERM)

    def wait(self, timeout_s: float = 60) -> int | None:
        assert self._ended.wait(timeout_s), f"worker {self.pid} did not end within {timeout_s} s"
        return self.code

    def ended(self, code: int) -> None:
        self.code = code
        self._ended.set()


class Nursery:
    """Starts workers, and ends those that a test leaves. `heard` is called with pid and step by those `aloud`."""

    def __init__(self, *, apis: bool = False, heard: Callable[[int, str], None] | None = None) -> None:
        self._apis = apis
        self._heard = heard
        self._ordering = threading.Lock()

    def __enter__(self) -> Self:
        self._process = subprocess.Popen(
            [sys.executable, __file__, *(["apis"] if self._apis else [])],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
        )
        self._workers: dict[int, WorkerProcess] = {}
        self._born: queue.Queue[WorkerProcess] = queue.Queue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        return self

    def __exit__(self, *_: object) -> None:
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait(30)
        self._reader.join(30)
        assert self._process.stdout is not None
        self._process.stdout.close()

    def start(
        self, store: Path | str, url: str, *, once: bool = False, deadly: bool = False, aloud: bool = False
    ) -> WorkerProcess:
        """A worker; a `deadly` one dies whenever it begins to run a job, one that is `aloud` says what it begins."""
        return self._order(kind="worker", store=str(store), url=url, once=once, deadly=deadly, aloud=aloud)

    def serve(self, temporary: Path, **settings: Any) -> WorkerProcess:
        """An API with these settings and `temporary` for its temporary files; of a nursery with `apis` only."""
        return self._order(kind="api", temporary=str(temporary), settings=settings)

    def _order(self, **order: Any) -> WorkerProcess:
        assert self._process.stdin is not None
        with self._ordering:
            self._process.stdin.write(json.dumps(order) + "\n")
            self._process.stdin.flush()
            return self._born.get(timeout=60)

    def end_all(self) -> None:
        for worker in self._workers.values():
            if worker.code is None:
                worker.kill()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            word, pid, code = line.split()
            if word == "begins":
                if self._heard is not None:
                    self._heard(int(pid), code)
            elif word == "born":
                self._workers[int(pid)] = WorkerProcess(int(pid))
                self._born.put(self._workers[int(pid)])
            else:
                self._workers[int(pid)].ended(int(code))


def until(condition: Any, timeout_s: float = 60, what: str = "") -> Any:
    """What `condition` returns once that is true."""
    deadline = time.monotonic() + timeout_s
    while time.monotonic() < deadline:
        if found := condition():
            return found
        time.sleep(0.05)
    raise AssertionError(f"not within {timeout_s} s: {what or condition}")


def _tell(*words: object) -> None:
    os.write(1, (" ".join(map(str, words)) + "\n").encode())


def _work(order: dict[str, Any]) -> None:
    from service.jobs import worker, workflow
    from service.log import configure_logging
    from service.settings import Settings

    configure_logging("warning")
    workflow.CHUNK_S = CHUNK_S
    worker.ROUND_S = 0.3
    worker.POLL_S = 0.1
    if order["aloud"]:
        _tell_steps()
    if order["deadly"]:
        worker.Worker.enter = lambda *_: os.kill(os.getpid(), signal.SIGKILL)  # type: ignore[assignment]
    ending = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: ending.set())
    settings = Settings(store_url=order["store"], jobs_database_url=order["url"], worker_threads=1)
    worker.run_worker(settings, ending, once=order["once"])


def _tell_steps() -> None:
    """Each step says so when it really begins; what an earlier attempt has finished is not run again."""
    from service.jobs import worker
    from service.jobs.attempt import Attempt
    from service.training import promotion

    def telling(work: Callable[..., Any], name: str) -> Callable[..., Any]:
        @functools.wraps(work)
        def told(*arguments: Any) -> Any:
            _tell("begins", os.getpid(), name)
            return work(*arguments)

        return told

    run_step, move, leave = Attempt.step, promotion._move, worker.Worker.leave
    Attempt.step = lambda attempt, step, *rest: run_step(attempt, telling(step, step.__name__.strip("_")), *rest)
    worker.Worker.leave = telling(leave, "leave")  # type: ignore[method-assign]
    promotion._move = lambda store, made, alias, *rest: telling(move, f"move_{alias}")(store, made, alias, *rest)


def _serve(order: dict[str, Any]) -> None:
    from service.server import run_server
    from service.settings import Settings

    tempfile.tempdir = order["temporary"]
    run_server(Settings(log_level="error", **order["settings"]))


def _bury(pid: int) -> None:
    _tell("ended", pid, os.waitpid(pid, 0)[1])


def _main() -> None:
    import pyarrow.parquet  # noqa: F401 - the first job would import it
    import torch

    import service.jobs.worker

    weight = torch.nn.Parameter(torch.zeros(1))
    weight.grad = torch.ones(1)
    torch.optim.Adam([weight]).step()  # torch imports the larger half of itself at the first step
    if "apis" in sys.argv:
        import service.jobs.database
        import service.server  # noqa: F401

    for line in sys.stdin:
        pid = os.fork()
        if pid == 0:
            code = 1
            try:
                order = json.loads(line)
                (_serve if order.pop("kind") == "api" else _work)(order)
                code = 0
            except Exception:
                traceback.print_exc()
            finally:
                sys.stderr.flush()
                os._exit(code)
        _tell("born", pid, 0)
        threading.Thread(target=_bury, args=(pid,), daemon=True).start()


if __name__ == "__main__":
    _main()
