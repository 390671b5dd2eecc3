"""Writes a motion into a layer: an `over` whose operations put the rover where the answer says, below any parents.

The order is translate, orient, scale, as Omniverse writes it, with a pivot around it where the asset has one. Scale
and axes of the asset are kept, whatever operations they came from. What three such operations cannot say (a sheared
asset) goes into one matrix more; what no operation below a parent can say (a parent that is sheared, or moves) makes
the rover leave its parents with `!resetXformStack!`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from pxr import Gf, Sdf, Usd, UsdGeom

from rover_twin_usd.motion import Motion
from rover_twin_usd.standing import Standing, linear

RESET = "!resetXformStack!"
_SHAPE = "xformOp:transform:roverTwin"
_KINDS = Sdf.ValueTypeNames
_NEAR = 1e-9


def _same(value: Any) -> Any:  # noqa: ANN401 - one of USD's
    return value


@dataclass(frozen=True)
class Clock:
    """Seconds as time codes: the drive begins at `first`."""

    first: float
    per_second: float

    def codes(self, time_s: Sequence[float]) -> list[float]:
        """A time code for each second."""
        return [self.first + each * self.per_second for each in time_s]


@dataclass(frozen=True)
class _Below:
    """What is above the rover: its parents' matrix, or none of them. `scale` is theirs, `turn` their rotation."""

    inverse: Gf.Matrix4d
    turn: Gf.Matrix3d
    scale: float
    reset: bool
    note: str = ""

    @classmethod
    def of(cls, prim: Usd.Prim, time: Usd.TimeCode) -> _Below:
        """Raises nothing: where the parents do not let it, the rover leaves them."""
        free = cls(Gf.Matrix4d(1.0), Gf.Matrix3d(1.0), 1.0, reset=True)
        if UsdGeom.Xformable(prim).GetResetXformStack():
            return free
        if any(_moves(each) for each in _parents(prim)):
            return cls(free.inverse, free.turn, 1.0, reset=True, note="a parent of the rover moves: it leaves them")
        matrix = UsdGeom.XformCache(time).GetParentToWorldTransform(prim)
        turn = linear(matrix)
        volume = turn.GetDeterminant()
        scale = abs(volume) ** (1.0 / 3.0)
        if volume <= 0 or not Gf.IsClose(turn * turn.GetTranspose(), Gf.Matrix3d(scale * scale), _NEAR * scale * scale):
            note = "a parent of the rover is mirrored or not scaled evenly: it leaves them"
            return cls(free.inverse, free.turn, 1.0, reset=True, note=note)
        return cls(matrix.GetInverse(), turn * (1.0 / scale), scale, reset=False)


@dataclass(frozen=True)
class Target:
    """Where the rover has to be at one moment: the point of its pivot, and its axes, on the stage."""

    at: Gf.Vec3d
    axes: Gf.Matrix3d
    turn: Gf.Matrix3d


def targets(rover: Standing, motion: Motion) -> Iterator[Target]:
    """For each time of the motion. Without an origin the drive starts where the rover stands."""
    side = Gf.Cross(rover.ahead, rover.up)
    moments = list(zip(motion.ahead_m, motion.up_m, motion.pitch_deg, strict=True))
    start = rover.at - _way(rover, *moments[0][:2]) if rover.origin is None else rover.origin
    for ahead, up, pitch in moments:
        turn = Gf.Matrix3d(Gf.Rotation(side, pitch))
        yield Target(start + _way(rover, ahead, up), rover.level * turn, turn)


def author(layer: Sdf.Layer, stage: Usd.Stage, rover: Standing, motion: Motion, clock: Clock) -> list[str]:
    """Write the motion; the stage is only read, at the time of the clock's first code. Returns what the user should
    know.
    """
    there = stage.GetPrimAtPath(rover.path)
    below = _Below.of(there, Usd.TimeCode(clock.first))
    scale, upright = _scale_and_turn(rover.level)
    translate = _Operation.of(there, "xformOp:translate", _KINDS.Double3)
    orient = _Operation.of(there, "xformOp:orient", _KINDS.Quatd, _KINDS.Quatf, Gf.Quatf)
    size = _Operation.of(there, "xformOp:scale", _KINDS.Double3, _KINDS.Float3, Gf.Vec3f)
    point = _Operation.of(there, "xformOp:translate:pivot", _KINDS.Double3, _KINDS.Float3, Gf.Vec3f)
    pivot = Gf.Vec3d(0.0) if upright is None else Gf.Vec3d(point.made(rover.pivot))
    turns: list[Gf.Quatd] = []
    places = []
    for target in targets(rover, motion):
        # the point that is put there is the rover's own, however its pivot is rounded
        at = target.at + (pivot - rover.pivot) * target.axes if upright is not None else target.at
        places.append(below.inverse.TransformAffine(at) - pivot)
        turned = target.turn * below.turn.GetTranspose()
        turns.append(_quaternion(turned if upright is None else upright * turned, turns[-1:]))
    codes = clock.codes(motion.time_s)
    with Sdf.ChangeBlock():
        prim = Sdf.CreatePrimInLayer(layer, rover.path)
        _sampled(prim, translate.name, translate.kind, codes, places)
        _sampled(prim, orient.name, orient.kind, codes, [orient.made(each) for each in turns])
        _said(prim, size.name, size.kind, size.made(scale / below.scale))
        order = [translate.name, orient.name, size.name]
        if upright is None:
            _said(prim, _SHAPE, _KINDS.Matrix4d, _around(rover.pivot, rover.level))
            order.append(_SHAPE)
        elif pivot != Gf.Vec3d(0.0):
            _said(prim, point.name, point.kind, point.made(pivot))
            order.insert(1, point.name)
            order.append(f"!invert!{point.name}")
        order = [RESET, *order] if below.reset else order
        _said(prim, "xformOpOrder", _KINDS.TokenArray, order, Sdf.VariabilityUniform)
        for name, values in motion.columns.items():
            kind = _KINDS.Bool if isinstance(values[0], bool) else _KINDS.Double
            _sampled(prim, f"roverTwin:{name}", kind, codes, values)
        prim.customData = {**prim.customData, "roverTwin": dict(motion.labels)}
    notes = [below.note] if below.note else []
    return [*notes, *(["the asset is sheared: one matrix keeps its shape"] if upright is None else [])]


@dataclass(frozen=True)
class _Operation:
    """An operation by name and kind. One that the asset has in single precision stays so where that is enough; where
    the kinds do not fit, ours has a name of its own, since a value of another kind is a fault to validators.
    """

    name: str
    kind: Sdf.ValueTypeName
    made: Callable[[Any], Any]

    @classmethod
    def of(
        cls,
        prim: Usd.Prim,
        name: str,
        kind: Sdf.ValueTypeName,
        single: Sdf.ValueTypeName | None = None,
        make: Callable[[Any], Any] = _same,
    ) -> _Operation:
        there = prim.GetAttribute(name)
        if not there or there.GetTypeName() == kind:
            return cls(name, kind, _same)
        if single is not None and there.GetTypeName() == single:
            return cls(name, single, make)
        return cls(f"{name}:roverTwin" if name.count(":") == 1 else f"{name}RoverTwin", kind, _same)


def _way(rover: Standing, ahead_m: float, up_m: float) -> Gf.Vec3d:
    return (rover.ahead * ahead_m + rover.up * up_m) / rover.meters_per_unit


def _parents(prim: Usd.Prim) -> Iterator[Usd.Prim]:
    while (prim := prim.GetParent()) and not prim.IsPseudoRoot():
        yield prim


def _moves(prim: Usd.Prim) -> bool:
    found = UsdGeom.Xformable(prim)
    return bool(found) and bool(found.TransformMightBeTimeVarying())


def _scale_and_turn(axes: Gf.Matrix3d) -> tuple[Gf.Vec3d, Gf.Matrix3d | None]:
    """The scale along the asset's own axes, and the rotation after it; no rotation for a sheared asset."""
    lengths = [axes.GetRow(row).GetLength() for row in range(3)]
    if axes.GetDeterminant() < 0:
        lengths[0] = -lengths[0]
    turn = Gf.Matrix3d(*(axes[row][column] / lengths[row] for row in range(3) for column in range(3)))
    if not Gf.IsClose(turn * turn.GetTranspose(), Gf.Matrix3d(1.0), _NEAR):
        return Gf.Vec3d(1.0), None
    return Gf.Vec3d(*lengths), turn


def _around(pivot: Gf.Vec3d, axes: Gf.Matrix3d) -> Gf.Matrix4d:
    return Gf.Matrix4d(1.0).SetTranslate(-pivot) * Gf.Matrix4d(axes, Gf.Vec3d(0.0))


def _quaternion(turn: Gf.Matrix3d, before: Sequence[Gf.Quatd]) -> Gf.Quatd:
    """Of the two quaternions that mean the same the nearer one, so that viewers turn the short way between samples."""
    found = Gf.Matrix4d(turn, Gf.Vec3d(0.0)).ExtractRotationQuat().GetNormalized()
    if not before:
        return found
    together = found.GetReal() * before[0].GetReal() + Gf.Dot(found.GetImaginary(), before[0].GetImaginary())
    return -found if together < 0 else found


def _said(
    prim: Sdf.PrimSpec,
    name: str,
    kind: Sdf.ValueTypeName,
    value: object,
    variability: Sdf.Variability = Sdf.VariabilityVarying,
) -> Sdf.AttributeSpec:
    found = prim.attributes.get(name) or Sdf.AttributeSpec(prim, name, kind, variability, name.startswith("roverTwin:"))
    found.default = value
    return found


def _sampled(
    prim: Sdf.PrimSpec, name: str, kind: Sdf.ValueTypeName, codes: Sequence[float], values: Sequence[object]
) -> None:
    """Samples; an operation has its first one as default too, for who asks without a time."""
    attribute = _said(prim, name, kind, values[0])
    if not name.startswith("xformOp:"):
        attribute.ClearDefaultValue()
    for code, value in zip(codes, values, strict=True):
        prim.layer.SetTimeSample(attribute.path, code, value)
