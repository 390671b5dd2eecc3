"""Predictions and drives as a USD text layer: rovers move when the stage plays. From templates, without `pxr`.

A rover's `xformOp:translate` has its positions in the world frame and `xformOp:orient` its pitch, in the order
translate, orient, scale that Omniverse writes. Every column of the answer, in the frame that was asked for, is a custom
attribute `roverTwin:<column>`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from operator import add
from typing import Any

import numpy as np
import numpy.typing as npt

from service.physics.scenario import Array
from service.wire.forms.numbers import dump, dump_finite, require_finite
from service.wire.forms.placement import PLAIN, Placement
from service.wire.forms.rover_shape import shape, shape_extent, spin_deg
from service.wire.forms.subject import Writable

_RATES = (10.0, 100.0, 1_000.0, 10_000.0)  # the last one is the finest step of the service
_MOST_RATE = 1e6
_ODD_RATE = 32.0  # a power of two: times it and over it is exact for every float
_USUAL_FRAMES = 30.0
_AXES = {"Z": "X horizontal; Z up", "Y": "X horizontal; Y up; -Z to the left"}
_LAYER = """\
#usda 1.0
(
    customLayerData = {{
        dictionary roverTwin = {{
            string axes = {axes}
            string frame = "world"
            string metadata = {metadata}
            string quaternion = "real part first: w, x, y, z"
            string seconds = "timeCode / timeCodesPerSecond"
        }}
    }}
{root}    doc = {doc}
    endTimeCode = {end}
    framesPerSecond = {frames}
    kilogramsPerUnit = 1
    metersPerUnit = {meters}
    startTimeCode = {start}
    timeCodesPerSecond = {rate}
    upAxis = "{up}"
)

{prims}"""
_ROVER = """\
{specifier} "{name}" (
{model}    customData = {{
        dictionary roverTwin = {{
{labels}
        }}
    }}
{kind})
{{
{extent}    quatd xformOp:orient = {orient}
{orients}    double3 xformOp:scale{scale}
    double3 xformOp:translate = {place}
    double3 xformOp:translate.timeSamples = {{
{places}
    }}
{pivot}    uniform token[] xformOpOrder = {order}
{columns}{shape}}}
"""
_ORIENTS = """\
    quatd xformOp:orient.timeSamples = {{
{samples}
    }}
"""
# two lines: USD before 25, which Kit has, reads no samples beside `custom`
_COLUMN = """\
    custom {kind} roverTwin:{name}
    {kind} roverTwin:{name}.timeSamples = {{
{samples}
    }}
"""
_SPIN = """\
            double xformOp:rotateY:spin = 0
            double xformOp:rotateY:spin.timeSamples = {{
{samples}
            }}
"""
_STILL = """\
            double xformOp:rotateY:spin = 0
"""


def encode_usda(subject: Writable, placement: Placement = PLAIN) -> bytes:
    """The layer of one rover, UTF-8.

    Dividing a time code by timeCodesPerSecond gives the very float64 of `time_s`. Raises NonFiniteError.
    """
    rate, codes = time_codes(subject.columns()["time_s"])
    path = placement.prim_path or "/Rover"
    prim = rover(subject, placement, path, codes)
    layer = Layer(subject.about(), subject.stage().doc, rate, codes[0], codes[-1])
    return layer.text({path: prim}, placement).encode()


def time_codes(time_s: Array) -> tuple[float, Array]:
    """Time codes per second and the time codes, shape (time,), with `codes / rate == time_s` to the last bit.

    Whole numbers where some rate makes them so: the one of the step, or a power of ten.
    """
    step = float(np.diff(time_s).min()) if len(time_s) > 1 else 1.0
    for rate in (float(round(min(1.0 / step, _MOST_RATE))), *_RATES):
        if rate >= 1.0 and (np.rint(time_s * rate) / rate == time_s).all():
            return rate, np.rint(time_s * rate)
    return _ODD_RATE, time_s * _ODD_RATE


@dataclass(frozen=True, slots=True)
class Layer:
    """What a layer says beside its prims: `about` goes into its data; `first` and `last` are time codes."""

    about: Mapping[str, Any]
    doc: str
    rate: float
    first: float
    last: float

    def text(self, prims: Mapping[str, str], placement: Placement) -> str:
        """The layer with these prims, each text by its path."""
        start, end, rate, frames, meters = _written(
            np.array([self.first, self.last, self.rate, _frames(self.rate), placement.meters_per_unit])
        )
        return _LAYER.format(
            axes=_text(_AXES[placement.up_axis]),
            metadata=_text(dump(self.about).decode()),
            root=f'    defaultPrim = "{next(iter(prims)).split("/")[1]}"\n' if prims else "",
            doc=_text(self.doc),
            start=start,
            end=end,
            rate=rate,
            frames=frames,
            meters=meters,
            up=placement.up_axis,
            prims=_nested(prims, placement),
        )


def rover(subject: Writable, placement: Placement, path: str, codes: Array) -> str:
    """The prim of one rover, to stand below its parents; `codes` are its time codes. Raises NonFiniteError."""
    columns, stage, at = dict(subject.columns()), subject.stage(), _written(codes)
    require_finite(columns, "answer")
    before = list(map("        {}: ".format, at))
    real, imaginary = placement.orientations(stage.pitch_deg)
    turns = _Vectors.of((real, *imaginary))
    places = _Vectors.of(placement.translations(stage.across_m, stage.up_m))
    turning = _ORIENTS.format(samples=turns.samples(at)) if len(stage.pitch_deg) == len(at) else ""
    scale = 1.0 if placement.scale is None else placement.scale
    return _ROVER.format(
        specifier="over" if placement.over else "def Xform",
        name=path.rpartition("/")[2],
        model='    prepend apiSchemas = ["GeomModelAPI"]\n' if placement.proxy else "",
        kind='    kind = "component"\n' if placement.proxy else "",
        labels="\n".join(_labels(subject.headers())),
        extent=f"    float3[] extentsHint = [{shape_extent(placement)}]\n" if placement.proxy else "",
        orient=turns.first(),
        orients=turning,
        # an asset keeps its own scale: the operation is named, and its value shows through
        scale="" if placement.over and placement.scale is None else f" = {_same(scale)}",
        place=places.first(),
        places=places.samples(at),
        pivot="" if placement.pivot is None else f"    double3 xformOp:translate:pivot = {_fixed(placement.pivot)}\n",
        order="[" + ", ".join(map('"{}"'.format, placement.order)) + "]",
        shape=shape(placement, _spins(columns, before)) if placement.proxy else "",
        columns="".join(_column(name, before, values) for name, values in columns.items() if name != "time_s"),
    )


def _spins(columns: Mapping[str, npt.NDArray[Any]], before: Sequence[str]) -> dict[str, str]:
    """How the wheels turn, where the answer knows."""
    spins = {}
    for axle in ("Rear", "Front"):
        speed = columns.get(f"{axle.lower()}_wheel_speed_rad_s")
        turned = None if speed is None else _written(spin_deg(speed, columns["time_s"]))
        spins[axle] = _STILL if turned is None else _SPIN.format(samples=_samples(before, turned))
    return spins


def _nested(prims: Mapping[str, str], placement: Placement) -> str:
    """The prims below their parents, each parent written once."""
    tree: dict[str, Any] = {}
    for path, text in prims.items():
        *parents, name = path.split("/")[1:]
        inside = tree
        for each in parents:
            inside = inside.setdefault(each, {})
        inside[name] = text
    opening = 'over "{}"\n{{\n' if placement.over else 'def Xform "{}" (\n    kind = "group"\n)\n{{\n'
    return "\n".join(_opened(tree, opening))


def _opened(tree: Mapping[str, Any], opening: str) -> Iterable[str]:
    for name, inside in tree.items():
        yield inside if isinstance(inside, str) else opening.format(name) + "\n".join(_opened(inside, opening)) + "}\n"


def _labels(headers: Mapping[str, str]) -> Iterable[str]:
    """What the response headers say, since a layer's own data are not seen through the stage that includes it."""
    for name, value in headers.items():
        first, *more = name.removeprefix("Rover-Twin-").split("-")
        yield f"            string {first.lower()}{''.join(more)} = {_text(value)}"


def _column(name: str, before: Sequence[str], values: npt.NDArray[Any]) -> str:
    kind = "bool" if values.dtype == np.bool_ else "double"
    texts = _written(values.astype(np.int64) if kind == "bool" else values)
    return _COLUMN.format(kind=kind, name=name, samples=_samples(before, texts))


@dataclass(frozen=True, slots=True)
class _Vectors:
    """Texts like (1, 0, 2): what stays the same is in the template, what changes in columns."""

    template: str
    columns: Sequence[list[str]]

    @classmethod
    def of(cls, parts: Sequence[float | Array]) -> _Vectors:
        changing = [isinstance(each, np.ndarray) for each in parts]
        texts = [_written(np.atleast_1d(each) + 0.0) for each in parts]  # 0.0: no minus before a zero
        slots = ["{}" if changes else text[0] for changes, text in zip(changing, texts, strict=True)]
        columns = [text for changes, text in zip(changing, texts, strict=True) if changes]
        return cls(f"({', '.join(slots)})", columns)

    def first(self) -> str:
        return self.template.format(*(each[0] for each in self.columns))

    def samples(self, at: Sequence[str]) -> str:
        return ",\n".join(map(("        {}: " + self.template).format, at, *self.columns))


def _fixed(vector: tuple[float, ...]) -> str:
    return "(" + ", ".join(_written(np.array(vector, dtype=np.float64))) + ")"


def _same(value: float) -> str:
    return _fixed((value,) * 3)


def _frames(rate: float) -> float:
    """Frames to show in a second."""
    return rate if 12.0 <= rate <= 120.0 else _USUAL_FRAMES


def _written(values: npt.NDArray[Any]) -> list[str]:
    """Shortest decimals, whole numbers without a point."""
    return (dump_finite(values)[1:-1] + b",").replace(b".0,", b",").decode()[:-1].split(",")


def _samples(before: Sequence[str], values: Sequence[str]) -> str:
    return ",\n".join(map(add, before, values))


def _text(text: str) -> str:
    """A USD string; JSON inside it keeps its own escapes."""
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
