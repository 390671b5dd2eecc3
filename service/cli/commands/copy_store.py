"""`rover-twin copy-store`: models and datasets from one place to another."""

from __future__ import annotations

from typing import Annotated

import typer

from service.cli.output import print_answer


def copy_store(
    source: Annotated[
        str, typer.Argument(metavar="FROM", help="A directory, or a file://, s3://, gs:// or az:// URL.")
    ],
    target: Annotated[
        str, typer.Argument(metavar="TO", help="The same; a missing directory is made, a bucket is not.")
    ],
) -> None:
    """Copy the models, versions, aliases and datasets of a store that another one lacks. Nothing is overwritten.

    Services and workers may use both meanwhile. A copy that was broken off goes on when it is started again.

    Examples:
    Fill a bucket with the models of a directory:
      rover-twin copy-store my-store s3://rover-twin

    A backup, and the way back:
      rover-twin copy-store s3://rover-twin backups/store
      rover-twin copy-store backups/store s3://rover-twin-restored
    """
    from model_store import ModelStore

    copied, present = ModelStore.open(source).copy_to(ModelStore.open(target, create="://" not in target))
    print_answer(f"copied {copied} objects, {present} were there")
