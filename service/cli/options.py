"""Options that several commands share, so that they read the same everywhere."""

from __future__ import annotations

import getpass
from pathlib import Path
from typing import Annotated

import typer

Store = Annotated[
    str | None,
    typer.Option(
        "--store",
        metavar="URL",
        help="Where models and datasets live: a directory, or a file://, s3://, gs:// or az:// URL. "
        "Default: ROVER_TWIN_STORE_URL, else the store that ships with the program.",
        show_default=False,
    ),
]

Json = Annotated[bool, typer.Option("--json", help="Print one JSON document instead of text.")]


DatasetId = Annotated[
    str, typer.Argument(metavar="ID", help="Id, unique start of an id (6 digits or more), or name of a dataset.")
]


def file_or_stdout(given: Path | None) -> Path | None:
    """None, which is stdout, for `-` as well."""
    return None if given == Path("-") else given


Output = Annotated[
    Path | None,
    typer.Option(
        "--output", "-o", metavar="FILE", callback=file_or_stdout,
        help="Write the answer to this file, not to stdout; - is stdout.",
    ),
]  # fmt: skip

Actor = Annotated[
    str | None,
    typer.Option("--actor", help="Your name, kept in the history. Default: your login name.", show_default=False),
]

Reason = Annotated[str, typer.Option("--reason", help="Reason, kept in the history: one sentence.")]

Datasets = Annotated[
    list[str],
    typer.Option("--dataset", metavar="ID", help="Id, unique start of an id, or name of a dataset. Repeatable."),
]

OptionalDatasets = Annotated[
    list[str] | None,
    typer.Option(
        "--dataset", metavar="ID", help="Id, unique start of an id, or name of a dataset. Repeatable.",
        show_default=False,
    ),
]  # fmt: skip

Database = Annotated[
    str | None,
    typer.Option(
        "--database",
        metavar="URL",
        help="Database of the jobs: sqlite:///file or postgresql://... Default: ROVER_TWIN_JOBS_DATABASE_URL, else a "
        "file in the store.",
        show_default=False,
    ),
]


def actor_name(given: str | None) -> str:
    """The name that goes on record: as given, else the login name."""
    if given is not None:
        return given
    try:
        return getpass.getuser()
    except (KeyError, OSError):  # a container's user may have no name
        return "unknown"
