"""A predicted drive on an open stage, at once and without changing a file: what the extension's button does."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pxr import Sdf, Usd

from rover_twin_usd import stages
from rover_twin_usd.failures import StageError
from rover_twin_usd.motion import Motion
from rover_twin_usd.standing import Wishes, require_rover, standing

_LAYER = "rover-twin"
USUAL_WISHES = Wishes()


@dataclass(frozen=True)
class Shown:
    """What is on the stage now: first and last time code of the drive, and what the user should know."""

    first: float
    last: float
    per_second: float
    notes: Sequence[str]


def show(stage: Usd.Stage, path: str, answer: dict[str, Any], wishes: Wishes = USUAL_WISHES) -> Shown:
    """Move the rover by a JSON answer of the service. A drive that was shown before goes first.

    Raises StageError and ServiceError.
    """
    require_rover(stage, path)
    motion = Motion.of(answer)
    hide(stage)
    clock = stages.clock_of(stage)
    rover = standing(stage, path, Usd.TimeCode(clock.first), wishes)
    layer = Sdf.Layer.CreateAnonymous(_LAYER)
    notes = [*rover.notes, *stages.write(layer, stage, [(rover, motion)], clock)]
    stages.into_session(stage, layer, [(rover, motion)], clock)
    try:
        worst = stages.require_exact(stage, [(rover, motion)], clock)
    except StageError:
        hide(stage)
        raise
    codes = clock.codes(motion.time_s)
    notes += [f"{name} {value}" for name, value in motion.labels.items()]
    return Shown(codes[0], codes[-1], clock.per_second, [*notes, f"within {worst:.1g} m of the answer"])


def hide(stage: Usd.Stage) -> None:
    """Take away what `show` put on the stage; the rover stands where it stood."""
    session = stage.GetSessionLayer()
    shown = [each for each in session.subLayerPaths if each.startswith("anon:") and each.endswith(f":{_LAYER}")]
    if shown:
        session.subLayerPaths = [each for each in session.subLayerPaths if each not in shown]
        session.pseudoRoot.ClearInfo("startTimeCode")
        session.pseudoRoot.ClearInfo("endTimeCode")
