"""`rover-twin predict`: one scenario, answered here without a server."""

from __future__ import annotations

import sys
from typing import Annotated, Literal

import typer

from service.cli import options
from service.cli.failures import UsageError
from service.cli.output import note
from service.cli.store_access import open_store

FormatName = Literal["table", "json", "csv", "npz", "arrow", "parquet", "usda", "svg", "png", "html"]


def predict(
    slope_deg: Annotated[
        float, typer.Option(help="Slope of the terrain in degrees, positive facing uphill; -45 to 45.")
    ],
    mass_kg: Annotated[float, typer.Option(help="Mass of the whole rover in kg; 1 to 10000.")],
    torque_nm: Annotated[float, typer.Option(help="Stall torque of each wheel's motor in N m; 0 to 10000.")],
    horizon_s: Annotated[float, typer.Option(help="How far to predict, in seconds from rest; up to 600.")] = 10.0,
    dt_s: Annotated[
        float, typer.Option(help="Seconds between two points; 0.0001 to 60. The horizon is always the last point.")
    ] = 0.05,
    model: Annotated[
        str | None,
        typer.Option(
            metavar="NAME[@VERSION|@ALIAS]",
            help="Which model answers. Default: ROVER_TWIN_DEFAULT_MODEL, else viper-lunar@champion.",
            show_default=False,
        ),
    ] = None,
    frame: Annotated[
        Literal["slope", "world"],
        typer.Option(help="slope: x along the slope, y normal to it. world: x horizontal, z up."),
    ] = "slope",
    include: Annotated[
        list[str] | None,
        typer.Option(
            help="Add a part to the answer: prior, the closed-form solution alone; band, an error interval; speed, "
            "along the slope; wheel_speed, of rear and front wheels."
        ),
    ] = None,
    band_level: Annotated[
        float, typer.Option(help="Pointwise coverage of the band, with --include band; 0.5 to 0.99.")
    ] = 0.9,
    strict: Annotated[
        bool, typer.Option("--strict", help="Refuse a scenario outside the model's domain: exit code 4.")
    ] = False,
    form: Annotated[
        FormatName,
        typer.Option(
            "--format",
            help="A table for people, or what the API answers: text, NumPy archive, Arrow stream, Parquet file, "
            "USD layer, plot or page. npz, arrow, parquet and png are no text: they go to a file or a pipe.",
        ),
    ] = "table",
    usd: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE",
            help="With --format usda, how it fits your stage: prim_path=/World/Rover, origin_m=1,2,3, heading_deg=90, "
            "pivot=x,y,z, scale=1, up_axis=Y, meters_per_unit=0.01, proxy=true (docs/omniverse.md).",
        ),
    ] = None,
    json: options.Json = False,
    output: options.Output = None,
    store: options.Store = None,
) -> None:
    r"""Predict where the rover goes, without a server. The answer is the one that GET /v1/predictions gives.

    Examples:
    Where does a 430 kg rover with 60 N m per wheel end on 28 degrees after 10 s?
      rover-twin predict --slope-deg 28 --mass-kg 430 --torque-nm 60

    Every millisecond, with the closed-form part alone beside it, as CSV:
      rover-twin predict --slope-deg 28 --mass-kg 430 --torque-nm 60 --dt-s 0.001 --include prior \
        --format csv --output run.csv

    A plot of the trajectory with its band:
      rover-twin predict --slope-deg 28 --mass-kg 430 --torque-nm 60 --include band --format svg --output run.svg

    A rover made of simple shapes that drives on a Y-up stage in centimetres:
      rover-twin predict --slope-deg 28 --mass-kg 430 --torque-nm 60 --format usda --usd proxy=true --usd up_axis=Y \
        --usd meters_per_unit=0.01 --output rover.usda

    The final position in a script, refusing to extrapolate:
      rover-twin predict --slope-deg 28 --mass-kg 430 --torque-nm 60 --strict --json | jq .summary.final_x_m
    """
    if json and form not in ("table", "json"):
        raise UsageError(f"--json and --format {form} ask for two answers; leave one out")
    from service.cli.actions.prediction import answer, is_text

    chosen = "json" if json else form
    if output is None and not is_text(chosen) and sys.stdout.isatty():
        raise UsageError(f"--format {chosen} is no text for a terminal; write it with --output FILE or pipe it")
    inputs: dict[str, object] = {
        "slope_deg": slope_deg,
        "mass_kg": mass_kg,
        "torque_nm": torque_nm,
        "horizon_s": horizon_s,
        "dt_s": dt_s,
        "frame": frame,
        "include": include or [],
        "band_level": band_level,
        "strict": strict,
    }
    if model is not None:
        inputs["model"] = model
    content = answer(open_store(store), inputs, chosen, usd or [])
    if output is not None:
        output.write_bytes(content)
        note(f"wrote {output}")
    elif is_text(chosen):
        print(content.decode(), end="")
    else:
        sys.stdout.buffer.write(content)
        sys.stdout.buffer.flush()
