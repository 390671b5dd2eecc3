"""`rover-twin worker`: a process that runs training jobs."""

from __future__ import annotations

import os
import signal
import sys
import threading
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from service.cli import options

if TYPE_CHECKING:
    from service.settings import Settings

_NICENESS = 10
_MOST_SETTINGS_BYTES = 1 << 20


def worker(
    threads: Annotated[
        int | None,
        typer.Option(help="Processor threads. Default: ROVER_TWIN_WORKER_THREADS, else 1.", show_default=False),
    ] = None,
    once: Annotated[bool, typer.Option("--once", help="End when no job is left, instead of waiting for more.")] = False,
    log_level: Annotated[
        Literal["debug", "info", "warning", "error"] | None,
        typer.Option(help="Least severe messages to log. Default: info.", show_default=False),
    ] = None,
    store: options.Store = None,
    supervised: Annotated[bool, typer.Option("--supervised", hidden=True)] = False,
) -> None:
    """Run training jobs from the queue, one at a time, until Ctrl-C or SIGTERM; the job is then handed back.

    `rover-twin serve` starts one by itself when it has an admin token. Run more of them, on any machine that reaches
    the store and the jobs' database (ROVER_TWIN_JOBS_DATABASE_URL); when one dies, another goes on with its job.

    Examples:
    A worker beside a service that starts none (ROVER_TWIN_START_WORKER=false):
      rover-twin worker --threads 4

    All jobs that wait now, then end, as in a nightly batch:
      rover-twin worker --once
    """
    if hasattr(os, "nice"):
        os.nice(_NICENESS)  # before any library starts threads, which inherit it
    ending = threading.Event()
    settings = _given_settings(ending) if supervised else _own_settings(threads, log_level, store)
    os.environ["OPENBLAS_NUM_THREADS"] = os.environ["OMP_NUM_THREADS"] = str(settings.worker_threads)
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: ending.set())

    from service.jobs.worker import run_worker
    from service.log import configure_logging

    configure_logging(settings.log_level, settings.log_format)
    run_worker(settings, ending, once=once)
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)  # dbos leaves threads that wait for jobs which others run now


def _own_settings(threads: int | None, log_level: str | None, store: str | None) -> Settings:
    from service.settings import load_settings

    return load_settings(worker_threads=threads, log_level=log_level, store_url=store)


def _given_settings(ending: threading.Event) -> Settings:
    """What the supervisor writes into the pipe first; the pipe closes when it is gone, which ends this worker."""
    from service.settings import Settings

    settings = Settings.model_validate_json(sys.stdin.buffer.readline(_MOST_SETTINGS_BYTES))

    def wait_for_the_end() -> None:
        sys.stdin.buffer.read()
        ending.set()

    threading.Thread(target=wait_for_the_end, name="supervisor's pipe", daemon=True).start()
    return settings
