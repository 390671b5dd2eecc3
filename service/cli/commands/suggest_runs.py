"""`rover-twin suggest-runs`: which scenarios to simulate next, as a `runs.csv` for a simulation script."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from service.cli import options
from service.cli.failures import UsageError
from service.cli.output import note, print_json
from service.cli.store_access import open_store


def suggest_runs(
    reference: Annotated[str, typer.Argument(metavar="NAME[@VERSION|@ALIAS]", help="Which version to improve.")],
    count: Annotated[int, typer.Option("-n", "--count", help="How many scenarios; 1 to 64.")] = 8,
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
      rover-twin suggest-runs viper-lunar@2 -n 3 --json
    """
    if json and output is not None:
        raise UsageError("--output writes the runs.csv; leave out --json, or redirect its output")
    from service.cli.views.models import find_version
    from service.twin.suggestions import suggestions
    from service.wire.suggested_runs import runs_as_csv, runs_as_json

    models = open_store(store)
    manifest = find_version(models, reference)
    runs = suggestions(models, manifest, count)
    if json:
        print_json(runs_as_json(manifest, runs))
    elif output is None:
        print(runs_as_csv(runs), end="")
    else:
        output.write_text(runs_as_csv(runs), encoding="utf-8")
        note(f"wrote {output}")
