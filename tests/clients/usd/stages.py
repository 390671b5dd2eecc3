"""Stages that users have, and what the service answers, for tests of `rover_twin_usd`."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

from service.twin import Frame, Loaded, Scenario, sample_times
from service.twin.drives import DriveQuestion, Ground, Wanted, controls_of
from service.wire.drives.ask import driven
from service.wire.forms import Format, Subject, written
from tests.twin.drives.made import champion

ROVER = "/World/Site/Rover"
# an asset as a converter leaves it: Z-up and metres inside, resolved for the stage, with a pivot and Euler angles
ASSET = """\
#usda 1.0
(
    defaultPrim = "Viper"
    metersPerUnit = 1
    upAxis = "Z"
)

def Xform "Viper" (
    kind = "component"
)
{
    def Cube "Body"
    {
        float3[] extent = [(-1, -1, -1), (1, 1, 1)]
        double3 xformOp:translate = (0, 0, 0.75)
        float3 xformOp:scale = (0.9, 0.7, 0.75)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
    }
}
"""
OPERATIONS = {
    "none": ("", []),
    "translate": ("double3 xformOp:translate = (3, 4, 5)", ["xformOp:translate"]),
    "omniverse": (
        "quatd xformOp:orient = (0.9, 0.1, 0.3, 0.3)\n"
        "double3 xformOp:scale = (1.5, 1.5, 1.5)\n"
        "double3 xformOp:translate = (30, 40, -50)",
        ["xformOp:translate", "xformOp:orient", "xformOp:scale"],
    ),
    "converted": (
        "double3 xformOp:translate = (10, 20, 30)\n"
        "float3 xformOp:translate:pivot = (1, 2, 3)\n"
        "float3 xformOp:rotateXYZ = (12, 34, 5)\n"
        "float3 xformOp:scale = (2, 2, 2)\n"
        "double xformOp:rotateX:unitsResolve = -90\n"
        "double3 xformOp:scale:unitsResolve = (100, 100, 100)",
        ["xformOp:translate", "xformOp:translate:pivot", "xformOp:rotateXYZ", "xformOp:scale",
         "!invert!xformOp:translate:pivot", "xformOp:rotateX:unitsResolve", "xformOp:scale:unitsResolve"],
    ),
    "single": (
        "double3 xformOp:translate = (1, 2, 3)\nfloat3 xformOp:scale = (1.7, 1.7, 1.7)\n"
        "quatf xformOp:orient = (0.8, 0.6, 0, 0)\nfloat3 xformOp:translate:pivot = (0, 0, 0)",
        ["xformOp:translate", "xformOp:orient", "xformOp:scale"],
    ),
    "coarse": (
        "float3 xformOp:translate = (1, 2, 3)\nhalf3 xformOp:scale = (2, 2, 2)\nquath xformOp:orient = (1, 0, 0, 0)\n"
        "half3 xformOp:translate:pivot = (1, 2, 3)",
        ["xformOp:translate", "xformOp:orient", "xformOp:scale"],
    ),
    "uneven": ("float3 xformOp:scale = (1, 2, 0.5)\nfloat xformOp:rotateZ = 33", ["xformOp:rotateZ", "xformOp:scale"]),
    "mirrored": ("float3 xformOp:scale = (1, -1, 1)", ["xformOp:scale"]),
    "sheared": (
        "matrix4d xformOp:transform = ( (1, 0.2, 0, 0), (0, 1, 0.1, 0), (0.3, 0, 1, 0), (7, 8, 9, 1) )",
        ["xformOp:transform"],
    ),
    "animated": ("double3 xformOp:translate.timeSamples = { 1: (1, 2, 3), 9: (4, 4, 4) }", ["xformOp:translate"]),
    "alone": ("double3 xformOp:translate = (3, 4, 5)", ["!resetXformStack!", "xformOp:translate"]),
}  # fmt: skip
PARENTS = {
    "plain": ("", []),
    "turned and scaled": (
        "float3 xformOp:rotateXYZ = (80, -20, 130)\n"
        "float3 xformOp:scale = (3, 3, 3)\n"
        "double3 xformOp:translate = (1, 2, 3)",
        ["xformOp:translate", "xformOp:rotateXYZ", "xformOp:scale"],
    ),
    "uneven": ("float3 xformOp:scale = (1, 2, 3)", ["xformOp:scale"]),
    "moving": ("float xformOp:rotateZ.timeSamples = { 0: 0, 100: 90 }", ["xformOp:rotateZ"]),
}


def stage_in(
    folder: Path, up_axis: str, meters_per_unit: float, rover: str = "converted", parent: str = "plain", more: str = ""
) -> Path:
    """A stage with a rover that is a reference, below a parent; `more` is metadata of its prim."""
    (folder / "viper.usda").write_text(ASSET)
    (own, own_order), (above, above_order) = OPERATIONS[rover], PARENTS[parent]
    file = folder / "site.usda"
    file.write_text(f"""\
#usda 1.0
(
    customLayerData = {{
        dictionary cameraSettings = {{
            string boundCamera = "/OmniverseKit_Persp"
        }}
    }}
    defaultPrim = "World"
    endTimeCode = 100
    metersPerUnit = {meters_per_unit}
    startTimeCode = 1
    timeCodesPerSecond = 60
    upAxis = "{up_axis}"
)

def Xform "World"
{{
    def Xform "Site"
    {{
{above}
        uniform token[] xformOpOrder = {json.dumps(above_order)}

        def Xform "Rover" (
            {more}
            prepend references = @./viper.usda@
        )
        {{
{own}
            uniform token[] xformOpOrder = {json.dumps(own_order)}
        }}
    }}
}}
""")
    return file


@cache
def answers() -> dict[str, dict[str, Any]]:
    """JSON answers in the world frame."""
    twin = Loaded(champion(), None)
    times = sample_times(10.0, 0.5)
    uphill = Subject(twin, twin.twin.predict(Scenario(24, 430, 80, 10), times, Frame.WORLD, with_speed=True))
    ground = Ground.of_slopes([0, 1.5, 2.5, 4], [10, 22, 4, -12])
    question = DriveQuestion(430.0, ground, controls_of([0, 4, 5], [70, 0, 90], [False, True, False]), horizon_s=12.0)
    hills = driven(question, Wanted(dt_s=0.25, frame=Frame.WORLD), False, twin)
    return {name: json.loads(written(Format.JSON, each)) for name, each in (("prediction", uphill), ("drive", hills))}
