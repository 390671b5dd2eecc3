"""The training worker that `serve` keeps beside the API: started, started again when it dies, ended with it."""

from __future__ import annotations

import anyio
import structlog
from anyio.abc import Process

from service import child
from service.settings import Settings

_PAUSES_S = 1.0, 60.0  # the first and the longest
_END_S = 25.0

_log = structlog.get_logger(__name__)


class WorkerSupervisor:
    """One worker process. It ends by itself when the pipe to this process closes, so it never outlives it."""

    def __init__(self, settings: Settings, *, pauses_s: tuple[float, float] = _PAUSES_S) -> None:
        self._settings = settings.model_dump_json(exclude={"admin_token"}).encode()
        self._end_s = min(_END_S, max(1.0, settings.shutdown_grace_s - 1.0))
        self._pauses_s = pauses_s
        self._ending = anyio.Event()
        self.pid: int | None = None  # None while none runs

    async def run(self) -> None:
        """Keep a worker running until `end`."""
        await child.keep(self._live, self._ending, self._pauses_s, "the training worker")

    def end(self) -> None:
        """Let the worker hand back its job and end; `run` returns when it has, within 25 s and the service's grace."""
        self._ending.set()

    async def _live(self) -> int:
        """One life of the worker; its exit code."""
        try:
            async with child.started("service.cli.main:main", "worker", "--supervised", task=self._settings) as process:
                self.pid = process.pid
                async with anyio.create_task_group() as tasks:
                    tasks.start_soon(self._close_when_ending, process)
                    code = await process.wait()
                    tasks.cancel_scope.cancel()
        finally:
            self.pid = None
        return code

    async def _close_when_ending(self, process: Process) -> None:
        await self._ending.wait()
        assert process.stdin is not None
        await process.stdin.aclose()
        await anyio.sleep(self._end_s)
        _log.warning("the training worker did not end and is killed", pid=process.pid)
        process.kill()
