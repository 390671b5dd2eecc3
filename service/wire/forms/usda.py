"""A prediction or a drive as a USD text layer: the rover moves when the stage plays. From a template, without `pxr`.

One prim, `/Rover`, whose `xformOp:translate` has the position samples and whose `xformOp:orient` is its pitch. The
stage is Z-up with X horizontal: world positions are translated as they are, positions in the frame of a constant slope
are pitched together with the rover, as `xformOpOrder` says.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from service.physics.scenario import Array
from service.wire.forms.numbers import dump, require_finite
from service.wire.forms.subject import Writable

_RATES = (10.0, 100.0, 1_000.0, 10_000.0)  # the last one is the finest step of the service
_MOST_RATE = 1e6
_TEMPLATE = """\
#usda 1.0
(
    customLayerData = {{
        dictionary roverTwin = {{
            string axes = {axes}
            string frame = {frame}
            string metadata = {metadata}
            string quaternion = "real part first: w, x, y, z"
            string seconds = "timeCode / timeCodesPerSecond"
        }}
    }}
    defaultPrim = "Rover"
    doc = {doc}
    endTimeCode = {end}
    kilogramsPerUnit = 1
    metersPerUnit = 1
    startTimeCode = {start}
    timeCodesPerSecond = {rate}
    upAxis = "Z"
)

def Xform "Rover"
{{
    quatf xformOp:orient = {orient}
    quatf xformOp:orient.timeSamples = {{
{orients}
    }}
    double3 xformOp:translate.timeSamples = {{
{positions}
    }}
    uniform token[] xformOpOrder = {order}
{more}}}
"""
_COLUMN = """\
    custom {kind} roverTwin:{name}.timeSamples = {{
{samples}
    }}
"""


def encode_usda(subject: Writable) -> bytes:
    """The layer, UTF-8. Columns that the translation does not say (speeds, prior, band) are custom attributes
    `roverTwin:<column>`.

    Dividing a time code by timeCodesPerSecond gives the very float64 of `time_s`. Raises NonFiniteError.
    """
    stage, columns, about = subject.stage(), dict(subject.columns()), subject.about()
    require_finite(columns, "answer")
    rate, codes = time_codes(columns.pop("time_s"))
    at, orients = _written(codes), _pitches(stage.pitch_deg)
    turns = at if len(orients) == len(at) else [at[0], at[-1]]
    places = map("({}, 0, {})".format, _written(stage.across_m), _written(stage.up_m))
    return _TEMPLATE.format(
        axes=_text(stage.axes),
        frame=_text(stage.frame),
        metadata=_text(dump(about).decode()),
        doc=_text(stage.doc),
        rate=_written(np.array([rate]))[0],
        start=at[0],
        end=at[-1],
        orient=orients[0],
        orients=_samples(turns, orients if len(orients) == len(turns) else orients * 2),
        positions=_samples(at, places),
        order=stage.order,
        more="".join(_column(name, at, values) for name, values in columns.items() if name not in stage.told),
    ).encode()


def _column(name: str, at: Sequence[str], values: npt.NDArray[Any]) -> str:
    kind = "bool" if values.dtype == np.bool_ else "double"
    texts = _written(values.astype(np.int64) if kind == "bool" else values)
    return _COLUMN.format(kind=kind, name=name, samples=_samples(at, texts))


def time_codes(time_s: Array) -> tuple[float, Array]:
    """Time codes per second and the time codes, shape (time,), with `codes / rate == time_s` to the last bit.

    Whole numbers where some rate makes them so: the one of the step, or a power of ten. Else seconds themselves.
    """
    step = float(np.diff(time_s).min()) if len(time_s) > 1 else 1.0
    for rate in (float(round(min(1.0 / step, _MOST_RATE))), *_RATES):
        if rate >= 1.0 and (np.rint(time_s * rate) / rate == time_s).all():
            return rate, np.rint(time_s * rate)
    return 1.0, time_s


def _pitches(slope_deg: Array) -> list[str]:
    """The rotations about Y that lift X by slopes, as (w, x, y, z): right-handed, so that uphill is negative."""
    half = np.radians(slope_deg) / 2.0
    return list(map("({}, 0, {}, 0)".format, _written(np.cos(half)), _written(-np.sin(half))))


def _written(values: npt.NDArray[Any]) -> list[str]:
    """Shortest decimals, whole numbers without a point."""
    texts = dump(values)[1:-1].decode().split(",")
    return [text.removesuffix(".0") for text in texts]


def _samples(codes: Iterable[str], values: Iterable[str]) -> str:
    return "\n".join(map("        {}: {},".format, codes, values))


def _text(text: str) -> str:
    """A USD string; JSON inside it keeps its own escapes."""
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
