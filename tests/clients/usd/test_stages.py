"""`rover_twin_usd` on the stages that users have: the rover is where the answer says, and keeps its shape.

Expectations are made by hand from the JSON answer and from how the rover stood before; USD computes what is compared.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, reject, settings
from hypothesis import strategies as st
from pxr import Gf, Sdf, Usd, UsdGeom, UsdValidation

from rover_twin_usd import showing, stages
from rover_twin_usd.failures import StageError
from rover_twin_usd.motion import Motion
from rover_twin_usd.standing import AXES, Standing, Wishes, standing
from tests.clients.usd.stages import OPERATIONS, PARENTS, ROVER, answers, stage_in

EXACT_M = 1e-6
STAGES = [("Z", 1.0), ("Y", 0.01), ("Y", 1.0), ("Z", 0.0254)]


def rows(matrix: Gf.Matrix4d) -> np.ndarray:
    return np.array(matrix)[:3, :3]


def world(stage: Usd.Stage, code: float) -> Gf.Matrix4d:
    return UsdGeom.XformCache(Usd.TimeCode(code)).GetLocalToWorldTransform(stage.GetPrimAtPath(ROVER))


def validated(stage: Usd.Stage) -> list[str]:
    """What the validators that come with USD have against a stage."""
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    return [each.GetMessage() for each in UsdValidation.ValidationContext(validators).Validate(stage)]


def moved(file: Path, answer: dict, wishes: Wishes, output: Path) -> tuple[Usd.Stage, Standing, list[str]]:
    """A new stage above the user's, as the command makes it."""
    stage, motion = Usd.Stage.Open(str(file)), Motion.of(answer)
    clock = stages.clock_of(stage)
    rover = standing(stage, ROVER, Usd.TimeCode(clock.first), wishes)
    layer = Sdf.Layer.CreateAnonymous()
    notes = stages.write(layer, stage, [(rover, motion)], clock)
    stages.into_new(stage, layer, output, [(rover, motion)], clock, alone=False)
    return Usd.Stage.Open(str(output)), rover, notes


def require_moved(before: Gf.Matrix4d, stage: Usd.Stage, answer: dict, wishes: Wishes, pivot: Gf.Vec3d) -> None:
    """Compare a stage with the answer: translation of the pivot, where the rover looks, its size and its shape."""
    meters, up_axis = UsdGeom.GetStageMetersPerUnit(stage), UsdGeom.GetStageUpAxis(stage)
    up = np.array([0, 0, 1] if up_axis == "Z" else [0, 1, 0])
    found = {code: world(stage, code) for code in range(1, 602, 30)}
    columns = answer["trajectory"]
    start = np.array(found[1].Transform(pivot))
    looks = np.array(AXES[wishes.forward]) @ rows(found[1])
    level = looks - up * (up @ looks)
    ahead = level / np.linalg.norm(level)
    if wishes.origin_m is None:
        np.testing.assert_allclose(start, before.Transform(pivot), atol=EXACT_M / meters)
    np.testing.assert_allclose(
        rows(found[1]) @ rows(found[1]).T, rows(before) @ rows(before).T, rtol=1e-6, atol=1e-6 * rows(before).max() ** 2
    )
    for code, matrix in found.items():
        at = columns["time_s"].index((code - 1) / 60)
        way = [columns[name][at] - columns[name][0] for name in ("x_m", "z_m")]
        expected = start + (way[0] * ahead + way[1] * up) / meters
        np.testing.assert_allclose(matrix.Transform(pivot), expected, atol=EXACT_M / meters, rtol=0)
        pitch = math.radians(columns["slope_deg"][at] if "slope_deg" in columns else answer["scenario"]["slope_deg"])
        nose = np.array(AXES[wishes.forward]) @ rows(matrix)
        if rows(before)[0] @ rows(before)[2] == pytest.approx(0, abs=1e-9):  # a sheared asset's nose is not level
            assert nose @ up / np.linalg.norm(nose) == pytest.approx(math.sin(pitch), abs=2e-7)
        now, then = rows(matrix), rows(found[1])
        np.testing.assert_allclose(now @ now.T, then @ then.T, rtol=1e-6, atol=1e-6 * then.max() ** 2)


@pytest.mark.parametrize(("up_axis", "meters_per_unit"), STAGES)
@pytest.mark.parametrize("rover", OPERATIONS)
def test_an_asset_with_any_operations_is_moved(tmp_path, up_axis, meters_per_unit, rover):
    file = stage_in(tmp_path, up_axis, meters_per_unit, rover)
    before, source = world(Usd.Stage.Open(str(file)), 1), file.read_bytes()
    wishes = Wishes(pivot=(-0.64, 0.1, 0.25))
    stage, standing_rover, _ = moved(file, answers()["drive"], wishes, tmp_path / "drive.usda")

    require_moved(before, stage, answers()["drive"], wishes, standing_rover.pivot)
    assert file.read_bytes() == source
    assert stage.GetPrimAtPath(f"{ROVER}/Body")
    names = [each.GetOpName() for each in UsdGeom.Xformable(stage.GetPrimAtPath(ROVER)).GetOrderedXformOps()]
    assert validated(stage) == []
    if rover not in ("sheared", "coarse"):
        plain = ["xformOp:translate", "xformOp:orient", "xformOp:scale"]
        assert [each for each in names if "pivot" not in each] == plain


@pytest.mark.parametrize("parent", PARENTS)
@pytest.mark.parametrize(("up_axis", "meters_per_unit"), STAGES[:2])
@pytest.mark.parametrize("rover", ["converted", "sheared"])
def test_a_rover_below_any_parents_is_moved(tmp_path, up_axis, meters_per_unit, parent, rover):
    file = stage_in(tmp_path, up_axis, meters_per_unit, rover, parent)
    before, wishes = world(Usd.Stage.Open(str(file)), 1), Wishes(pivot=(-0.64, 0.1, 0.25))
    stage, found, notes = moved(file, answers()["prediction"], wishes, tmp_path / "drive.usda")

    require_moved(before, stage, answers()["prediction"], wishes, found.pivot)
    assert any("leaves them" in note for note in notes) == (parent in ("uneven", "moving"))


@given(
    forward=st.sampled_from(list(AXES)),
    heading_deg=st.none() | st.floats(-360, 360),
    origin_m=st.none() | st.tuples(*[st.floats(-1e4, 1e4)] * 3),
    pivot=st.tuples(*[st.floats(-2, 2)] * 3),
    stage_of=st.sampled_from(STAGES),
    rover=st.sampled_from(["omniverse", "converted", "uneven"]),
)
@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_what_the_user_knows_better_holds(tmp_path, forward, heading_deg, origin_m, pivot, stage_of, rover):
    wishes = Wishes(forward, pivot, origin_m, heading_deg)
    file = stage_in(tmp_path, *stage_of, rover)
    before = world(Usd.Stage.Open(str(file)), 1)
    try:
        stage, found, _ = moved(file, answers()["drive"], wishes, tmp_path / "drive.usda")
    except StageError:
        reject()  # the axis points up
    require_moved(before, stage, answers()["drive"], wishes, found.pivot)
    up_axis, meters = stage_of
    if heading_deg is not None:
        heading = math.radians(heading_deg)
        ahead = (math.cos(heading), math.sin(heading), 0)
        assert list(found.ahead) == pytest.approx(ahead if up_axis == "Z" else (ahead[0], 0, -ahead[1]), abs=1e-9)
    if origin_m is not None:
        start = np.array(world(stage, 1).Transform(found.pivot)) * meters
        columns = answers()["drive"]["trajectory"]
        way = columns["x_m"][0] * np.array(found.ahead) + columns["z_m"][0] * np.array(found.up)
        expected = np.array(origin_m) + way
        np.testing.assert_allclose(start, expected, atol=EXACT_M)


@pytest.mark.parametrize(("up_axis", "meters_per_unit", "rover"), [("Z", 1.0, "none"), ("Y", 0.01, "converted")])
def test_the_rear_axle_is_guessed_from_the_box(tmp_path, up_axis, meters_per_unit, rover):
    file = stage_in(tmp_path, up_axis, meters_per_unit, rover)
    if rover == "converted":  # 200 times as large on this stage as in its file: 1.8 m are 3.6
        file.write_text(file.read_text().replace("(2, 2, 2)", "(1, 1, 1)"))
    stage = Usd.Stage.Open(str(file))
    found = standing(stage, ROVER, Usd.TimeCode(1), Wishes())

    assert list(found.pivot) == pytest.approx([-0.6418, 0, 0.25], abs=1e-6)
    assert any("guessed" in note for note in found.notes)


def test_a_rover_of_the_wrong_size_is_noticed(tmp_path):
    stage = Usd.Stage.Open(str(stage_in(tmp_path, "Z", 0.01, "none")))

    assert any("0.018 m long" in note for note in standing(stage, ROVER, Usd.TimeCode(1), Wishes()).notes)


def test_an_instance_is_moved_and_what_is_inside_is_refused(tmp_path):
    file = stage_in(tmp_path, "Y", 0.01, more="instanceable = true")
    before, wishes = world(Usd.Stage.Open(str(file)), 1), Wishes(pivot=(0, 0, 0))
    stage, found, _ = moved(file, answers()["drive"], wishes, tmp_path / "drive.usda")

    require_moved(before, stage, answers()["drive"], wishes, found.pivot)
    assert stage.GetPrimAtPath(ROVER).IsInstance()
    with pytest.raises(StageError, match="inside an instance"):
        standing(stage, f"{ROVER}/Body", Usd.TimeCode(1), Wishes())


@pytest.mark.parametrize("path", ["/Nowhere", "", "Rover", "/World/../Rover", "/World.x", '/"\n', "/World/Rover[a]"])
def test_a_prim_that_is_none_is_named_with_those_that_are(tmp_path, path):
    stage = Usd.Stage.Open(str(stage_in(tmp_path, "Z", 1.0)))

    with pytest.raises(StageError, match="/World/Site/Rover"):
        standing(stage, path, Usd.TimeCode(1), Wishes())


def test_the_new_stage_is_the_old_one_and_the_drive(tmp_path):
    stage, *_ = moved(stage_in(tmp_path, "Y", 0.01), answers()["drive"], Wishes(), tmp_path / "drive.usda")
    layer, rover = stage.GetRootLayer(), stage.GetPrimAtPath(ROVER)

    assert list(layer.subLayerPaths) == ["./site.usda"]
    assert (UsdGeom.GetStageUpAxis(stage), UsdGeom.GetStageMetersPerUnit(stage)) == ("Y", 0.01)
    assert (stage.GetTimeCodesPerSecond(), stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (60, 1, 1 + 12 * 60)
    assert "cameraSettings" in layer.customLayerData
    assert str(stage.GetDefaultPrim().GetPath()) == "/World"
    assert rover.GetCustomDataByKey("roverTwin:model").startswith("viper-lunar@")
    assert rover.GetAttribute("roverTwin:brake").Get(1 + 4.5 * 60) is True
    assert rover.GetAttribute("roverTwin:torque_nm").Get(1) == 70
    # without a time it stands where it starts
    assert UsdGeom.XformCache().GetLocalToWorldTransform(rover) == world(stage, 1)
    assert validated(stage) == []


def test_in_place_the_files_say_the_same_again_without_the_drive(tmp_path):
    file = stage_in(tmp_path, "Y", 0.01)
    stage, motion = Usd.Stage.Open(str(file)), Motion.of(answers()["drive"])
    before, clock = world(stage, 1), stages.clock_of(stage)
    rover = standing(stage, ROVER, Usd.TimeCode(1), Wishes())
    layer = Sdf.Layer.CreateAnonymous()
    stages.write(layer, stage, [(rover, motion)], clock)

    stages.into_file(stage, layer, tmp_path / "drive.usda", [(rover, motion)], clock)
    stages.require_exact(Usd.Stage.Open(str(file)), [(rover, motion)], clock)
    require_moved(before, Usd.Stage.Open(str(file)), answers()["drive"], Wishes(), rover.pivot)

    root = Sdf.Layer.FindOrOpen(str(file))
    assert list(root.subLayerPaths) == ["./drive.usda", "./drive.before.usda"]
    root.subLayerPaths.remove("./drive.usda")
    assert world(Usd.Stage.Open(root), 1) == before


def test_a_drive_on_an_open_stage_changes_no_layer_of_it_and_goes_again(tmp_path):
    stage = Usd.Stage.Open(str(stage_in(tmp_path, "Y", 0.01)))
    before, layers = world(stage, 1), [each.ExportToString() for each in stage.GetLayerStack(False)]

    for kind in ("prediction", "drive"):
        shown = showing.show(stage, ROVER, answers()[kind], Wishes(pivot=(0, 0, 0)))
        require_moved(before, stage, answers()[kind], Wishes(), Gf.Vec3d(0.0))
        assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (shown.first, max(100, shown.last))
        assert len(stage.GetSessionLayer().subLayerPaths) == 1
    showing.hide(stage)

    assert world(stage, 1) == before
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (1, 100)
    assert [each.ExportToString() for each in stage.GetLayerStack(False)] == layers


def test_a_stronger_layer_is_noticed(tmp_path):
    file = stage_in(tmp_path, "Z", 1.0)
    stage = Usd.Stage.Open(str(file))
    rover = stage.GetPrimAtPath(ROVER)
    stage.SetEditTarget(stage.GetSessionLayer())
    UsdGeom.Xformable(rover).GetXformOpOrderAttr().Set(["xformOp:translate"])
    motion = Motion.of(answers()["drive"])
    clock = stages.clock_of(stage)

    with pytest.raises(StageError, match="stronger"):
        stages.require_exact(stage, [(standing(stage, ROVER, Usd.TimeCode(1), Wishes()), motion)], clock)


@given(st.tuples(st.floats(-40, 40), st.floats(-40, 40), st.floats(-180, 180)), st.sampled_from(["X", "-X", "Y", "-Y"]))
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_pivot_and_heading_do_not_depend_on_how_the_rover_stands(tmp_path, angles, forward):
    found = []
    for rotation in ((0.0, 0.0, 0.0), angles):
        stage = Usd.Stage.Open(str(stage_in(tmp_path, "Z", 1.0, "none")))
        stage.SetEditTarget(stage.GetSessionLayer())
        UsdGeom.Xformable(stage.GetPrimAtPath(ROVER)).AddRotateXYZOp().Set(rotation)
        looks = np.array(AXES[forward]) @ rows(world(stage, 1))
        try:
            rover = standing(stage, ROVER, Usd.TimeCode(1), Wishes(forward))
        except StageError:
            reject()  # roll and pitch together: another axis points up
        found.append(rover)
        level = np.array([looks[0], looks[1], 0]) / math.hypot(looks[0], looks[1])
        np.testing.assert_allclose(rover.ahead, level, atol=1e-9)

    np.testing.assert_allclose(found[1].pivot, found[0].pivot, atol=1e-6)
    assert [each for each in found[0].notes if "long" in each] == [each for each in found[1].notes if "long" in each]
