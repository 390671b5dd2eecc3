"""Several server processes on one port: started together, started again when one dies, ended together.

They share a listening socket, the folder of their metrics and one training worker, which the first of them looks after.
"""

from __future__ import annotations

import json
import signal
import socket
import tempfile
from collections.abc import AsyncIterator
from functools import partial
from typing import Any

import anyio
import structlog
import uvicorn
from anyio.abc import Process
from prometheus_client.multiprocess import mark_process_dead

from model_store import ModelStore
from service import child
from service.access.tokens import Tokens
from service.cpu import available_cpus
from service.log import configure_logging
from service.settings import Settings

_PAUSES_S = 0.5, 30.0  # the first and the longest
_END_S = 5.0  # beyond drain and grace: what a process may need to tidy up

_log = structlog.get_logger(__name__)


def run_processes(settings: Settings) -> None:
    """Serve with `settings.workers` processes until a signal comes, which then ends this process too.

    Each is told of SIGTERM or SIGINT once, and ends as a single one would. Raises what `ModelStore.open` and
    `Tokens` raise, and SystemExit when the address cannot be listened on.
    """
    configure_logging(settings.log_level, settings.log_format)
    # what is wrong with these shall end this process, and not each of them again
    ModelStore.open(settings.store_url)
    Tokens(path=settings.tokens_file)
    place = uvicorn.Config("service.app:create_app", host=settings.host, port=settings.port, log_config=None)
    with (
        place.bind_socket() as listener,
        tempfile.TemporaryDirectory(prefix="rover-twin-metrics-", ignore_cleanup_errors=True) as folder,
    ):
        received = anyio.run(_Processes(settings, listener, folder).run)
    signal.raise_signal(received)


class _Processes:
    def __init__(self, settings: Settings, listener: socket.socket, folder: str) -> None:
        self._settings = settings
        self._listener = listener
        self._folder = folder
        self._running: dict[int, Process] = {}
        self._ending = anyio.Event()

    async def run(self) -> signal.Signals:
        """Returns the first signal, once all processes have ended."""
        async with anyio.create_task_group() as tasks:
            with anyio.open_signal_receiver(signal.SIGTERM, signal.SIGINT) as signals:
                async with anyio.create_task_group() as lives:
                    for index in range(self._settings.workers):
                        lives.start_soon(self._keep, index)
                    received = await anext(signals)
                    self._ending.set()
                    self._tell(received)
                    self._listener.close()  # else clients are let in whom nobody answers when the others have closed it
                    tasks.start_soon(self._kill_late)
                    tasks.start_soon(self._pass_on, signals)
                tasks.cancel_scope.cancel()
        return received

    async def _pass_on(self, signals: AsyncIterator[signal.Signals]) -> None:
        """Another signal: whoever sends it does not want to wait."""
        async for received in signals:
            self._tell(received)

    def _tell(self, received: signal.Signals) -> None:
        for process in self._running.values():
            if process.returncode is None:
                process.send_signal(received)

    async def _kill_late(self) -> None:
        await anyio.sleep(self._settings.drain_s + self._settings.shutdown_grace_s + _END_S)
        _log.warning("server processes that do not end are killed", pids=[each.pid for each in self._running.values()])
        self._tell(signal.SIGKILL)

    async def _keep(self, index: int) -> None:
        await child.keep(partial(self._live, index), self._ending, _PAUSES_S, "a server process", index=index)

    async def _live(self, index: int) -> int:
        """One life of a process; its exit code."""
        listener = self._listener.fileno()
        settings = _handed_down(self._settings, index)
        task = json.dumps({"index": index, "listener": listener, "folder": self._folder, "settings": settings}).encode()
        try:
            async with child.started("service.server:run_process", task=task, pass_fds=[listener]) as process:
                self._running[index] = process
                if self._ending.is_set():  # the signal came while it started
                    process.terminate()
                return await process.wait()
        finally:
            self._running.pop(index, None)
            mark_process_dead(index, self._folder)  # type: ignore[no-untyped-call]


def _handed_down(settings: Settings, index: int) -> dict[str, Any]:
    """The settings of one process."""
    threads = settings.threads or max(1, available_cpus() // settings.workers)
    own = settings.model_copy(
        update={"workers": 1, "threads": threads, "start_worker": settings.start_worker and index == 0}
    )
    fields = own.model_dump(mode="json", exclude={"admin_token"})
    if own.admin_token is not None:
        fields["admin_token"] = own.admin_token.get_secret_value()
    return fields
