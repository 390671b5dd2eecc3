"""`rover-twin datasets preview`: a dataset as a picture or a page."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from service.cli import options
from service.cli.answer_forms import chosen_form, write_content
from service.cli.failures import UsageError
from service.cli.store_access import open_store

_KINDS = ("svg", "png", "html")


def preview_dataset(
    dataset: options.DatasetId,
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar="FILE",
            help="Figure to write; without --format its ending says which: .svg, .png or .html.",
            show_default=False,
        ),
    ] = None,
    form: Annotated[
        Literal["svg", "png", "html"] | None,
        typer.Option(
            "--format", help="A picture or a page. Default: what the file's name ends in.", show_default=False
        ),
    ] = None,
    output: options.Output = None,
    store: options.Store = None,
) -> None:
    """Draw a dataset: the distance of every run over time, and where the scenarios lie.

    Example:
      rover-twin datasets preview paper paper.svg

    The same as a page, with every run in a table:
      rover-twin datasets preview paper --format html --output paper.html
    """
    if file is not None and output is not None:
        raise UsageError(f"FILE is {file} and --output is {output}; leave one out")
    target = options.file_or_stdout(file) or output
    chosen = form or ("" if target is None else target.suffix.lower().removeprefix("."))
    if chosen not in _KINDS:
        given = "missing" if target is None else str(target)
        raise UsageError(f"FILE is {given}, allowed is a name that ends in .svg, .png or .html, or any with --format")
    chosen = chosen_form(chosen, json=False, output=target)
    from service.datasets import read_parquet
    from service.training.dataset_figure import Origin, preview
    from service.training.stored_dataset import RUNS_FILE

    opened = open_store(store)
    record = opened.dataset(dataset)
    runs = opened.read_dataset_file(record.id, RUNS_FILE)
    write_content(preview(read_parquet(runs, columns=()), kind=chosen, origin=Origin.of(record)), chosen, target)
