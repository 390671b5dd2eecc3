"""A rover for who has none: VIPER made of USD's own shapes. No likeness, but the right size, and wheels that turn.

Its own axes are Z-up and in metres, its zero is the middle between the rear wheels' centres. Wheels, wheelbase and
track are those of Chrono's VIPER (`Viper.cpp`: wheels at 0.6418 m before and behind and 0.6098 m beside the middle,
`RealWheel` with a radius of 0.25 m; 0.2 m wide as in its slope demo). Its whole height is that of the VIPER which NASA
describes (1.5 x 1.5 x 2.5 m with the mast); body and mast in between are guessed.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from service.physics.parameters import VIPER
from service.physics.scenario import Array
from service.wire.forms.placement import Placement

_HALF_TRACK_M = 0.6098
_WHEEL_WIDTH_M = 0.2
_HIGHEST_M = 2.5 - VIPER.wheel_radius_m
_WHEELS = {
    "RearLeft": (0.0, _HALF_TRACK_M),
    "RearRight": (0.0, -_HALF_TRACK_M),
    "FrontLeft": (VIPER.wheelbase_m, _HALF_TRACK_M),
    "FrontRight": (VIPER.wheelbase_m, -_HALF_TRACK_M),
}
_BOX = """\
        def Cube "{name}"
        {{
            float3[] extent = [(-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)]
            color3f[] primvars:displayColor = [{color}]
            double size = 1
            double3 xformOp:scale = {size}
            double3 xformOp:translate = {middle}
            uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
        }}
"""
_WHEEL = """\
        def Xform "{name}"
        {{
            double3 xformOp:translate = ({x}, {y}, 0)
{spin}            uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateY:spin"]

            def Cylinder "Rim"
            {{
                uniform token axis = "Y"
                float3[] extent = [(-{radius}, -{half}, -{radius}), ({radius}, {half}, {radius})]
                double height = {width}
                color3f[] primvars:displayColor = [(0.35, 0.36, 0.38)]
                double radius = {radius}
            }}

            def Cube "Spoke"
            {{
                float3[] extent = [(-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)]
                color3f[] primvars:displayColor = [(0.85, 0.55, 0.2)]
                double size = 1
                double3 xformOp:scale = ({spoke}, {wider}, 0.04)
                uniform token[] xformOpOrder = ["xformOp:scale"]
            }}
        }}
"""
_SHAPE = """\
    def Xform "Shape"
    {{
        uniform token purpose = "default"
        quatd xformOp:orient = {orient}
        double3 xformOp:scale = ({unit}, {unit}, {unit})
        uniform token[] xformOpOrder = ["xformOp:orient", "xformOp:scale"]

{parts}    }}
"""
_UPRIGHT = {"Z": "(1, 0, 0, 0)", "Y": "(0.7071067811865476, -0.7071067811865476, 0, 0)"}


def shape(placement: Placement, spins: Mapping[str, str]) -> str:
    """The prims below the rover; `spins` are the lines of `xformOp:rotateY:spin` of rear and front wheels."""
    middle = VIPER.wheelbase_m / 2.0
    parts = [
        _box("Body", (1.5, 0.95, 0.9), (middle, 0.0, 0.65), "(0.8, 0.78, 0.72)"),
        _box("Mast", (0.1, 0.1, _HIGHEST_M - 1.25), (middle + 0.5, 0.0, (_HIGHEST_M + 0.95) / 2.0), "(0.6, 0.6, 0.6)"),
        _box("Head", (0.2, 0.5, 0.15), (middle + 0.5, 0.0, _HIGHEST_M - 0.075), "(0.2, 0.2, 0.22)"),
        *(_wheel(name, x, y, spins["Rear" if x == 0.0 else "Front"]) for name, (x, y) in _WHEELS.items()),
    ]
    unit = f"{1.0 / placement.meters_per_unit:.17g}"
    return _SHAPE.format(orient=_UPRIGHT[placement.up_axis], unit=unit, parts="\n".join(parts))


def shape_extent(placement: Placement) -> str:
    """The corners of everything that `shape` draws, in the rover's own coordinates."""
    radius, aside = VIPER.wheel_radius_m, _HALF_TRACK_M + _WHEEL_WIDTH_M / 2.0 + 0.01
    low, high = (-radius, -aside, -radius), (VIPER.wheelbase_m + radius, aside, _HIGHEST_M)
    if placement.up_axis == "Y":
        low, high = (low[0], low[2], -high[1]), (high[0], high[2], -low[1])
    return ", ".join(_vector(*(each / placement.meters_per_unit for each in corner)) for corner in (low, high))


def spin_deg(speed_rad_s: Array, time_s: Array) -> Array:
    """How far wheels have turned by then, degrees, (time,)."""
    turned = np.diff(time_s) * (speed_rad_s[1:] + speed_rad_s[:-1]) / 2.0
    angles: Array = np.degrees(np.concatenate([[0.0], np.cumsum(turned)]))
    return angles


def _wheel(name: str, x: float, y: float, spin: str) -> str:
    radius = VIPER.wheel_radius_m
    return _WHEEL.format(
        name=name,
        x=x,
        y=y,
        spin=spin,
        radius=radius,
        half=_WHEEL_WIDTH_M / 2.0,
        width=_WHEEL_WIDTH_M,
        spoke=2.0 * radius - 0.04,
        wider=_WHEEL_WIDTH_M + 0.02,
    )


def _box(name: str, size: tuple[float, float, float], middle: tuple[float, float, float], color: str) -> str:
    return _BOX.format(name=name, size=_vector(*size), middle=_vector(*middle), color=color)


def _vector(x: float, y: float, z: float) -> str:
    return f"({x:.12g}, {y:.12g}, {z:.12g})"
