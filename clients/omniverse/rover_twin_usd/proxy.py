"""A rover of simple shapes for a stage without one: shapes and turning wheels are the service's, the motion is ours.

So it keeps the time codes of the stage, and stands right below any parents, as every other rover does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from pxr import Gf, Sdf, Usd, UsdGeom

from rover_twin_usd.authoring import Clock
from rover_twin_usd.failures import StageError
from rover_twin_usd.standing import Standing, heading_turn, stage_up

_OURS = ("xformOp", "roverTwin:")


@dataclass(frozen=True)
class Place:
    """Where the zero of the positions is, in metres along the stage's axes, and where the first rover looks."""

    origin_m: Sequence[float] | None = None
    heading_deg: float | None = None


def bring(stage: Usd.Stage, layer: Sdf.Layer, base: str, text: str, clock: Clock, place: Place) -> list[Standing]:
    """Define in `layer` the rovers of a layer of the service, and show them on the stage through its session.

    One rover is at `base`; those of a batch have `_0`, `_1` and so on after it. Raises StageError where nothing can
    be put there.
    """
    source = Sdf.Layer.CreateAnonymous(".usda")
    source.ImportFromString(text)
    found = _rovers(source)
    paths = [base] if "/Rover" in found else [f"{base}_{each.rpartition('_')[2]}" for each in found]
    for path in paths:
        _require_free(stage, path)
    for rover, path in zip(found, paths, strict=True):
        _strip(source, rover, clock)
        _add_parents(stage, layer, Sdf.Path(path))
        Sdf.CopySpec(source, rover, layer, path)
    session = stage.GetSessionLayer()
    session.subLayerPaths = [layer.identifier, *session.subLayerPaths]
    for path in paths:
        if not stage.GetPrimAtPath(path):
            raise StageError(f"nothing can be put at {path}: something on the stage keeps it away")
    return [_standing(stage, path, place) for path in paths]


def apart(rovers: Sequence[Standing], spacing_m: float | None) -> list[Standing]:
    """Rovers with one zero of their positions in a row instead, to the right of the first. Raises StageError."""
    if len(rovers) > 1 and not spacing_m:
        raise StageError(f"{len(rovers)} rovers would start on one spot: say with --spacing-m how far apart")
    right = Gf.Cross(rovers[0].ahead, rovers[0].up) * ((spacing_m or 0.0) / rovers[0].meters_per_unit)
    return [
        each if each.origin is None else replace(each, origin=each.origin + right * number)
        for number, each in enumerate(rovers)
    ]


def _standing(stage: Usd.Stage, path: str, place: Place) -> Standing:
    meters, up, east = UsdGeom.GetStageMetersPerUnit(stage), stage_up(stage), Gf.Vec3d.XAxis()
    turn = heading_turn(up, east, place.heading_deg or 0.0)
    origin = Gf.Vec3d(*(place.origin_m or (0.0, 0.0, 0.0))) / meters
    hidden = UsdGeom.Imageable(stage.GetPrimAtPath(path)).ComputeVisibility() == UsdGeom.Tokens.invisible
    return Standing(
        path=path,
        meters_per_unit=meters,
        pivot=Gf.Vec3d(0.0),
        at=origin,
        level=turn,
        ahead=east * turn,
        up=up,
        origin=origin,
        notes=["a rover of simple shapes, as large as VIPER", *(["a parent makes it invisible"] if hidden else [])],
    )


def _rovers(source: Sdf.Layer) -> list[str]:
    if source.GetPrimAtPath("/Rover"):
        return ["/Rover"]
    return [str(each.path) for each in source.GetPrimAtPath("/Rovers").nameChildren]


def _strip(source: Sdf.Layer, rover: str, clock: Clock) -> None:
    """Take the service's motion off a rover, and put what is left, its wheels, into the time of the stage."""
    prim = source.GetPrimAtPath(rover)
    for each in list(prim.properties):
        if each.name.startswith(_OURS):
            prim.RemoveProperty(each)

    def retime(path: Sdf.Path) -> None:
        if path.IsPropertyPath():
            codes = source.ListTimeSamplesForPath(path)
            values = [source.QueryTimeSample(path, code) for code in codes]
            for code in codes:
                source.EraseTimeSample(path, code)
            seconds = [code / source.timeCodesPerSecond for code in codes]
            for code, value in zip(clock.codes(seconds), values, strict=True):
                source.SetTimeSample(path, code, value)

    source.Traverse(rover, retime)


def _require_free(stage: Usd.Stage, path: str) -> None:
    found = Sdf.Path(path) if Sdf.Path.IsValidPathString(path) else Sdf.Path()
    if not (found.IsPrimPath() and found.IsAbsolutePath()):
        raise StageError(f"--prim is {path!r}, allowed is a new path such as /RoverTwin")
    if stage.GetPrimAtPath(path):
        raise StageError(f"--proxy brings new rovers: name a --prim that does not exist yet, {path} does")
    for each in found.GetPrefixes()[:-1]:
        parent = stage.GetPrimAtPath(each)
        if not parent:
            return
        if parent.IsInstance() or parent.IsInstanceProxy() or parent.IsInPrototype():
            raise StageError(f"{each} is an instance, and nothing can be put below one: name another --prim")
        if not parent.IsActive() or parent.IsAbstract():
            kind = "a class" if parent.IsActive() else "inactive"
            raise StageError(f"{each} is {kind}: nothing below it is on the stage; name another --prim")


def _add_parents(stage: Usd.Stage, layer: Sdf.Layer, path: Sdf.Path) -> None:
    """Parents that the stage has stay as they are; others are defined."""
    for each in path.GetPrefixes()[:-1]:
        parent = stage.GetPrimAtPath(each)
        if not layer.GetPrimAtPath(each):
            prim = Sdf.CreatePrimInLayer(layer, each)
            if not (parent and parent.IsDefined()):
                prim.specifier, prim.typeName, prim.kind = Sdf.SpecifierDef, "Xform", "group"
