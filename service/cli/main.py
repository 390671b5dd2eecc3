"""`rover-twin`: the command line put together, and its errors turned into one line and an exit code."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import typer
from typer.main import get_command

import service
from service.cli.commands import (
    copy_store,
    dataset_preview,
    datasets,
    evaluate,
    jobs,
    mobility,
    models,
    openapi,
    predict,
    reproduce,
    serve,
    suggest_runs,
    tokens,
    train,
    worker,
)
from service.cli.failures import EXIT_CODES_HELP, ExitCode, report
from service.cli.output import note

PROGRAM = "rover-twin"

app = typer.Typer(
    name=PROGRAM,
    help="Where will the rover go on this slope, how sure are we, should it drive? "
    "Predict, train and serve digital twins of a rover on regolith.",
    epilog=EXIT_CODES_HELP,
    no_args_is_help=True,
    rich_markup_mode="rich",
)


@dataclass(slots=True)
class Session:
    """What the options before the command say."""

    debug: bool = False


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"{PROGRAM} {service.__version__}")
        raise typer.Exit


@app.callback()
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


app.command("serve")(serve.serve)
app.command("predict")(predict.predict)
app.command("mobility")(mobility.mobility)
app.command("train")(train.train)
app.command("worker")(worker.worker)
app.command("evaluate")(evaluate.evaluate)
app.command("reproduce")(reproduce.reproduce)
app.command("suggest-runs")(suggest_runs.suggest_runs)
app.add_typer(models.app)
datasets.app.command("preview")(dataset_preview.preview_dataset)
app.add_typer(datasets.app)
app.add_typer(jobs.app)
app.add_typer(tokens.app)
app.command("copy-store")(copy_store.copy_store)
app.command("openapi")(openapi.openapi)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit code (see `ExitCode`). Answers go to stdout, everything else to stderr."""
    session = Session()
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        code = get_command(app).main(args=given, prog_name=PROGRAM, standalone_mode=False, obj=session)
    except KeyboardInterrupt:
        code = ExitCode.INTERRUPTED
    except Exception as error:
        return report(error, debug=session.debug)
    if code == ExitCode.INTERRUPTED:
        note("interrupted")
    return int(code or ExitCode.DONE)
