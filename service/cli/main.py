"""`rover-twin`: the command line put together, and its errors turned into one line and an exit code."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from typing import Annotated

import typer
from typer.main import get_command

import service
from service.cli.failures import EXIT_CODES_HELP, ExitCode, report
from service.cli.output import note

PROGRAM = "rover-twin"

# In the order of the help. Each is a module of `commands`, whose function of the same name is the command, or whose
# `app` is a group of them.
COMMANDS = (
    "serve",
    "predict",
    "mobility",
    "train",
    "worker",
    "evaluate",
    "reproduce",
    "suggest-runs",
    "models",
    "datasets",
    "jobs",
    "tokens",
    "copy-store",
    "openapi",
)


@dataclass(slots=True)
class Session:
    """What the options before the command say."""

    debug: bool = False


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"{PROGRAM} {service.__version__}")
        raise typer.Exit


def _program(
    context: typer.Context,
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback when a command fails.")] = False,
    _version: Annotated[
        bool,
        typer.Option("--version", help="Print the version and exit.", callback=_print_version, is_eager=True),
    ] = False,
) -> None:
    session: Session = context.obj
    session.debug = debug


@cache
def program(names: tuple[str, ...] = COMMANDS) -> typer.Typer:
    """The command line with the commands of these names: what the others need is not imported."""
    app = typer.Typer(
        name=PROGRAM,
        help="Where will the rover go on this slope, how sure are we, should it drive? "
        "Predict, train and serve digital twins of a rover on regolith.",
        epilog=EXIT_CODES_HELP,
        no_args_is_help=True,
        rich_markup_mode="rich",
    )
    app.callback()(_program)
    for name in names:
        module = import_module(f"service.cli.commands.{name.replace('-', '_')}")
        if hasattr(module, "app"):
            app.add_typer(module.app)
        else:
            app.command(name)(getattr(module, name.replace("-", "_")))
    return app


def _named(words: Sequence[str]) -> tuple[str, ...]:
    """The command that these words ask for, as no option before it has a value; all where they name none."""
    first = next((word for word in words if not word.startswith("-")), "")
    return (first,) if first in COMMANDS else COMMANDS


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit code (see `ExitCode`). Answers go to stdout, everything else to stderr."""
    session = Session()
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        command = get_command(program(_named(given)))
        code = command.main(args=given, prog_name=PROGRAM, standalone_mode=False, obj=session)
    except KeyboardInterrupt:
        code = ExitCode.INTERRUPTED
    except Exception as error:
        return report(error, debug=session.debug)
    if code == ExitCode.INTERRUPTED:
        note("interrupted")
    return int(code or ExitCode.DONE)
