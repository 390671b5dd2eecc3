"""`rover-twin evaluate`: how far a version is from simulations, beside its prior alone."""

from __future__ import annotations

from typing import Annotated

import typer

from service.cli import options
from service.cli.output import note, print_answer, print_json
from service.cli.store_access import open_store
from service.cli.views.errors import error_table, runs_table

_GROUPS = {
    "train": "runs it was trained on",
    "test": "test runs, kept apart from its training",
    "new": "new runs, unknown to its training",
}


def evaluate(
    reference: Annotated[str, typer.Argument(metavar="NAME[@VERSION|@ALIAS]", help="Which version.")],
    datasets: options.Datasets,
    slopes_deg: Annotated[
        list[float] | None,
        typer.Option("--slope-deg", help="Only the runs at this slope, in degrees. Repeatable."),
    ] = None,
    store: options.Store = None,
    json: options.Json = False,
) -> None:
    """Measure a version on Chrono runs: final, maximum and rms position error, beside its prior alone.

    Each run is marked as seen in training (train), kept apart from it (test) or unknown to the version (new):
    errors on runs that it was trained on say little about runs that it was not.

    Examples:
    All runs of a dataset:
      rover-twin evaluate viper-lunar --dataset paper

    One version at the slope of its test runs, errors in metres as JSON:
      rover-twin evaluate viper-lunar@1 --dataset paper --slope-deg 28 --json
    """
    from service.cli.actions.evaluation import evaluate_version

    result = evaluate_version(open_store(store), reference, datasets, slopes_deg or [])
    for warning in result.warnings:
        note(f"warning: {warning}")
    if json:
        print_json(result.as_json())
        return
    print_answer(runs_table([(run.errors, run.seen_in, run.inside_domain) for run in result.runs]))
    for role, summary in result.summaries().items():
        print()
        print_answer(error_table(f"{_GROUPS[role]} ({summary['runs']})", summary))
