"""What the command takes: its options and their bounds, which are those of the service, and the files they name."""

from __future__ import annotations

import argparse
import json
import math
import os
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pxr import Sdf, Tf, Usd

from rover_twin_usd.failures import StageError
from rover_twin_usd.service import TOKEN_VARIABLE, USUAL_ADDRESS
from rover_twin_usd.standing import AXES

FORMATS = (".usda", ".usdc", ".usd")
_EXAMPLES = f"""\
examples:
  rover-twin-usd site.usd                                        which prims could be the rover?
  rover-twin-usd site.usd --prim /World/Rover --slope-deg 20 --mass-kg 430 --torque-nm 80
  rover-twin-usd site.usd --prim /World/Rover --question drive.json --output drive.usda
  rover-twin-usd site.usd --prim /World/A --prim /World/B --question fleet.json
  rover-twin-usd site.usd --prim /Rover --proxy --question drive.json     for a stage without a rover

A question is what POST /v1/predictions, /v1/drives or one of their batches takes; a batch has one --prim for each
rover. The new stage includes yours and moves the rover; your file stays as it is unless you say --in-place.
A service that asks for a token gets the one in {TOKEN_VARIABLE}.
"""


def parser() -> argparse.ArgumentParser:
    """The options; numbers outside their bounds are refused at once."""
    made = argparse.ArgumentParser(
        "rover-twin-usd",
        description="Predict a drive and move a rover of a USD stage with it.",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    made.add_argument("stage", type=Path, help="the stage: a USD file; it is only read, unless --in-place")
    made.add_argument("--prim", action="append", metavar="PATH", help="the rover; one for each rover of a batch")
    asked = made.add_argument_group("question")
    asked.add_argument("--question", type=Path, metavar="FILE", help="JSON with the question; - is standard input")
    for name, what in (("slope-deg", "slope"), ("mass-kg", "mass"), ("torque-nm", "torque of each wheel"),
                       ("horizon-s", "seconds to predict")):  # fmt: skip
        asked.add_argument(f"--{name}", type=_number(-math.inf, math.inf), help=f"{what}, without a --question")
    asked.add_argument("--model", help="which model answers: name, name@version or name@alias")
    asked.add_argument("--service", default=USUAL_ADDRESS, help="address of the service (%(default)s)")
    _add_rover(made.add_argument_group("rover"))
    result = made.add_argument_group("result")
    result.add_argument("--output", type=Path, metavar="FILE", help="the new layer (<stage>.rover-twin.usda)")
    how = result.add_mutually_exclusive_group()
    how.add_argument("--layer-only", action="store_true", help="write the motion alone, without including the stage")
    how.add_argument("--in-place", action="store_true", help="let the stage's own file include the new layer")
    result.add_argument("--force", action="store_true", help="replace an output that exists")
    return made


def _add_rover(rover: argparse._ArgumentGroup) -> None:
    pivot = "middle between the rear wheels' centres, in the asset's coordinates; else guessed"
    origin = "zero of the positions on the stage, metres; else the drive starts where the rover stands"
    heading = "where it looks, from X counterclockwise; else as it stands"
    spacing = "how far to its right each further rover of a batch has its zero, with --origin-m or --proxy"
    rover.add_argument("--forward", choices=AXES, help="axis of the asset that looks ahead (X)")
    rover.add_argument("--pivot", type=_point(1e6), metavar="X,Y,Z", help=pivot)
    rover.add_argument("--origin-m", type=_point(1e7), metavar="X,Y,Z", help=origin)
    rover.add_argument("--heading-deg", type=_number(-360, 360), help=heading)
    rover.add_argument("--spacing-m", type=_number(0, 1000), help=spacing)
    rover.add_argument(
        "--start-s", type=_number(0, 1e6), default=0.0, help="when the drive begins, after the stage's start"
    )
    rover.add_argument("--proxy", action="store_true", help="bring a rover made of simple shapes, named by --prim")


def require_together(options: argparse.Namespace) -> None:
    """Raises StageError for options that have no effect with the others, and for prims that are in each other's way."""
    without = {
        name: value for name, value in vars(options).items() if name not in ("stage", "service", "prim", "force")
    }
    if not options.prim and any(value != parser().get_default(name) for name, value in without.items()):
        raise StageError("name --prim, the rover that is asked about; without other options its stage is listed")
    if options.proxy:
        given = [name for name in ("pivot", "forward", "in_place") if getattr(options, name)]
        if given:
            raise StageError(f"--{given[0].replace('_', '-')} has no effect with --proxy: leave it out")
        if len(options.prim) > 1:
            raise StageError("--proxy takes one --prim; the rovers of a batch get a number after it")
    elif options.spacing_m and options.origin_m is None:
        raise StageError("--spacing-m has no effect without --origin-m or --proxy")
    paths = [Sdf.Path(each) for each in options.prim or () if Sdf.Path.IsValidPathString(each)]
    for at, path in enumerate(paths):
        for other in paths[:at]:
            if path.HasPrefix(other) or other.HasPrefix(path):
                raise StageError(f"{other} and {path} move each other: a rover is named once, and none inside another")


def opened(file: Path) -> Usd.Stage:
    """The stage in a file. Raises StageError where there is none."""
    if not file.exists():
        raise StageError(f"there is no file {file}")
    try:
        return Usd.Stage.Open(str(file))
    except Tf.ErrorException as error:
        line = re.search(r":(\d+):\d+:", str(error))
        where = f", line {line[1]}" if line else ""
        raise StageError(f"{file} is no USD stage that can be read{where}") from error


def output_of(options: argparse.Namespace, stage: Usd.Stage) -> Path:
    """Where the new layer goes. Raises StageError where it cannot, or where a file of the user's is."""
    output: Path = options.output or options.stage.with_name(f"{options.stage.stem}.rover-twin.usda")
    if output.suffix.lower() not in FORMATS:
        raise StageError(f"--output is {output}, allowed is a name that ends with {', '.join(FORMATS)}")
    if not output.parent.is_dir() or not os.access(output.parent, os.W_OK):
        raise StageError(f"{output} cannot be written: {output.parent} is no folder that can be written to")
    for file in (output, output.with_suffix(f".before{output.suffix}")):
        if file.exists() and (not options.force or _needed(file, stage, options.in_place)):
            raise StageError(
                f"{file} exists already: name another --output" + ("" if options.force else ", or --force")
            )
    if options.in_place:
        source = Path(stage.GetRootLayer().realPath)
        if source.suffix.lower() not in FORMATS or not os.access(source, os.W_OK):
            raise StageError(f"{source} cannot be changed in place: allowed is a {', '.join(FORMATS)} file of your own")
    return output


def _needed(file: Path, stage: Usd.Stage, in_place: bool) -> bool:
    """Whether the stage is made of that file: only --in-place may replace one, and only what it wrote itself."""
    for layer in stage.GetUsedLayers():
        if layer.realPath and Path(layer.realPath).resolve() == file.resolve():
            return not (in_place and layer != stage.GetRootLayer() and "roverTwin" in layer.customLayerData)
    return False


def question_of(options: argparse.Namespace) -> dict[str, Any]:
    """The question, from a file or from options. Raises StageError."""
    given = {name: getattr(options, name) for name in ("slope_deg", "mass_kg", "torque_nm", "horizon_s", "model")}
    given = {name: value for name, value in given.items() if value is not None}
    if options.question:
        try:
            found = json.loads(sys.stdin.read() if str(options.question) == "-" else options.question.read_text())
        except OSError as error:
            raise StageError(f"{options.question} cannot be read: {error.strerror}") from error
        except (ValueError, RecursionError) as error:
            raise StageError(f"{options.question} is no JSON: {error}") from error
        if not isinstance(found, dict):
            raise StageError(f"{options.question} has no JSON object")
        return {**found, **given}
    missing = [f"--{name.replace('_', '-')}" for name in ("slope_deg", "mass_kg", "torque_nm") if name not in given]
    if missing:
        raise StageError(f"{', '.join(missing)} missing; or give a --question")
    return {"include": ["speed"], **given}


def _number(low: float, high: float) -> Callable[[str], float]:
    allowed = f"a number from {low:.0f} to {high:.0f}" if math.isfinite(high) else "a finite number"

    def read(text: str) -> float:
        try:
            found = float(text)
        except ValueError:
            found = math.nan
        if not (low <= found <= high and math.isfinite(found)):
            raise argparse.ArgumentTypeError(f"it is {text!r}, allowed is {allowed}")
        return found

    return read


def _point(most: float) -> Callable[[str], list[float]]:
    def read(text: str) -> list[float]:
        try:
            found = [float(each) for each in text.split(",")]
        except ValueError:
            found = []
        if len(found) != 3 or not all(abs(each) <= most for each in found):
            allowed = f"x,y,z: three numbers with commas between them, each {-most:.0f} to {most:.0f}"
            raise argparse.ArgumentTypeError(f"it is {text!r}, allowed is {allowed}")
        return found

    return read
