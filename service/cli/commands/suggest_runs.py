"""`rover-twin suggest-runs`: which scenarios or drives to simulate next, as a `runs.csv` for a simulation script."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from service.cli import options
from service.cli.failures import UsageError
from service.cli.output import note, print_json
from service.cli.store_access import open_store

if TYPE_CHECKING:
    from model_store import Manifest, ModelStore


def suggest_runs(
    reference: Annotated[str, typer.Argument(metavar="NAME[@VERSION|@ALIAS]", help="Which version to improve.")],
    count: Annotated[int, typer.Option("-n", "--count", help="How many scenarios; 1 to 64.")] = 8,
    drives: Annotated[
        bool,
        typer.Option(
            "--drives", help="Suggest drives of 20 s, in which slope or torque change or the rover stops and goes on."
        ),
    ] = False,
    output: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write the answer to this file instead of stdout.")
    ] = None,
    store: options.Store = None,
    json: options.Json = False,
) -> None:
    """Suggest the simulations that would lower a version's error the most, as a runs.csv; --json says why.

    The scenarios are chosen as a batch: each counts on the ones before it. Asking for more keeps the first ones.

    Examples:
      rover-twin suggest-runs viper-lunar -n 8 --output runs.csv

    With the error to expect and the nearest run of each:
      rover-twin suggest-runs viper-lunar -n 3 --json

    Drives, and how likely each passes, sticks and slides:
      rover-twin suggest-runs viper-lunar --drives --json
    """
    if json and output is not None:
        raise UsageError("--output writes the runs.csv; leave out --json, or redirect its output")
    from service.cli.views.models import find_version

    models = open_store(store)
    manifest = find_version(models, reference)
    document, table = _drives(models, manifest, count) if drives else _runs(models, manifest, count)
    if json:
        print_json(document)
    elif output is None:
        print(table, end="")
    else:
        output.write_text(table, encoding="utf-8")
        note(f"wrote {output}")


def _runs(models: ModelStore, manifest: Manifest, count: int) -> tuple[dict[str, Any], str]:
    from service.twin.suggestions import suggestions
    from service.wire.suggested_runs import runs_as_csv, runs_as_json

    runs = suggestions(models, manifest, count)
    return runs_as_json(manifest, runs), runs_as_csv(runs)


def _drives(models: ModelStore, manifest: Manifest, count: int) -> tuple[dict[str, Any], str]:
    from service.twin.suggestions import drive_suggestions
    from service.wire.suggested_drives import drives_as_csv, drives_as_json

    drives = drive_suggestions(models, manifest, count)
    return drives_as_json(manifest, drives), drives_as_csv(drives)
