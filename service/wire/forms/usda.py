"""A prediction as a USD text layer: the rover moves when the stage plays. Written from a template, without `pxr`.

One prim, `/Rover`, whose `xformOp:translate` has the position samples and whose `xformOp:orient` is the pitch of the
slope. In both frames it ends up at the same place of the stage, which is Z-up with X horizontal: world positions are
translated as they are, positions in the slope frame are pitched together with the rover, as `xformOpOrder` says.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from service.physics.scenario import Array
from service.twin import Frame
from service.wire.forms.numbers import dump, require_finite
from service.wire.forms.subject import Subject

_RATES = (10.0, 100.0, 1_000.0, 10_000.0)  # the last one is the finest step of the service
_MOST_RATE = 1e6
_AXES = {
    Frame.SLOPE: "X along the slope, positive uphill; Y normal to it, here the Z of xformOp:translate",
    Frame.WORLD: "X horizontal; Z up",
}
_ORDER = {
    Frame.SLOPE: '["xformOp:orient", "xformOp:translate"]',
    Frame.WORLD: '["xformOp:translate", "xformOp:orient"]',
}
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
    custom double roverTwin:{name}.timeSamples = {{
{samples}
    }}
"""


def encode_usda(subject: Subject) -> bytes:
    """The layer, UTF-8. Columns that are no position (speeds, prior, band) are custom attributes `roverTwin:<column>`.

    Dividing a time code by timeCodesPerSecond gives the very float64 of `time_s`. Raises NonFiniteError.
    """
    prediction = subject.prediction
    columns = dict(subject.columns())
    require_finite(columns, "answer")
    rate, codes = time_codes(columns.pop("time_s"))
    x, across = (columns.pop(name) for name in prediction.position_names)
    at = _written(codes)
    orient = _pitch(prediction.scenario.slope_deg)
    twin = subject.loaded.twin
    places = map("({}, 0, {})".format, _written(x), _written(across))
    return _TEMPLATE.format(
        axes=_text(_AXES[prediction.frame]),
        frame=_text(prediction.frame.value),
        metadata=_text(dump(subject.about()).decode()),
        doc=_text(f"{twin.name}@{twin.version}: rear wheel's centre of a rover on a slope, {prediction.frame} frame"),
        rate=_written(np.array([rate]))[0],
        start=at[0],
        end=at[-1],
        orient=orient,
        orients=_samples([at[0], at[-1]] if len(at) > 1 else at, [orient] * 2),
        positions=_samples(at, places),
        order=_ORDER[prediction.frame],
        more="".join(_COLUMN.format(name=name, samples=_samples(at, _written(c))) for name, c in columns.items()),
    ).encode()


def time_codes(time_s: Array) -> tuple[float, Array]:
    """Time codes per second and the time codes, shape (time,), with `codes / rate == time_s` to the last bit.

    Whole numbers where some rate makes them so: the one of the step, or a power of ten. Else seconds themselves.
    """
    step = float(np.diff(time_s).min()) if len(time_s) > 1 else 1.0
    for rate in (float(round(min(1.0 / step, _MOST_RATE))), *_RATES):
        if rate >= 1.0 and (np.rint(time_s * rate) / rate == time_s).all():
            return rate, np.rint(time_s * rate)
    return 1.0, time_s


def _pitch(slope_deg: float) -> str:
    """The rotation about Y that lifts X by the slope, as (w, x, y, z): right-handed, so that uphill is negative."""
    half = math.radians(slope_deg) / 2.0
    w, y = _written(np.array([math.cos(half), -math.sin(half)]))
    return f"({w}, 0, {y}, 0)"


def _written(values: Array) -> list[str]:
    """Shortest decimals, whole numbers without a point."""
    texts = dump(values)[1:-1].decode().split(",")
    return [text.removesuffix(".0") for text in texts]


def _samples(codes: Iterable[str], values: Iterable[str]) -> str:
    return "\n".join(map("        {}: {},".format, codes, values))


def _text(text: str) -> str:
    """A USD string; JSON inside it keeps its own escapes."""
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
