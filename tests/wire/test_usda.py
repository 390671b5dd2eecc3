"""A layer over somebody's stage: the rover is where the answer says, in that stage's axes and units.

Each expectation is made from the JSON answer's numbers by hand and compared with what USD itself computes.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pxr import Gf, Sdf, Usd, UsdGeom, UsdValidation

from service.twin import Frame, Loaded, Scenario, sample_times
from service.twin.drives import DriveQuestion, Ground, Wanted, controls_of
from service.wire.drives.ask import driven
from service.wire.drives.subject import DriveSubject
from service.wire.forms import Subject
from service.wire.forms.placement import Placement
from service.wire.forms.usda import encode_usda
from tests.api.readings import stage_of
from tests.twin.drives.made import champion

EXACT_M = 1e-6
# an asset with operations of its own, as exporters write them: none of them is ours
ASSET = """\
#usda 1.0
(
    metersPerUnit = 0.01
    upAxis = "Y"
)

def Xform "World"
{
    def Xform "Rover"
    {
        float3 xformOp:rotateXYZ = (10, 20, 30)
        float3 xformOp:scale = (2, 2, 2)
        double3 xformOp:translate = (1, 2, 3)
        float3 xformOp:translate:pivot = (5, 6, 7)
        double3 xformOp:scale:unitsResolve = (100, 100, 100)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:translate:pivot", "xformOp:rotateXYZ", \
"xformOp:scale", "!invert!xformOp:translate:pivot", "xformOp:scale:unitsResolve"]

        def Cube "Body"
        {
        }
    }
}
"""


@cache
def prediction(frame: Frame = Frame.SLOPE) -> Subject:
    times = sample_times(10.0, 0.5)
    twin = champion()
    return Subject(Loaded(twin, None), twin.predict(Scenario(24, 430, 80, 10), times, frame, with_wheel_speed=True))


@cache
def drive(frame: Frame = Frame.SLOPE) -> DriveSubject:
    ground = Ground.of_slopes([0, 1.5, 2.5, 4], [10, 22, 4, -12])
    question = DriveQuestion(430.0, ground, controls_of([0, 4, 5], [70, 0, 90], [False, True, False]), horizon_s=12.0)
    return driven(question, Wanted(dt_s=0.25, frame=frame, wheel_speed=True), False, Loaded(champion(), None))


def truth(kind: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """x, z and pitch of the answer in the world frame: m, m, degrees."""
    found = {"prediction": prediction, "drive": drive}[kind](Frame.WORLD)
    columns = found.columns()
    pitch = columns["slope_deg"] if kind == "drive" else np.full(len(columns["x_m"]), 24.0)
    return columns["x_m"], columns["z_m"], pitch


def over(asset: str, body: bytes) -> Usd.Stage:
    """The layer as the strongest sublayer of a stage that has nothing else but the asset."""
    weak, strong, root = (Sdf.Layer.CreateAnonymous(".usda") for _ in range(3))
    assert weak.ImportFromString(asset)
    assert strong.ImportFromString(body.decode())
    root.subLayerPaths = [strong.identifier, weak.identifier]
    stage = Usd.Stage.Open(root)
    stage.kept = (weak, strong)  # anonymous layers live as long as somebody holds them
    return stage


def placed(stage: Usd.Stage, path: str, code: float) -> Gf.Matrix4d:
    return UsdGeom.XformCache(Usd.TimeCode(code)).GetLocalToWorldTransform(stage.GetPrimAtPath(path))


def by_hand(across: float, up: float, pitch: float, placement: Placement) -> tuple[np.ndarray, np.ndarray]:
    """Where the rear wheel's centre is and which way the rover looks, in units and axes of the stage."""
    heading, lift = math.radians(placement.heading_deg), math.radians(pitch)
    right_handed = {"Z": ([1, 0, 0], [0, 1, 0], [0, 0, 1]), "Y": ([1, 0, 0], [0, 0, -1], [0, 1, 0])}
    ahead, left, above = map(np.array, right_handed[placement.up_axis])
    level = math.cos(heading) * ahead + math.sin(heading) * left
    at = np.array(placement.origin_m) + across * level + up * above
    return at / placement.meters_per_unit, math.cos(lift) * level + math.sin(lift) * above


coordinates = st.floats(-1e4, 1e4).map(lambda each: round(each, 3))
points = st.tuples(coordinates, coordinates, coordinates)
placements = st.builds(
    Placement,
    prim_path=st.sampled_from(["/World/Rover", "/World"]),
    origin_m=points,
    heading_deg=st.floats(-360, 360),
    pivot=st.none() | st.tuples(*[st.floats(-50, 50)] * 3),
    scale=st.none() | st.sampled_from([1.0, 0.01, 100.0]),
    up_axis=st.sampled_from(["Y", "Z"]),
    meters_per_unit=st.sampled_from([1.0, 0.01, 0.0254]),
)


@pytest.mark.parametrize("kind", ["prediction", "drive"])
@given(placement=placements)
@settings(max_examples=40, deadline=None)
def test_the_rover_is_where_the_answer_says_on_any_stage(kind, placement):
    stage = over(ASSET, encode_usda({"prediction": prediction, "drive": drive}[kind](), placement))
    rover = stage.GetPrimAtPath(placement.prim_path)
    scale = placement.scale or (2.0 if placement.prim_path == "/World/Rover" else 1.0)
    codes = rover.GetAttribute("xformOp:translate").GetTimeSamples()
    near = EXACT_M / placement.meters_per_unit

    assert [op.GetOpName() for op in UsdGeom.Xformable(rover).GetOrderedXformOps()] == list(placement.order)
    for code, *where in list(zip(codes, *truth(kind), strict=True))[::5]:
        found = placed(stage, placement.prim_path, code)
        at, ahead = by_hand(*where, placement)
        np.testing.assert_allclose(found.Transform(Gf.Vec3d(*(placement.pivot or (0, 0, 0)))), at, atol=near, rtol=0)
        np.testing.assert_allclose(found.TransformDir(Gf.Vec3d(1, 0, 0)), scale * ahead, atol=1e-9)
        assert abs(found.GetDeterminant3() / scale**3 - 1) < 1e-9


def test_a_rover_keeps_its_scale_and_everything_below_it():
    body = encode_usda(prediction(), Placement("/World/Rover", up_axis="Y", meters_per_unit=0.01))
    stage = over(ASSET, body)

    assert stage.GetPrimAtPath("/World/Rover/Body")
    assert placed(stage, "/World/Rover", 0).GetRow3(1).GetLength() == pytest.approx(2)
    alone = stage_of(body)
    assert [each.GetSpecifier() for each in alone.TraverseAll()] == [Sdf.SpecifierOver] * 2


@pytest.mark.parametrize("frames_per_second", [None, 24, 60])
def test_seconds_are_seconds_on_a_stage_of_another_rate(frames_per_second):
    said = f"timeCodesPerSecond = {frames_per_second}\n    " if frames_per_second else ""
    asset = ASSET.replace("upAxis", said + "upAxis")
    stage = over(asset, encode_usda(prediction(), Placement("/World/Rover")))
    stage.GetRootLayer().timeCodesPerSecond = frames_per_second or 24
    x_m, z_m, _ = truth("prediction")

    for at in (0, 7, 20):
        code = 0.5 * at * stage.GetTimeCodesPerSecond()
        assert list(placed(stage, "/World/Rover", code).Transform(Gf.Vec3d(0))) == pytest.approx([x_m[at], 0, z_m[at]])


def test_without_a_time_the_rover_stands_at_its_start():
    stage = over(ASSET, encode_usda(drive(), Placement("/World/Rover")))
    start = placed(stage, "/World/Rover", stage.GetStartTimeCode())

    assert UsdGeom.XformCache().GetLocalToWorldTransform(stage.GetPrimAtPath("/World/Rover")) == start


@pytest.mark.parametrize("up_axis", ["Y", "Z"])
@pytest.mark.parametrize("meters_per_unit", [1.0, 0.01])
@pytest.mark.parametrize("prim_path", ["", "/Site/Rovers/First"])
def test_the_proxy_stands_on_its_wheels_and_is_as_large_as_viper(up_axis, meters_per_unit, prim_path):
    placement = Placement(prim_path, up_axis=up_axis, meters_per_unit=meters_per_unit, proxy=True)
    stage = stage_of(encode_usda(prediction(), placement))
    rover = stage.GetPrimAtPath(prim_path or "/Rover")
    bounds = UsdGeom.BBoxCache(Usd.TimeCode(0), [UsdGeom.Tokens.default_])
    drawn = bounds.ComputeUntransformedBound(rover).ComputeAlignedRange()
    low, high = np.array(drawn.GetMin()) * meters_per_unit, np.array(drawn.GetMax()) * meters_per_unit
    up, aside = (1, 2) if up_axis == "Y" else (2, 1)

    assert (low[0], high[0]) == (pytest.approx(-0.25, abs=1e-6), pytest.approx(1.5336, abs=1e-6))
    assert (low[up], high[up]) == (pytest.approx(-0.25, abs=1e-6), pytest.approx(2.25, abs=1e-6))
    assert low[aside] == pytest.approx(-high[aside], abs=1e-6)
    hint = UsdGeom.ModelAPI(rover).GetExtentsHint()
    np.testing.assert_allclose(np.array(hint) * meters_per_unit, [low, high], atol=1e-5)
    assert Usd.ModelAPI(rover).GetKind() == "component"
    assert rover.IsModel()


def test_wheels_turn_as_far_as_their_speed_says():
    stage = stage_of(encode_usda(prediction(), Placement(proxy=True)))
    spin = stage.GetPrimAtPath("/Rover/Shape/FrontLeft").GetAttribute("xformOp:rotateY:spin")
    columns = prediction().columns()
    turned = np.degrees(np.trapezoid(columns["front_wheel_speed_rad_s"], columns["time_s"]))

    assert spin.Get(spin.GetTimeSamples()[-1]) == pytest.approx(turned)
    # forwards: what is on top of a wheel goes ahead
    top = placed(stage, "/Rover/Shape/FrontLeft", 1e-3).TransformDir(Gf.Vec3d(0, 0, 1))
    ahead = placed(stage, "/Rover", 1e-3).TransformDir(Gf.Vec3d(1, 0, 0))
    assert spin.Get(1e-3) > 0
    assert Gf.Dot(top, ahead) > 0


def faults_of(stage: Usd.Stage) -> list[str]:
    """What the validators that come with USD have against a stage."""
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    return [each.GetMessage() for each in UsdValidation.ValidationContext(validators).Validate(stage)]


@pytest.mark.parametrize("prim_path", ["", "/Site/Rovers/First"])
@pytest.mark.parametrize("up_axis", ["Y", "Z"])
@pytest.mark.parametrize("proxy", [True, False])
def test_validators_find_nothing(prim_path, up_axis, proxy, tmp_path):
    if prim_path and not proxy:
        pytest.skip("only moves what another layer defines")
    (tmp_path / "rover.usda").write_bytes(encode_usda(drive(), Placement(prim_path, up_axis=up_axis, proxy=proxy)))

    assert faults_of(Usd.Stage.Open(str(tmp_path / "rover.usda"))) == []


@pytest.mark.parametrize("subject", [prediction, drive])
def test_a_layer_is_no_larger_for_what_it_does_not_need(subject):
    plain = encode_usda(subject(), Placement())

    assert encode_usda(subject()) == plain
    assert b"GeomModelAPI" not in plain
    assert b"pivot" not in plain
    if subject is prediction:
        assert b"orient.timeSamples" not in plain


@pytest.mark.parametrize("subject", [prediction, drive])
def test_older_readers_understand_the_text(subject):
    """USD 24.3, which Omniverse Kit has, was seen to refuse `custom double x.timeSamples = {`."""
    lines = encode_usda(subject(), Placement(proxy=True)).decode().splitlines()

    assert any(line.endswith("roverTwin:x_m.timeSamples = {") for line in lines)
    assert not [line for line in lines if line.strip().startswith(("custom", "uniform")) and "timeSamples" in line]
