"""`rover-twin-usd`: a predicted drive on any stage, from a shell."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pxr import Tf, Usd, UsdGeom

from rover_twin_usd import stages
from rover_twin_usd.failures import RoverTwinUsdError, StageError
from rover_twin_usd.motion import Motion
from rover_twin_usd.service import TOKEN_VARIABLE, USUAL_ADDRESS, Service
from rover_twin_usd.standing import AXES, Wishes, movable, standing

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


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; 0 if it did what was asked, 1 if it could not, 2 for wrong arguments."""
    options = _parser().parse_args(arguments)
    try:
        _run(options)
    except RoverTwinUsdError as error:
        print(f"rover-twin-usd: {error}", file=sys.stderr)
        return 1
    except (Tf.ErrorException, OSError) as error:
        print(f"rover-twin-usd: {' '.join(str(error).split())}", file=sys.stderr)
        return 1
    return 0


def _run(options: argparse.Namespace) -> None:
    stage = Usd.Stage.Open(str(options.stage))
    if not options.prim:
        print("\n".join(movable(stage)) or "no prim can be moved; --proxy brings a rover")
        return
    question = _question(options)
    output: Path = options.output or options.stage.with_name(f"{options.stage.stem}.rover-twin.usda")
    for file in (output, output.with_suffix(f".before{output.suffix}")):
        if file.exists() and (not options.force or file.resolve() == options.stage.resolve()):
            raise StageError(
                f"{file} exists already: name another --output" + ("" if options.force else ", or --force")
            )
    service = Service(options.service)
    if options.proxy:
        _add_proxy(options, stage, question, service, output)
        return
    answers = [Motion.of(each) for each in service.answers(question)]
    if len(answers) != len(options.prim):
        raise StageError(f"the question has {len(answers)} rovers, and {len(options.prim)} are named with --prim")
    clock = stages.clock_of(stage, options.start_s)
    wishes = Wishes(options.forward, options.pivot, options.origin_m, options.heading_deg)
    time = Usd.TimeCode(clock.first)
    drives = [(standing(stage, path, time, wishes), each) for path, each in zip(options.prim, answers, strict=True)]
    layer = stages.empty_layer(output)
    notes = [f"{rover.path}: {note}" for rover, _ in drives for note in rover.notes]
    notes += stages.write(layer, stage, drives, clock)
    if not (options.layer_only or options.in_place):
        stages.above(layer, stage, output)
    layer.Save()
    if options.in_place:
        notes += stages.into_file(stage, output, drives, clock)
    if not options.layer_only:
        shown = stage if options.in_place else Usd.Stage.Open(str(output))
        worst, count = stages.require_exact(shown, drives, clock), sum(len(each.time_s) for each in answers)
        notes.append(f"checked at {count} times: the rover is within {worst:.1g} m of the answer")
    _say(notes, drives[0][1].labels, output)


def _add_proxy(
    options: argparse.Namespace, stage: Usd.Stage, question: dict[str, Any], service: Service, output: Path
) -> None:
    """The service's own layer with its rover of simple shapes, above the user's stage or alone."""
    (path, *others) = options.prim
    if others or stage.GetPrimAtPath(path):
        raise StageError("--proxy brings new rovers: name one --prim that does not exist yet")
    if options.in_place:
        raise StageError("--proxy changes no stage in place; include the new layer yourself")
    layout = {
        "prim_path": path,
        "proxy": "true",
        "up_axis": str(UsdGeom.GetStageUpAxis(stage)),
        "meters_per_unit": UsdGeom.GetStageMetersPerUnit(stage),
    }
    if options.origin_m:
        layout["origin_m"] = ",".join(map(repr, options.origin_m))
    if options.heading_deg is not None:
        layout["heading_deg"] = options.heading_deg
    text = service.layer(question, **layout)
    layer = stages.empty_layer(output)
    layer.ImportFromString(text)
    if not options.layer_only:
        stages.above(layer, stage, output)
    layer.Save()
    _say([f"{path}: a rover of simple shapes, as large as VIPER"], {}, output)


def _question(options: argparse.Namespace) -> dict[str, Any]:
    given = {name: getattr(options, name) for name in ("slope_deg", "mass_kg", "torque_nm", "horizon_s", "model")}
    given = {name: value for name, value in given.items() if value is not None}
    if options.question:
        try:
            found = json.loads(sys.stdin.read() if str(options.question) == "-" else options.question.read_text())
        except ValueError as error:
            raise StageError(f"{options.question} is no JSON: {error}") from error
        if not isinstance(found, dict):
            raise StageError(f"{options.question} has no JSON object")
        return {**found, **given}
    missing = [f"--{name.replace('_', '-')}" for name in ("slope_deg", "mass_kg", "torque_nm") if name not in given]
    if missing:
        raise StageError(f"{', '.join(missing)} missing; or give a --question")
    return {"include": ["speed"], **given}


def _say(notes: Sequence[str], labels: object, output: Path) -> None:
    for each in notes:
        print(each)
    if isinstance(labels, dict) and labels:
        print(", ".join(f"{name} {value}" for name, value in labels.items()))
    print(f"wrote {output}")


def _point(text: str) -> list[float]:
    found = [float(each) for each in text.split(",")]
    if len(found) != 3:
        raise ValueError(text)
    return found


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        "rover-twin-usd",
        description="Predict a drive and move a rover of a USD stage with it.",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("stage", type=Path, help="the stage: a USD file; it is only read, unless --in-place")
    parser.add_argument("--prim", action="append", metavar="PATH", help="the rover; one for each rover of a batch")
    asked = parser.add_argument_group("question")
    asked.add_argument("--question", type=Path, metavar="FILE", help="JSON with the question; - is standard input")
    for name, what in (("slope-deg", "slope"), ("mass-kg", "mass"), ("torque-nm", "torque of each wheel"),
                       ("horizon-s", "seconds to predict")):  # fmt: skip
        asked.add_argument(f"--{name}", type=float, help=f"{what}, without a --question")
    asked.add_argument("--model", help="which model answers: name, name@version or name@alias")
    asked.add_argument("--service", default=USUAL_ADDRESS, help="address of the service (%(default)s)")
    rover = parser.add_argument_group("rover")
    rover.add_argument("--forward", choices=AXES, default="X", help="axis of the asset that looks ahead (%(default)s)")
    pivot = "middle between the rear wheels' centres, in the asset's coordinates; else guessed"
    origin = "zero of the positions on the stage, metres; else the drive starts where the rover stands"
    rover.add_argument("--pivot", type=_point, metavar="X,Y,Z", help=pivot)
    rover.add_argument("--origin-m", type=_point, metavar="X,Y,Z", help=origin)
    rover.add_argument("--heading-deg", type=float, help="where it looks, from X counterclockwise; else as it stands")
    rover.add_argument("--start-s", type=float, default=0.0, help="when the drive begins, after the stage's start")
    rover.add_argument("--proxy", action="store_true", help="bring a rover made of simple shapes, named by --prim")
    result = parser.add_argument_group("result")
    result.add_argument("--output", type=Path, metavar="FILE", help="the new layer (<stage>.rover-twin.usda)")
    how = result.add_mutually_exclusive_group()
    how.add_argument("--layer-only", action="store_true", help="write the motion alone, without including the stage")
    how.add_argument("--in-place", action="store_true", help="let the stage's own file include the new layer")
    result.add_argument("--force", action="store_true", help="replace an output that exists")
    return parser


if __name__ == "__main__":
    sys.exit(main())
