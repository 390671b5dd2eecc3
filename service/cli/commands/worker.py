"""`rover-twin worker`: a process that runs training jobs."""

from __future__ import annotations

import os
import signal
import sys
import threading
from typing import Annotated, Literal

import typer

from service.cli import options
from service.cli.failures import report


def worker(
    context: typer.Context,
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
    from service import child, parts
    from service.settings import Settings, load_settings

    parts.require(parts.TRAINING, "a training worker")
    if hasattr(os, "nice"):
        os.nice(child.NICENESS)  # before any library starts threads, which inherit it
    if supervised:
        settings = Settings.model_validate_json(child.given_task())
    else:
        settings = load_settings(worker_threads=threads, log_level=log_level, store_url=store)
    os.environ["OPENBLAS_NUM_THREADS"] = os.environ["OMP_NUM_THREADS"] = str(settings.worker_threads)
    ending = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: ending.set())

    from service import tracing
    from service.jobs.worker import run_worker
    from service.log import configure_logging

    configure_logging(settings.log_level, settings.log_format)
    code = 0
    try:
        tracing.begin(settings, "worker")
        run_worker(settings, ending, once=once)
    except Exception as error:
        code = report(error, debug=context.obj.debug)
    tracing.end()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)  # dbos leaves threads that wait for jobs which others run now, and the process would for them
