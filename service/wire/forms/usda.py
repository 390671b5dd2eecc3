"""Predictions and drives as a USD text layer: rovers move when the stage plays. From templates, without `pxr`.

A rover's `xformOp:translate` has its positions in the world frame and `xformOp:orient` its pitch, in the order
translate, orient, scale that Omniverse writes. Every column of the answer, in the frame that was asked for, is a custom
attribute `roverTwin:<column>`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from service.physics.scenario import Array
from service.twin.kept import kept
from service.wire.digits import MOST_DECIMALS, Rounded, Texts, Writer, table_text
from service.wire.forms.numbers import DECIMALS, codes_texts, dump, dump_finite, require_finite, table_column
from service.wire.forms.placement import PLAIN, Placement
from service.wire.forms.rover_shape import shape, shape_extent, spin_deg
from service.wire.forms.subject import Stage, Writable

_TURN_DECIMALS = 12  # of a quaternion: no reader sees that it is not quite of length 1
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
{places}    }}
{pivot}    uniform token[] xformOpOrder = {order}
{columns}{shape}}}
"""
_ORIENTS = """\
    quatd xformOp:orient.timeSamples = {{
{samples}    }}
"""
# two lines: USD before 25, which Kit has, reads no samples beside `custom`
_COLUMN = """\
    custom {kind} roverTwin:{name}
    {kind} roverTwin:{name}.timeSamples = {{
{samples}    }}
"""
_SPIN = """\
            double xformOp:rotateY:spin = 0
            double xformOp:rotateY:spin.timeSamples = {{
{samples}            }}
"""
_STILL = """\
            double xformOp:rotateY:spin = 0
"""


def encode_usda(subject: Writable, placement: Placement = PLAIN) -> bytes:
    """The layer of one rover, UTF-8.

    Dividing a time code by timeCodesPerSecond gives the very float64 of `time_s`. Raises NonFiniteError.
    """
    rate, codes = time_codes(subject.columns()["time_s"])
    path, stage, samples = placement.prim_path or "/Rover", subject.stage(), Samples()
    prim = rover(subject, stage, placement, path, codes, samples)
    layer = Layer(subject.about(), stage.doc, rate, codes[0], codes[-1])
    return samples.written(layer.text({path: prim}, placement))


class Samples:
    """What is long in a layer: tables that texts name, and that are written when the layer is."""

    def __init__(self) -> None:
        self._tables: list[tuple[Sequence[Rounded | Texts], Sequence[bytes], int]] = []

    def named(self, at: Texts, columns: Sequence[Rounded | Texts], pieces: Sequence[str]) -> str:
        """What stands in a text for the columns at these time codes; the pieces are around and between the columns."""
        first, *more = (each.encode() for each in pieces)
        self._tables.append(([at, *columns], [b"", b": " + first, *more[:-1], more[-1] + b",\n"], at.count))
        return f"\0{len(self._tables) - 1}\0"

    def written(self, text: str) -> bytes:
        """The text with its tables, UTF-8. No text of ours has a NUL of its own: JSON escapes it."""
        writer = Writer()
        for number, part in enumerate(text.encode().split(b"\0")):
            if number % 2:
                writer.table(*self._tables[int(part)])
            else:
                writer.raw(part)
        return writer.done()


@kept
def time_codes(time_s: Array) -> tuple[float, Array]:
    """Time codes per second and the time codes, shape (time,), with `codes / rate == time_s` to the last bit.

    Whole numbers where some rate makes them so: the one of the step, or a power of ten.
    """
    step = float(np.diff(time_s).min()) if len(time_s) > 1 else 1.0
    for rate in (float(round(min(1.0 / step, _MOST_RATE))), *_RATES):
        if rate >= 1.0 and (np.rint(time_s * rate) / rate == time_s).all():
            return rate, _unchanging(np.rint(time_s * rate))
    return _ODD_RATE, _unchanging(time_s * _ODD_RATE)


def _unchanging(codes: Array) -> Array:
    """Nobody may write to what is kept."""
    codes.flags.writeable = False
    return codes


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


def rover(subject: Writable, stage: Stage, placement: Placement, path: str, codes: Array, samples: Samples) -> str:
    """The prim of one rover, to stand below its parents, at its time codes; its samples go to `samples`.

    `stage` is the subject's. Raises NonFiniteError.
    """
    columns = dict(subject.columns())
    require_finite(columns, "answer")
    at = codes_texts(codes)
    real, imaginary = placement.orientations(stage.pitch_deg)
    turns = _Vectors.of((real, *imaginary), _TURN_DECIMALS)
    places = _Vectors.of(placement.translations(stage.across_m, stage.up_m), _decimals(placement))
    turning = ""
    if len(stage.pitch_deg) == len(codes):
        turning = _ORIENTS.format(samples=samples.named(at, turns.columns, turns.pieces))
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
        places=samples.named(at, places.columns, places.pieces),
        pivot="" if placement.pivot is None else f"    double3 xformOp:translate:pivot = {_fixed(placement.pivot)}\n",
        order="[" + ", ".join(map('"{}"'.format, placement.order)) + "]",
        shape=shape(placement, _spins(columns, at, samples)) if placement.proxy else "",
        columns="".join(_column(name, values, at, samples) for name, values in columns.items() if name != "time_s"),
    )


def _decimals(placement: Placement) -> int:
    """Of positions in units of the stage, to have them in DECIMALS of metres."""
    return min(max(DECIMALS + math.ceil(math.log10(placement.meters_per_unit)), 0), MOST_DECIMALS)


def _spins(columns: Mapping[str, npt.NDArray[Any]], at: Texts, samples: Samples) -> dict[str, str]:
    """How the wheels turn, where the answer knows."""
    spins = {}
    for axle in ("Rear", "Front"):
        speed = columns.get(f"{axle.lower()}_wheel_speed_rad_s")
        if speed is None:
            spins[axle] = _STILL
        else:
            turned = Rounded(spin_deg(speed, columns["time_s"]), DECIMALS, point=False)
            spins[axle] = _SPIN.format(samples=samples.named(at, [turned], ["", ""]))
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


def _column(name: str, values: npt.NDArray[Any], at: Texts, samples: Samples) -> str:
    kind = "bool" if values.dtype == np.bool_ else "double"
    block = samples.named(at, [table_column(name, values, point=False)], ["", ""])
    return _COLUMN.format(kind=kind, name=name, samples=block)


@dataclass(frozen=True, slots=True)
class _Vectors:
    """Texts like (1, 0, 2): what changes is in columns, the rest in the pieces between them."""

    pieces: list[str]
    columns: list[Rounded] = field(default_factory=list)

    @classmethod
    def of(cls, parts: Sequence[float | Array], decimals: int) -> _Vectors:
        """Numbers that stay have all their digits."""
        vectors = cls(["("])
        for number, part in enumerate(parts):
            vectors.pieces[-1] += ", " if number else ""
            if isinstance(part, np.ndarray):
                vectors.columns.append(Rounded(part, decimals, point=False))
                vectors.pieces.append("")
            else:
                vectors.pieces[-1] += _written(np.array([part + 0.0]))[0]  # 0.0: no minus before a zero
        vectors.pieces[-1] += ")"
        return vectors

    def first(self) -> str:
        first = [Rounded(each.values[:1], each.decimals, point=False) for each in self.columns]
        return table_text(first, [each.encode() for each in self.pieces], 1).decode()


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


def _text(text: str) -> str:
    """A USD string; JSON inside it keeps its own escapes."""
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
