"""`rover-twin train`: datasets -> a new version of a model."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, get_args

import typer

from service.cli import options
from service.cli.error_tables import error_table
from service.cli.failures import UsageError
from service.cli.output import note, print_answer, print_json
from service.cli.store_access import check_names, open_store
from service.jobs.training_config import ArchitectureName, InputName, PriorName, TrainingConfig, XForm
from service.learning.fit_config import FitConfig

if TYPE_CHECKING:
    from service.cli.training import TrainingResult

_DEFAULTS = {name: field.default for name, field in TrainingConfig.model_fields.items()}
_FIT = FitConfig()
_FITTING = "How to fit"
_RUNNING = "Running and publishing"


def train(
    model: Annotated[str, typer.Option(help="Name of the model that gets a new version: a-z, 0-9 and -.")],
    datasets: options.Datasets,
    prior: Annotated[PriorName, typer.Option(help="Closed-form part.")] = _DEFAULTS["prior"],
    architecture: Annotated[ArchitectureName, typer.Option(help="Learned part; zero is the prior alone.")] = _DEFAULTS[
        "architecture"
    ],
    inputs: Annotated[
        list[str],
        typer.Option(
            "--input", help=f"What the learned part sees, time_s first: {', '.join(get_args(InputName))}. Repeatable."
        ),
    ] = _DEFAULTS["inputs"],
    x_form: Annotated[
        XForm, typer.Option(help="The network's x output: the correction, as in the paper, or the correction per time.")
    ] = _DEFAULTS["x_form"],
    test_slopes_deg: Annotated[
        list[float] | None,
        typer.Option("--test-slope-deg", help="Keep every run at this slope for testing. Repeatable."),
    ] = None,
    test_fraction: Annotated[
        float, typer.Option(help="Share of the other runs kept for testing, at random; 0 to 0.9.")
    ] = _DEFAULTS["test_fraction"],
    description: Annotated[str, typer.Option(help="A sentence for people, kept in the manifest.")] = "",
    seed: Annotated[int, typer.Option(help="The same seed gives the same weights.", rich_help_panel=_FITTING)] = (
        _FIT.seed
    ),
    epochs: Annotated[int, typer.Option(help="At most this many; 1 to 100000.", rich_help_panel=_FITTING)] = (
        _FIT.epochs
    ),
    batch_rows: Annotated[int, typer.Option(help="Samples per step.", rich_help_panel=_FITTING)] = _FIT.batch_rows,
    rows_per_epoch: Annotated[
        int, typer.Option(help="Samples drawn anew each epoch.", rich_help_panel=_FITTING)
    ] = _FIT.rows_per_epoch,
    learning_rate: Annotated[
        float, typer.Option(help="Highest learning rate, after the warm-up; 1e-9 to 1.", rich_help_panel=_FITTING)
    ] = _FIT.learning_rate,
    final_learning_rate: Annotated[
        float, typer.Option(help="Where the cosine ends; 0 to 1.", rich_help_panel=_FITTING)
    ] = _FIT.final_learning_rate,
    warm_up_epochs: Annotated[int, typer.Option(help="Epochs of warm-up.", rich_help_panel=_FITTING)] = (
        _FIT.warm_up_epochs
    ),
    average_decay: Annotated[
        float, typer.Option(help="Memory of the averaged weights; 0 to 0.999999.", rich_help_panel=_FITTING)
    ] = _FIT.average_decay,
    patience_epochs: Annotated[
        int, typer.Option(help="Stop after this many epochs without a gain.", rich_help_panel=_FITTING)
    ] = _FIT.patience_epochs,
    validation_rows: Annotated[
        int, typer.Option(help="At most this many samples validate an epoch.", rich_help_panel=_FITTING)
    ] = _FIT.validation_rows,
    state: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Keep the state of the fit in this file; the same command after an interruption goes on from it.",
            rich_help_panel=_RUNNING,
        ),
    ] = None,
    publish: Annotated[
        bool, typer.Option("--publish/--no-publish", help="Publish a new version.", rich_help_panel=_RUNNING)
    ] = True,
    promote: Annotated[
        str | None,
        typer.Option(metavar="ALIAS", help="Then point this alias, such as champion, to it.", rich_help_panel=_RUNNING),
    ] = None,
    threads: Annotated[
        int | None,
        typer.Option(help="Processor threads. Default: as many as the CPU quota allows.", rich_help_panel=_RUNNING),
    ] = None,
    actor: options.Actor = None,
    store: options.Store = None,
    json: options.Json = False,
) -> None:
    r"""Train a new version of a model on datasets of Chrono runs, and say how good it is beside its prior alone.

    Progress goes to stderr, the result to stdout. An alias moves only with --promote. Ctrl-C publishes nothing.

    Examples:
    Keep the runs at 28 degrees for testing, then publish:
      rover-twin train --dataset paper --model my-rover --test-slope-deg 28

    Long training that may be interrupted; run the same line again to go on:
      rover-twin train --dataset paper --dataset mass --model my-rover --test-fraction 0.2 --state fit.state

    The prior and the form of the correction that the paper used:
      rover-twin train --dataset paper --model paper-rover --prior rigid_slope --x-form position \
        --input time_s --input slope_deg --test-slope-deg 28
    """
    if promote is not None and not publish:
        raise UsageError(f"--promote {promote} needs the version to be published: leave --no-publish out")
    if inputs[0] != "time_s" or len(set(inputs)) < len(inputs):
        raise UsageError(f"--input is {', '.join(inputs)}, allowed is time_s first and each one once")
    config = TrainingConfig.model_validate(
        {
            "model": model,
            "datasets": datasets,
            "prior": prior,
            "architecture": architecture,
            "inputs": inputs,
            "x_form": x_form,
            "test_slopes_deg": test_slopes_deg or [],
            "test_fraction": test_fraction,
            "description": description,
            "fit": FitConfig(
                seed=seed,
                epochs=epochs,
                batch_rows=batch_rows,
                rows_per_epoch=rows_per_epoch,
                learning_rate=learning_rate,
                final_learning_rate=final_learning_rate,
                warm_up_epochs=warm_up_epochs,
                average_decay=average_decay,
                patience_epochs=patience_epochs,
                validation_rows=validation_rows,
            ),
        }
    )
    check_names(model, promote)
    from service.cli.threads import use_threads
    from service.cli.training import Publication, run_training

    use_threads(threads)
    publication = Publication(options.actor_name(actor), promote) if publish else None
    _show(run_training(open_store(store, create=publish), config, publication, state), json)


def _show(result: TrainingResult, json: bool) -> None:
    if json:
        print_json(result.as_json())
        return
    fit = result.trained.outcome
    ended = "stopped early" if fit.stopped_early else "all epochs"
    note(f"best epoch {fit.best_epoch} of {fit.epochs} ({ended}) in {fit.elapsed_s:.1f} s on {fit.device}")
    print_answer(error_table(*result.judged_by()))
    print(f"weights sha256 {result.weights_sha256}")
    if result.manifest is not None:
        print(f"published {result.manifest.name}@{result.manifest.version}")
    if result.promoted is not None:
        print(f"{result.promoted} now means version {result.manifest.version if result.manifest else '?'}")
