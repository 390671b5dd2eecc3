"""Where a motion goes: into a new stage above the user's, into a layer alone, into the user's file, or a session.

Only `into_file` changes a file of the user's, and it can be undone: whatever that file itself said of how the rover
stands is moved into a second layer beside, since a file is stronger than all that it includes.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from pxr import Gf, Sdf, Tf, Usd, UsdGeom

from rover_twin_usd.authoring import Clock, author, targets
from rover_twin_usd.failures import StageError
from rover_twin_usd.motion import Motion
from rover_twin_usd.standing import Standing

Drives = Sequence[tuple[Standing, Motion]]
EXACT_M = 1e-6


def clock_of(stage: Usd.Stage, start_s: float = 0.0) -> Clock:
    """The stage's own time codes; the drive begins so many seconds after the stage does. Raises StageError."""
    per_second = stage.GetTimeCodesPerSecond()
    if not 0.0 < per_second < math.inf:
        raise StageError(f"timeCodesPerSecond of the stage is {per_second:g}, allowed is a number above 0")
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


def leave_out(stage: Usd.Stage, motion: Path) -> None:
    """Read a stage without the motion that was put into its file before: its rover stands where it stood."""
    root = stage.GetRootLayer()
    name = _beside(motion, Path(root.realPath))
    if name in root.subLayerPaths and (layer := Sdf.Layer.FindRelativeToLayer(root, name)):
        stage.MuteLayer(layer.identifier)


def into_new(stage: Usd.Stage, layer: Sdf.Layer, file: Path, drives: Drives, clock: Clock, *, alone: bool) -> float:
    """Save a motion at `file`, above the user's stage or `alone`. Returns the largest distance, as `require_exact`.

    Raises StageError, and `file` is as it was: what fails the check, or cannot be written, never has that name.
    """
    stage.GetSessionLayer().Clear()
    if not alone:
        above(layer, stage, file)
    with _written(layer, file) as written:
        if not alone:
            return require_exact(Usd.Stage.Open(str(written)), drives, clock)
        into_session(stage, Sdf.Layer.FindOrOpen(str(written)), drives, clock)
        worst = require_exact(stage, drives, clock)
        stage.GetSessionLayer().Clear()
        return worst


def into_file(stage: Usd.Stage, layer: Sdf.Layer, file: Path, drives: Drives, clock: Clock) -> tuple[list[str], float]:
    """Save a motion at `file`, and let the user's own file include it. Returns what was done, and as `require_exact`.

    Raises StageError, and leaves all files as they were, where the rovers are not moved as they should be.
    """
    root, pose = stage.GetRootLayer(), file.with_suffix(f".before{file.suffix}")
    start, end = span(stage, drives, clock)
    names = [_beside(each, Path(root.realPath)) for each in (file, pose)]
    kept = Sdf.Layer.CreateAnonymous()
    moves = any(_own(root, rover.path) for rover, _ in drives)
    if moves and names[1] in root.subLayerPaths:
        kept.TransferContent(Sdf.Layer.FindOrOpen(str(pose)))
    names = names if moves else names[:1]
    others = [each for each in root.subLayerPaths if each not in names]
    with Sdf.ChangeBlock():
        for rover, _ in drives:
            _move(root, kept, rover.path)
        root.subLayerPaths = [layer.identifier, *([kept.identifier] if moves else []), *others]
    try:
        worst = require_exact(stage, drives, clock)
    except StageError:
        root.Reload(force=True)
        raise
    done = [f"{root.GetDisplayName()} includes {file.name} now"]
    if moves:
        for setting in (UsdGeom.Tokens.upAxis, UsdGeom.Tokens.metersPerUnit, "timeCodesPerSecond"):
            if root.pseudoRoot.HasInfo(setting):
                kept.pseudoRoot.SetInfo(setting, root.pseudoRoot.GetInfo(setting))
        kept.customLayerData = {"roverTwin": {"before": file.name}}
        with _written(kept, pose):
            done.append(f"how the rover stood went to {pose.name}: take {file.name} out, and it stands there again")
    with _written(layer, file):
        pass
    root.subLayerPaths = [*names, *others]
    root.startTimeCode, root.endTimeCode = start, end
    root.Save()
    return done, worst


def _move(root: Sdf.Layer, kept: Sdf.Layer, rover: str) -> None:
    """What a layer itself says of where a rover stands goes to another one."""
    for name in _own(root, rover):
        path = Sdf.Path(rover).AppendProperty(name)
        Sdf.CreatePrimInLayer(kept, rover)
        Sdf.CopySpec(root, path, kept, path)
        root.GetPrimAtPath(rover).RemoveProperty(root.GetPropertyAtPath(path))


@contextmanager
def _written(layer: Sdf.Layer, file: Path) -> Iterator[Path]:
    """A layer in a file beside `file`, to look at; it gets that name when all went well. Raises StageError."""
    beside = file.with_name(f".{file.stem}.{os.getpid()}{file.suffix}")
    try:
        try:
            layer.Export(str(beside))
        except Tf.ErrorException as error:
            raise StageError(f"{file} cannot be written") from error
        yield beside
        beside.replace(file)
    finally:
        beside.unlink(missing_ok=True)
    if known := Sdf.Layer.Find(str(file)):
        known.Reload(force=True)


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
        limit = max(EXACT_M, 1e-12 * rover.at.GetLength() * rover.meters_per_unit)
        for code, target in zip(clock.codes(motion.time_s), targets(rover, motion), strict=True):
            found = UsdGeom.XformCache(Usd.TimeCode(code)).GetLocalToWorldTransform(prim)
            ends = [rover.pivot, *(rover.pivot + each for each in _unit(rover))]
            wanted = [target.at, *(target.at + each * target.axes for each in _unit(rover))]
            for end, at in zip(ends, wanted, strict=True):
                distance = (found.TransformAffine(end) - at).GetLength() * rover.meters_per_unit
                if not distance <= limit:  # this way round, since nothing is more than NaN
                    why = "a stronger layer says otherwise" if math.isfinite(distance) else "its place is not finite"
                    raise StageError(f"{rover.path} is {distance:.3g} m away from where it should be: {why}")
                worst = max(worst, distance)
    return worst


def _unit(rover: Standing) -> Iterable[Gf.Vec3d]:
    """Vectors of a metre along the axes of the asset, in its own coordinates."""
    for row in range(3):
        length = rover.level.GetRow(row).GetLength() * rover.meters_per_unit
        yield Gf.Vec3d(*(1.0 / length if at == row else 0.0 for at in range(3)))


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
