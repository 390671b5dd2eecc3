"""Where a motion goes: into a new stage above the user's, into a layer alone, into the user's file, or a session.

Only `into_file` changes a file of the user's, and it can be undone: whatever that file itself said of how the rover
stands is moved into a second layer beside, since a file is stronger than all that it includes.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path

from pxr import Gf, Sdf, Usd, UsdGeom

from rover_twin_usd.authoring import Clock, author, targets
from rover_twin_usd.failures import StageError
from rover_twin_usd.motion import Motion
from rover_twin_usd.standing import Standing

Drives = Sequence[tuple[Standing, Motion]]
EXACT_M = 1e-6


def clock_of(stage: Usd.Stage, start_s: float = 0.0) -> Clock:
    """The stage's own time codes; the drive begins so many seconds after the stage does."""
    per_second = stage.GetTimeCodesPerSecond()
    return Clock(stage.GetStartTimeCode() + start_s * per_second, per_second)


def write(layer: Sdf.Layer, stage: Usd.Stage, drives: Drives, clock: Clock) -> list[str]:
    """Write motions and what a layer says of itself, in axes, units and time of the stage. Returns notes."""
    notes: list[str] = []
    for rover, motion in drives:
        notes += [f"{rover.path}: {each}" for each in author(layer, stage, rover, motion, clock)]
    root = layer.pseudoRoot
    root.SetInfo(UsdGeom.Tokens.upAxis, UsdGeom.GetStageUpAxis(stage))
    root.SetInfo(UsdGeom.Tokens.metersPerUnit, UsdGeom.GetStageMetersPerUnit(stage))
    layer.timeCodesPerSecond, layer.framesPerSecond = clock.per_second, stage.GetFramesPerSecond()
    layer.startTimeCode, layer.endTimeCode = span(stage, drives, clock)
    layer.defaultPrim = stage.GetRootLayer().defaultPrim or drives[0][0].path.split("/")[1]
    layer.customLayerData = {
        **layer.customLayerData,
        "roverTwin": {
            "frame": "world",
            "quaternion": "real part first: w, x, y, z",
            "seconds": f"(timeCode - {clock.first:g}) / timeCodesPerSecond",
        },
    }
    return notes


def span(stage: Usd.Stage, drives: Drives, clock: Clock) -> tuple[float, float]:
    """First and last time code that shows the stage and all of the drives."""
    last = max(clock.codes(motion.time_s)[-1] for _, motion in drives)
    return min(stage.GetStartTimeCode(), clock.first), max(stage.GetEndTimeCode(), last)


def above(layer: Sdf.Layer, stage: Usd.Stage, file: Path) -> None:
    """Let a layer that is to be saved at `file` include the user's stage: opened, it shows all of it."""
    source = stage.GetRootLayer()
    layer.subLayerPaths.append(_beside(Path(source.realPath), file))
    layer.customLayerData = {**source.customLayerData, **layer.customLayerData}
    if source.pseudoRoot.HasInfo("kilogramsPerUnit"):
        layer.pseudoRoot.SetInfo("kilogramsPerUnit", source.pseudoRoot.GetInfo("kilogramsPerUnit"))


def into_file(stage: Usd.Stage, motion: Path, drives: Drives, clock: Clock) -> list[str]:
    """Include the saved layer `motion` in the user's file, and save that. Returns what was done to it.

    Raises StageError, and leaves the file as it was, where the rovers are not moved as they should be.
    """
    root = stage.GetRootLayer()
    done = [f"{root.GetDisplayName()} includes {motion.name} now"]
    start, end = span(stage, drives, clock)
    pose = motion.with_suffix(f".before{motion.suffix}")
    kept = _layer(pose) if any(_own(root, rover.path) for rover, _ in drives) else None
    with Sdf.ChangeBlock():
        for rover, _ in drives:
            for name in _own(root, rover.path):
                path = Sdf.Path(rover.path).AppendProperty(name)
                Sdf.CreatePrimInLayer(kept, rover.path)
                Sdf.CopySpec(root, path, kept, path)
                prim = root.GetPrimAtPath(rover.path)
                prim.RemoveProperty(root.GetPropertyAtPath(path))
        layers = [motion, pose] if kept else [motion]
        names = [_beside(each, Path(root.realPath)) for each in layers]
        root.subLayerPaths = [*names, *(each for each in root.subLayerPaths if each not in names)]
        root.startTimeCode, root.endTimeCode = start, end
    try:
        require_exact(stage, drives, clock)
    except StageError:
        root.Reload(force=True)
        raise
    if kept:
        for setting in (UsdGeom.Tokens.upAxis, UsdGeom.Tokens.metersPerUnit, "timeCodesPerSecond"):
            if root.pseudoRoot.HasInfo(setting):
                kept.pseudoRoot.SetInfo(setting, root.pseudoRoot.GetInfo(setting))
        kept.Save()
        done.append(f"how the rover stood went to {pose.name}: take {motion.name} out, and it stands there again")
    root.Save()
    return done


def into_session(stage: Usd.Stage, layer: Sdf.Layer, drives: Drives, clock: Clock) -> None:
    """Show the motion on an open stage, above everything that its files say; no file is changed."""
    session = stage.GetSessionLayer()
    session.subLayerPaths = [layer.identifier, *(each for each in session.subLayerPaths if each != layer.identifier)]
    session.startTimeCode, session.endTimeCode = span(stage, drives, clock)


def require_exact(stage: Usd.Stage, drives: Drives, clock: Clock) -> float:
    """The largest distance (m) between where the composed stage has the rovers and where they should be.

    Raises StageError where it is more than a thousandth of a millimetre: something on the stage is stronger.
    """
    worst = 0.0
    for rover, motion in drives:
        prim = stage.GetPrimAtPath(rover.path)
        for code, target in zip(clock.codes(motion.time_s), targets(rover, motion), strict=True):
            found = UsdGeom.XformCache(Usd.TimeCode(code)).GetLocalToWorldTransform(prim)
            ends = [rover.pivot, *(rover.pivot + each for each in _unit(rover))]
            wanted = [target.at, *(target.at + each * target.axes for each in _unit(rover))]
            for end, at in zip(ends, wanted, strict=True):
                worst = max(worst, (found.TransformAffine(end) - at).GetLength() * rover.meters_per_unit)
        far = max(rover.at.GetLength() * rover.meters_per_unit, 1.0)
        if worst > max(EXACT_M, 1e-12 * far):
            raise StageError(
                f"{rover.path} is {worst:.3g} m away from where it should be: a stronger layer says otherwise"
            )
    return worst


def _unit(rover: Standing) -> Iterable[Gf.Vec3d]:
    """Vectors of a metre along the axes of the asset, in its own coordinates."""
    for row in range(3):
        length = rover.level.GetRow(row).GetLength() * rover.meters_per_unit
        yield Gf.Vec3d(*(1.0 / length if at == row else 0.0 for at in range(3)))


def empty_layer(file: Path) -> Sdf.Layer:
    """A layer without anything, to be saved at `file`; whatever is there goes."""
    layer = _layer(file)
    layer.Clear()
    return layer


def _layer(file: Path) -> Sdf.Layer:
    return Sdf.Layer.FindOrOpen(str(file)) if file.exists() else Sdf.Layer.CreateNew(str(file))


def _own(layer: Sdf.Layer, path: str) -> list[str]:
    """The operations that a layer itself has for a prim."""
    prim = layer.GetPrimAtPath(path)
    return [] if prim is None else [each.name for each in prim.properties if each.name.startswith("xformOp")]


def _beside(file: Path, reader: Path) -> str:
    """The path of one layer as another one names it."""
    try:
        found = Path(os.path.relpath(file.resolve(), reader.resolve().parent)).as_posix()
    except ValueError:  # another drive, on Windows
        return file.resolve().as_posix()
    return found if found.startswith("..") else f"./{found}"
