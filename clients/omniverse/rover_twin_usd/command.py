"""`rover-twin-usd`: a predicted drive on any stage, from a shell."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from typing import Any

from pxr import Sdf, Tf, Usd, UsdGeom

from rover_twin_usd import stages
from rover_twin_usd.authoring import Clock
from rover_twin_usd.failures import RoverTwinUsdError, StageError
from rover_twin_usd.motion import Motion
from rover_twin_usd.options import opened, output_of, parser, question_of, require_together
from rover_twin_usd.proxy import Place, apart, bring
from rover_twin_usd.service import Service
from rover_twin_usd.standing import Standing, Wishes, movable, require_rover, standing


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; 0 if it did what was asked, 1 if it could not, 2 for wrong arguments."""
    options = parser().parse_args(arguments)
    try:
        _run(options)
    except RoverTwinUsdError as error:
        print(f"rover-twin-usd: {error}", file=sys.stderr)
        return 1
    except OSError as error:
        print(f"rover-twin-usd: {error.filename or 'a file'}: {error.strerror or error}", file=sys.stderr)
        return 1
    except Tf.ErrorException as error:
        said = " ".join(getattr(each, "commentary", "").strip() for each in error.args)
        print(f"rover-twin-usd: USD cannot do this: {said}", file=sys.stderr)
        return 1
    return 0


def _run(options: argparse.Namespace) -> None:
    require_together(options)
    stage = opened(options.stage)
    if not options.prim:
        print("\n".join(movable(stage)) or "no prim can be moved; --proxy brings a rover")
        return
    question, output = question_of(options), output_of(options, stage)
    if options.in_place:
        stages.leave_out(stage, output)
    service, clock, layer = (
        Service(options.service),
        stages.clock_of(stage, options.start_s),
        Sdf.Layer.CreateAnonymous(),
    )
    if not options.proxy:
        for path in options.prim:
            require_rover(stage, path)
    motions = [Motion.of(each) for each in service.answers(question)]
    bring_or_find = _proxies if options.proxy else _found
    rovers = bring_or_find(options, stage, layer, (service, question), clock, len(motions))
    if options.proxy or options.origin_m is not None:
        rovers = apart(rovers, options.spacing_m)
    drives = list(zip(rovers, motions, strict=True))
    notes = [f"{rover.path}: {note}" for rover in rovers for note in rover.notes]
    notes += stages.write(layer, stage, drives, clock)
    if options.in_place:
        done, worst = stages.into_file(stage, layer, output, drives, clock)
        notes += done
    else:
        worst = stages.into_new(stage, layer, output, drives, clock, alone=options.layer_only)
    count = sum(len(each.time_s) for each in motions)
    notes.append(f"checked at {count} times: {_where(len(rovers))} within {worst:.1g} m of the answer")
    for rover, motion in drives:
        notes.append(f"{rover.path}: {', '.join(f'{name} {value}' for name, value in motion.labels.items())}")
    print("\n".join([*notes, f"wrote {output}"]))


def _where(rovers: int) -> str:
    return "the rover is" if rovers == 1 else f"{rovers} rovers are"


Asked = tuple[Service, dict[str, Any]]


def _found(
    options: argparse.Namespace, stage: Usd.Stage, _layer: Sdf.Layer, _asked: Asked, clock: Clock, count: int
) -> list[Standing]:
    """The rovers that are on the stage, one for each answer."""
    if count != len(options.prim):
        raise StageError(f"the question has {count} rovers, and {len(options.prim)} are named with --prim")
    wishes = Wishes(options.forward or "X", options.pivot, options.origin_m, options.heading_deg)
    return [standing(stage, path, Usd.TimeCode(clock.first), wishes) for path in options.prim]


def _proxies(
    options: argparse.Namespace, stage: Usd.Stage, layer: Sdf.Layer, asked: Asked, clock: Clock, _count: int
) -> list[Standing]:
    """Rovers of simple shapes, defined in the layer."""
    service, question = asked
    layout = {"up_axis": str(UsdGeom.GetStageUpAxis(stage)), "meters_per_unit": UsdGeom.GetStageMetersPerUnit(stage)}
    wheels = [each for each in question.get("include", []) if each == "wheel_speed"]
    text = service.layer({**question, "frame": "world", "include": wheels}, proxy="true", **layout)
    return bring(stage, layer, options.prim[0], text, clock, Place(options.origin_m, options.heading_deg))


if __name__ == "__main__":
    sys.exit(main())
