"""`rover-twin mobility`: should the rover go over this slope? A map over slope x torque, answered without a server."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from service.cli import options
from service.cli.answer_forms import chosen_form, write_content
from service.cli.failures import UsageError
from service.cli.output import make_table, print_answer
from service.cli.store_access import open_store

if TYPE_CHECKING:
    from rich.table import Table

    from model_store import ModelStore
    from service.twin import Loaded
    from service.twin.mobility import MobilityMap
    from service.wire.mobility import MobilityInputs

FormatName = Literal["table", "json", "csv", "svg", "png", "html"]
_LETTERS = {"climbs": "C", "stalls": "-", "slides": "S"}
_LETTERS_OUTSIDE = {"climbs": "c", "stalls": ".", "slides": "s"}


def mobility(
    mass_kg: Annotated[float, typer.Option(help="Mass of the whole rover in kg; 1 to 10000.")],
    torque_min_nm: Annotated[float, typer.Option(help="Lowest stall torque of each wheel's motor in N m; 0 to 10000.")],
    torque_max_nm: Annotated[
        float | None, typer.Option(help="Highest torque. Default: one torque only, the lowest.", show_default=False)
    ] = None,
    torque_steps: Annotated[int, typer.Option(help="How many torques, both ends included; 2 to 64.")] = 10,
    slope_min_deg: Annotated[float, typer.Option(help="Lowest slope in degrees, positive uphill; -45 to 45.")] = 0.0,
    slope_max_deg: Annotated[float, typer.Option(help="Steepest slope in degrees; -45 to 45.")] = 35.0,
    slope_steps: Annotated[int, typer.Option(help="How many slopes, both ends included; 2 to 64.")] = 36,
    horizon_s: Annotated[float, typer.Option(help="How far to predict, in seconds from rest; up to 600.")] = 10.0,
    confidence: Annotated[
        float,
        typer.Option(help="How sure the steepest slope must be climbed, 0.75 to 0.995; needs a model with a band."),
    ] = 0.9,
    model: Annotated[
        str | None,
        typer.Option(
            metavar="NAME[@VERSION|@ALIAS]",
            help="Which model answers. Default: ROVER_TWIN_DEFAULT_MODEL, else viper-lunar@champion.",
            show_default=False,
        ),
    ] = None,
    form: Annotated[
        FormatName,
        typer.Option("--format", help="A map in letters, or what the API answers: numbers, a picture or a page."),
    ] = "table",
    json: options.Json = False,
    output: options.Output = None,
    store: options.Store = None,
) -> None:
    """Map where the rover climbs, stalls and slides over slope x torque, and the steepest slope it surely climbs.

    Examples:
    What can a 430 kg rover climb with 30 to 120 N m per wheel?
      rover-twin mobility --mass-kg 430 --torque-min-nm 30 --torque-max-nm 120

    The steepest slope for one torque, to be climbed with a confidence of 95 %, in a script:
      rover-twin mobility --mass-kg 430 --torque-min-nm 60 --confidence 0.95 --json | jq .steepest_climb_slope_deg[0]

    The map as a picture for a slide, and as a page with its numbers:
      rover-twin mobility --mass-kg 430 --torque-min-nm 30 --torque-max-nm 120 --format svg --output map.svg
      rover-twin mobility --mass-kg 430 --torque-min-nm 30 --torque-max-nm 120 --format html --output map.html
    """
    chosen = chosen_form(form, json, output)
    asked: dict[str, object] = {
        "mass_kg": mass_kg,
        "torque_min_nm": torque_min_nm,
        "torque_max_nm": torque_max_nm,
        "torque_steps": torque_steps,
        "slope_min_deg": slope_min_deg,
        "slope_max_deg": slope_max_deg,
        "slope_steps": slope_steps,
        "horizon_s": horizon_s,
        "confidence": confidence,
        "model": model,
    }
    inputs = _checked({name: value for name, value in asked.items() if value is not None})
    loaded, found = _computed(open_store(store), inputs)
    if chosen == "table":
        if output is not None:
            raise UsageError("the map in letters is for a terminal; --output wants another --format")
        print(_heading(loaded, found))
        print_answer(_map(found))
        return
    from service.wire.forms import MapFormat
    from service.wire.mobility import written

    write_content(written(loaded, found, MapFormat(chosen)), chosen, output)


def _checked(asked: dict[str, Any]) -> MobilityInputs:
    from pydantic import ValidationError

    from service.wire.faults import faults_of, summary_of
    from service.wire.mobility import ALLOWED, MobilityInputs

    try:
        return MobilityInputs.model_validate(asked)
    except ValidationError as error:
        # the API's words expect to hear first where a field was (query, body)
        errors = [{**each, "loc": ("option", *each["loc"])} for each in error.errors(include_url=False)]
        raise UsageError(summary_of(faults_of(errors, ALLOWED))) from error


def _computed(store: ModelStore, inputs: MobilityInputs) -> tuple[Loaded, MobilityMap]:
    from service.cli.threads import use_threads
    from service.settings import load_settings
    from service.twin import TwinRegistry
    from service.twin.mobility import mobility_map

    torques, slopes = inputs.torques_nm(), inputs.slopes_deg()
    use_threads()
    loaded = TwinRegistry(store, load_settings().default_model).get(inputs.model)
    found = mobility_map(loaded.twin, inputs.mass_kg, torques, slopes, inputs.horizon_s, inputs.confidence)
    return loaded, found


def _heading(loaded: Loaded, found: MobilityMap) -> str:
    alias = f" ({loaded.alias})" if loaded.alias else ""
    by = "central estimate; this version has no band" if found.confidence is None else f"sure to {found.confidence:.1%}"
    return (
        f"model     {loaded.twin.name}@{loaded.twin.version}{alias}\n"
        f"scenario  mass {found.mass_kg:g} kg, horizon {found.horizon_s:g} s, slope from {found.slope_deg[0]:g} to "
        f"{found.slope_deg[-1]:g} deg\n"
        f"steepest  slope up to which every slope of the map is climbed ({by})\n"
        "          in brackets where that slope is outside the model's domain\n"
        "map       C climbs, - stalls, S slides; c . s the same outside the model's domain\n"
    )


def _map(found: MobilityMap) -> Table:
    table = make_table("torque N m", "steepest deg", _ruler(found.slope_deg.tolist()), left=0)
    table.columns[-1].justify = "left"
    table.columns[-1].overflow = "ignore"
    table.columns[-1].no_wrap = True
    steepest = map(_steepest, found.steepest_climb_slope_deg, found.steepest_inside_domain)
    for torque, slope, outcomes, inside in zip(
        found.torque_nm, steepest, found.outcome, found.inside_domain, strict=True
    ):
        letters = "".join(
            (_LETTERS if known else _LETTERS_OUTSIDE)[outcome] for outcome, known in zip(outcomes, inside, strict=True)
        )
        table.add_row(f"{torque:.4g}", slope, letters)
    return table


def _steepest(slope_deg: float | None, inside: bool | None) -> str:
    if slope_deg is None:
        return "none"
    return f"{slope_deg:.2f}" if inside else f"({slope_deg:.2f})"


def _ruler(slopes_deg: list[float]) -> str:
    """Slopes above their columns, every fifth of them, as far as they do not touch."""
    ruler = ""
    for column in range(0, len(slopes_deg), 5):
        label = f"{slopes_deg[column]:.3g}"
        if len(ruler) < column or column == 0:
            ruler = ruler.ljust(column) + label
    return ruler
