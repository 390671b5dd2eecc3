"""`rover-twin serve`: the HTTP service."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from service.cli import options
from service.cli.failures import ServerError

if TYPE_CHECKING:
    from types import ModuleType


def serve(
    host: Annotated[
        str | None,
        typer.Option(help="Address to listen on. Default: ROVER_TWIN_HOST, else 127.0.0.1.", show_default=False),
    ] = None,
    port: Annotated[
        int | None,
        typer.Option(help="TCP port, 0 for any free one. Default: ROVER_TWIN_PORT, else 8000.", show_default=False),
    ] = None,
    model: Annotated[
        str | None,
        typer.Option(
            metavar="NAME[@VERSION|@ALIAS]",
            help="Model that answers when a request names none. Default: viper-lunar@champion.",
            show_default=False,
        ),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(
            help="Server processes that share the port. Default: ROVER_TWIN_WORKERS, else 1.", show_default=False
        ),
    ] = None,
    threads: Annotated[
        int | None,
        typer.Option(
            help="Threads for predictions in each process. Default: together as many as the CPU quota allows.",
            show_default=False,
        ),
    ] = None,
    log_level: Annotated[
        Literal["debug", "info", "warning", "error"] | None,
        typer.Option(help="Least severe messages to log. Default: info.", show_default=False),
    ] = None,
    store: options.Store = None,
) -> None:
    """Serve predictions over HTTP until Ctrl-C. Every option is also a setting, ROVER_TWIN_<NAME>.

    Examples:
    The shipped model on this machine, then a first call:
      rover-twin serve
      curl "http://127.0.0.1:8000/v1/predictions?slope_deg=28&mass_kg=430&torque_nm=60"

    Your own model for the whole network:
      rover-twin serve --host 0.0.0.0 --store my-store --model my-rover@champion

    All of a machine with four processors:
      rover-twin serve --workers 4
    """
    server = imported_server()
    from service.settings import load_settings

    settings = load_settings(
        host=host,
        port=port,
        default_model=model,
        workers=workers,
        threads=threads,
        log_level=log_level,
        store_url=store,
    )
    try:
        server.run_server(settings)
    except SystemExit as error:  # uvicorn's way to say that it cannot listen, with exit codes of its own
        raise ServerError(f"the server on {settings.host}:{settings.port} ended; its log above says why") from error


def imported_server() -> ModuleType:
    """`service.server`, imported as fast as can be."""
    from service.memory import uncollected

    with uncollected():
        with _without("rich"):  # for tracebacks in colours, which our log does not have: a tenth of a start
            import structlog  # noqa: F401
        from service import server
    return server


@contextmanager
def _without(package: str) -> Iterator[None]:
    """To whoever imports something within, a package that was not imported before seems not to be installed."""
    if package in sys.modules:
        yield
        return
    sys.modules[package] = None  # type: ignore[assignment]
    try:
        yield
    finally:
        del sys.modules[package]
