"""The training worker that `serve` keeps beside the API: started, started again when it dies, ended with it."""

from __future__ import annotations

import json
import sys
import time
from typing import Literal

import anyio
import structlog
from anyio.abc import Process

from service.settings import Settings

State = Literal["off", "running", "pausing"]

FIRST_PAUSE_S = 1.0
LONGEST_PAUSE_S = 60.0
# A worker that lived this long was well: the next pause is the first one again.
_WELL_AFTER_S = 60.0
_END_S = 25.0
# with this process's own import path: a checkout that is not installed works too
_PROGRAM = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1]); "
    "from service.cli.main import main; sys.exit(main(['worker', '--supervised']))"
)

_log = structlog.get_logger(__name__)


class WorkerSupervisor:
    """One worker process. It ends by itself when the pipe to this process closes, so it never outlives it."""

    def __init__(self, settings: Settings, *, first_pause_s: float = FIRST_PAUSE_S) -> None:
        self._settings = settings.model_dump_json(exclude={"admin_token"}).encode() + b"\n"
        self._first_pause_s = first_pause_s
        self._ending = anyio.Event()
        self.state: State = "off"
        self.restarts = 0
        self.pid: int | None = None

    async def run(self) -> None:
        """Keep a worker running until `end`."""
        pause = self._first_pause_s
        while not self._ending.is_set():
            started = time.monotonic()
            try:
                code = await self._live()
            except OSError as error:
                code = None
                _log.warning("the training worker cannot be started", reason=str(error))
            if self._ending.is_set():
                break
            if time.monotonic() - started >= _WELL_AFTER_S:
                pause = self._first_pause_s
            self.restarts += 1
            self.state = "pausing"
            _log.warning("the training worker ended, it is started again", code=code, pause_s=pause)
            with anyio.move_on_after(pause):
                await self._ending.wait()
            pause = min(2 * pause, LONGEST_PAUSE_S)
        self.state = "off"

    def end(self) -> None:
        """Let the worker hand back its job and end; `run` returns when it has, after 25 s at most."""
        self._ending.set()

    async def _live(self) -> int:
        """One life of the worker; its exit code."""
        command = [sys.executable, "-c", _PROGRAM, json.dumps(sys.path)]
        process = await anyio.open_process(command, stdout=None, stderr=None)
        self.pid, self.state = process.pid, "running"
        try:
            assert process.stdin is not None
            await process.stdin.send(self._settings)
            async with anyio.create_task_group() as tasks:
                tasks.start_soon(self._close_when_ending, process)
                code = await process.wait()
                tasks.cancel_scope.cancel()
        except anyio.BrokenResourceError:  # it died before it read its settings
            code = await process.wait()
        finally:
            self.pid = None
            with anyio.CancelScope(shield=True):
                if process.returncode is None:
                    process.kill()
                await process.aclose()
        return code

    async def _close_when_ending(self, process: Process) -> None:
        await self._ending.wait()
        assert process.stdin is not None
        await process.stdin.aclose()
        await anyio.sleep(_END_S)
        _log.warning("the training worker did not end and is killed", pid=process.pid)
        process.kill()
