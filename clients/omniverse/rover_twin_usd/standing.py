"""How a rover stands on a stage before it drives: its axes, its scale, the point that the positions are of.

Everything is read from the composed stage, so it does not matter which operations and which layers put it there.
Matrices are USD's: a row vector times a matrix.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from pxr import Gf, Sdf, Usd, UsdGeom

from rover_twin_usd.failures import StageError

WHEELBASE_M = 1.2836  # Chrono's VIPER: wheels 0.6418 m before and behind the middle
WHEEL_RADIUS_M = 0.25  # its RealWheel
_LENGTHS_M = (WHEELBASE_M, 4.0)
AXES = {
    name: Gf.Vec3d(*(sign if at == axis else 0.0 for at in range(3)))
    for axis, letter in enumerate("XYZ")
    for name, sign in ((letter, 1.0), (f"-{letter}", -1.0))
}
"""The axes of an asset by name."""


@dataclass(frozen=True)
class Wishes:
    """What the user knows better. `pivot` is in the asset's own coordinates, `origin_m` along the stage's axes in m."""

    forward: str = "X"
    pivot: Sequence[float] | None = None
    origin_m: Sequence[float] | None = None
    heading_deg: float | None = None


@dataclass(frozen=True)
class Standing:
    """A rover before its drive. `level` turns the asset's axes into the stage's, with the rover horizontal.

    `at` is where `pivot` is, in the stage's units; the drive starts there, unless `origin` is the zero of its
    positions instead. `ahead` and `up` are unit vectors of the stage. `notes` are what the user should know.
    """

    path: str
    meters_per_unit: float
    pivot: Gf.Vec3d
    at: Gf.Vec3d
    level: Gf.Matrix3d
    ahead: Gf.Vec3d
    up: Gf.Vec3d
    origin: Gf.Vec3d | None = None
    notes: Sequence[str] = field(default_factory=tuple)


def require_rover(stage: Usd.Stage, path: str) -> Usd.Prim:
    """The prim of the rover. Raises StageError for one that cannot be moved."""
    prim = stage.GetPrimAtPath(path) if path.startswith("/") else None
    if not prim:
        some = ", ".join(movable(stage)[:12]) or "none"
        raise StageError(f"there is no prim {path!r} on the stage; prims that can be moved: {some}")
    if prim.IsInstanceProxy() or prim.IsInPrototype():
        raise StageError(f"{path} is inside an instance and cannot be moved alone; name the instance itself")
    if not prim.IsActive() or prim.IsAbstract():
        raise StageError(f"{path} is {'a class' if prim.IsActive() else 'inactive'}: nothing of it is on the stage")
    if not UsdGeom.Xformable(prim):
        raise StageError(f"{path} is a {prim.GetTypeName() or 'prim without type'}, which cannot be moved")
    return prim


def movable(stage: Usd.Stage) -> list[str]:
    """Paths of prims that could be a rover: those that can be moved, at most three names deep."""
    found = [prim for prim in stage.Traverse() if prim.GetPath().pathElementCount <= 3 and UsdGeom.Xformable(prim)]
    return [str(prim.GetPath()) for prim in found]


def standing(stage: Usd.Stage, path: str, time: Usd.TimeCode, wishes: Wishes) -> Standing:
    """How the rover stands at that time. Raises StageError."""
    prim = require_rover(stage, path)
    if wishes.forward not in AXES:
        raise StageError(f"the axis that looks ahead is {wishes.forward!r}, allowed is one of {', '.join(AXES)}")
    world = UsdGeom.XformCache(time).GetLocalToWorldTransform(prim)
    axes = linear(world)
    if not all(math.isfinite(each) for row in world for each in row):
        raise StageError(f"{path} is placed with numbers that are not finite")
    if abs(axes.GetDeterminant()) < 1e-30:
        raise StageError(f"{path} is scaled to nothing")
    meters = UsdGeom.GetStageMetersPerUnit(stage)
    up = stage_up(stage)
    own_up = max(AXES, key=lambda name: Gf.Dot((AXES[name] * axes).GetNormalized(), up))
    if wishes.forward.strip("-") == own_up.strip("-"):
        raise StageError(f"the rover's {wishes.forward} points up or down: name another axis as --forward")
    level, ahead = _levelled(axes, AXES[own_up], AXES[wishes.forward], up, wishes.heading_deg)
    if wishes.pivot is None:
        pivot, notes = _guessed_pivot(_box(stage, path, time), (wishes.forward, own_up), axes, meters)
    else:
        pivot, notes = Gf.Vec3d(*wishes.pivot), []
    if UsdGeom.Imageable(prim).ComputeVisibility(time) == UsdGeom.Tokens.invisible:
        notes = [*notes, "the rover is invisible on this stage"]
    return Standing(
        path=path,
        meters_per_unit=meters,
        pivot=pivot,
        at=world.TransformAffine(pivot),
        level=level,
        ahead=ahead,
        up=up,
        origin=None if wishes.origin_m is None else Gf.Vec3d(*wishes.origin_m) / meters,
        notes=[f"the rover looks along its {wishes.forward}, its {own_up} points up", *notes],
    )


def linear(matrix: Gf.Matrix4d) -> Gf.Matrix3d:
    """The matrix without its translation."""
    return Gf.Matrix3d(*(matrix[row][column] for row in range(3) for column in range(3)))


def stage_up(stage: Usd.Stage) -> Gf.Vec3d:
    """The direction that is up on a stage."""
    return Gf.Vec3d.ZAxis() if UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z else Gf.Vec3d.YAxis()


def heading_turn(up: Gf.Vec3d, ahead: Gf.Vec3d, heading_deg: float) -> Gf.Matrix3d:
    """What turns a rover that looks `ahead` (level) to a heading, from X counterclockwise as seen from above."""
    return _turn(up, ahead, Gf.Vec3d.XAxis() * Gf.Matrix3d(Gf.Rotation(up, heading_deg)))


def _turn(up: Gf.Vec3d, start: Gf.Vec3d, end: Gf.Vec3d) -> Gf.Matrix3d:
    """The rotation about `up` from one level direction to another."""
    angle = math.degrees(math.atan2(Gf.Dot(Gf.Cross(start, end), up), Gf.Dot(start, end)))
    return Gf.Matrix3d(Gf.Rotation(up, angle))


def _levelled(
    axes: Gf.Matrix3d, own_up: Gf.Vec3d, forward: Gf.Vec3d, up: Gf.Vec3d, heading_deg: float | None
) -> tuple[Gf.Matrix3d, Gf.Vec3d]:
    """The axes without roll and pitch, turned to the heading if there is one; and where the rover looks then.

    Without a heading it looks where it looked: taking out roll and pitch together turns a rover, so it is turned back.
    """
    level = axes * Gf.Matrix3d(Gf.Rotation((own_up * axes).GetNormalized(), up))
    looked, looks = _flat(forward * axes, up), _flat(forward * level, up)
    turn = _turn(up, looks, looked) if heading_deg is None else heading_turn(up, looks, heading_deg)
    return level * turn, (looks * turn).GetNormalized()


def _flat(way: Gf.Vec3d, up: Gf.Vec3d) -> Gf.Vec3d:
    return (way - up * Gf.Dot(way, up)).GetNormalized()


def _box(stage: Usd.Stage, path: str, time: Usd.TimeCode) -> Gf.Range3d:
    """The box of what is drawn, along the asset's own axes.

    USD measures along other axes first where the prim is turned, and its box grows. So the rover is measured without
    any operations: on a stage of its own, above the same layers.
    """
    plain = Sdf.Layer.CreateAnonymous()
    plain.subLayerPaths = [stage.GetSessionLayer().identifier] if stage.GetSessionLayer() else []
    prim, kind = Sdf.CreatePrimInLayer(plain, path), Sdf.ValueTypeNames.TokenArray
    Sdf.AttributeSpec(prim, "xformOpOrder", kind, Sdf.VariabilityUniform).default = ["!resetXformStack!"]
    alone = Usd.Stage.OpenMasked(stage.GetRootLayer(), plain, Usd.StagePopulationMask([path]))
    shown = [UsdGeom.Tokens.default_, UsdGeom.Tokens.render, UsdGeom.Tokens.proxy]
    cache = UsdGeom.BBoxCache(time, shown, useExtentsHint=True)
    return cache.ComputeUntransformedBound(alone.GetPrimAtPath(path)).ComputeAlignedRange()


def _guessed_pivot(
    box: Gf.Range3d, names: tuple[str, str], axes: Gf.Matrix3d, meters: float
) -> tuple[Gf.Vec3d, list[str]]:
    """Where the rear axle is if the asset is a VIPER that fills its box: in the asset's own coordinates."""
    if box.IsEmpty():
        return Gf.Vec3d(0.0), ["nothing is drawn below the rover: its zero is taken for the middle of the rear axle"]
    forward, up = (AXES[name] for name in names)
    long, high = (abs(Gf.Dot(box.GetSize(), each)) * (each * axes).GetLength() * meters for each in (forward, up))
    if not _LENGTHS_M[0] <= long <= _LENGTHS_M[1]:
        note = (
            f"the rover is {long:.3g} m long and {high:.3g} m high on this stage ({meters:g} m per unit): do its units "
            "fit? The middle of its box is taken for that of its rear axle; give --pivot"
        )
        return box.GetMidpoint(), [note]
    back = WHEELBASE_M / 2.0 / ((forward * axes).GetLength() * meters)
    lift = WHEEL_RADIUS_M / ((up * axes).GetLength() * meters)
    middle = box.GetMidpoint()
    bottom = min(Gf.Dot(box.GetMin(), up), Gf.Dot(box.GetMax(), up))
    pivot = middle - forward * back + up * (bottom + lift - Gf.Dot(middle, up))
    return pivot, [f"rear axle guessed from the rover's box: --pivot {pivot[0]:.6g},{pivot[1]:.6g},{pivot[2]:.6g}"]
