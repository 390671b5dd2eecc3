"""`rover-twin train`: datasets -> a new version of a model."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_args

import typer

from service.cli import options
from service.cli.failures import UsageError
from service.cli.output import note, print_answer, print_json
from service.cli.store_access import check_names, open_store
from service.cli.views.errors import error_table
from service.learning.network.fit_config import FitConfig
from service.training.config import ArchitectureName, InputName, PriorName, TrainingConfig, XForm

if TYPE_CHECKING:
    from model_store import Manifest
    from service.cli.actions.retraining import Likeness
    from service.cli.actions.training import TrainingResult

_DEFAULTS = {name: field.default for name, field in TrainingConfig.model_fields.items()}
_FIT = FitConfig()
_FITTING = "How to fit"
_RUNNING = "Running and publishing"


def train(
    context: typer.Context,
    model: Annotated[
        str | None, typer.Option(help="Name of the model that gets a new version: a-z, 0-9 and -.", show_default=False)
    ] = None,
    datasets: options.OptionalDatasets = None,
    like: Annotated[
        str | None,
        typer.Option(
            metavar="NAME@VERSION",
            help="Train as this version was trained, on the very same datasets; other options given here take "
            "precedence. Says whether the same weights came out.",
            show_default=False,
        ),
    ] = None,
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

    Make a version again without publishing it, to see that its weights can be had again:
      rover-twin train --like viper-lunar@2 --no-publish

    The prior and the form of the correction that the paper used:
      rover-twin train --dataset paper --model paper-rover --prior rigid_slope --x-form position \
        --input time_s --input slope_deg --test-slope-deg 28
    """
    if promote is not None and not publish:
        raise UsageError(f"--promote {promote} needs the version to be published: leave --no-publish out")
    chosen: dict[str, Any] = {
        "model": model,
        "datasets": datasets,
        "prior": prior,
        "architecture": architecture,
        "inputs": inputs,
        "x_form": x_form,
        "test_slopes_deg": test_slopes_deg or [],
        "test_fraction": test_fraction,
        "description": description,
        "fit": {
            "seed": seed,
            "epochs": epochs,
            "batch_rows": batch_rows,
            "rows_per_epoch": rows_per_epoch,
            "learning_rate": learning_rate,
            "final_learning_rate": final_learning_rate,
            "warm_up_epochs": warm_up_epochs,
            "average_decay": average_decay,
            "patience_epochs": patience_epochs,
            "validation_rows": validation_rows,
        },
    }
    original = None if like is None else _find_original(store, like)
    config = _make_config(chosen, original, context)
    check_names(config.model, promote)
    from service.cli.actions.retraining import likeness
    from service.cli.actions.training import Publication, run_training
    from service.cli.threads import use_threads

    use_threads(original.lineage.threads if threads is None and original is not None else threads)
    publication = Publication(options.actor_name(actor), promote) if publish else None
    result = run_training(open_store(store, create=publish), config, publication, state)
    _show(result, None if original is None else likeness(original, config, result.weights_sha256), json)


def _find_original(store: str | None, reference: str) -> Manifest:
    from service.cli.views.models import find_version

    return find_version(open_store(store), reference)


def _make_config(chosen: dict[str, Any], original: Manifest | None, context: typer.Context) -> TrainingConfig:
    """The config of the options alone, or of a published version with the options that were typed over it."""
    if original is not None:
        from service.cli.actions.retraining import config_like

        typed = {name for name in context.params if _is_typed(context, name)}
        changed = {name: chosen[name] for name in chosen.keys() & typed}
        config = config_like(
            original, changed | {"fit": {name: chosen["fit"][name] for name in chosen["fit"].keys() & typed}}
        )
    else:
        for option, value in (("--model", chosen["model"]), ("--dataset", chosen["datasets"])):
            if not value:
                raise UsageError(f"{option} is missing; give it, or --like NAME@VERSION")
        config = TrainingConfig.model_validate(chosen | {"fit": FitConfig(**chosen["fit"])})
    inputs = config.inputs
    if inputs[0] != "time_s" or len(set(inputs)) < len(inputs):
        raise UsageError(f"--input is {', '.join(inputs)}, allowed is time_s first and each one once")
    return config


def _is_typed(context: typer.Context, name: str) -> bool:
    source = context.get_parameter_source(name)
    return source is not None and source.name == "COMMANDLINE"


def _show(result: TrainingResult, like: Likeness | None, json: bool) -> None:
    if json:
        print_json(result.as_json() | ({} if like is None else {"like": like.as_json()}))
        return
    fit = result.trained.outcome
    ended = "stopped early" if fit.stopped_early else "all epochs"
    note(f"best epoch {fit.best_epoch} of {fit.epochs} ({ended}) in {fit.elapsed_s:.1f} s on {fit.device}")
    print_answer(error_table(*result.judged_by()))
    print(f"weights sha256 {result.weights_sha256}")
    if like is not None:
        print(like.sentence())
    if result.manifest is not None:
        print(f"published {result.manifest.name}@{result.manifest.version}")
    if result.promoted is not None:
        print(f"{result.promoted} now means version {result.manifest.version if result.manifest else '?'}")
