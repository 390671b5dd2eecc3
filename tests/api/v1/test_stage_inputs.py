"""`format=usda` on somebody's stage, over HTTP: paths, ranges, entity tags, fleets, and what is refused."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pxr import Gf, Sdf, Usd, UsdGeom

from service.wire.stage_inputs import FleetInputs, StageInputs
from tests.api.conftest import QUESTION
from tests.api.http.test_bad_input import faults_in
from tests.api.readings import stage_of

# another value of each, as a query has it
CHANGES = {
    "prim_path": "/World/Rover",
    "origin_m": "1,2,3",
    "heading_deg": "45",
    "pivot": "1,0,0",
    "scale": "2",
    "up_axis": "Y",
    "meters_per_unit": "0.01",
    "proxy": "true",
}
WRONG = {
    "prim_path": [
        "", "/", "Rover", "/World/", "/1st", "/a b", "/A.x", "/A{v=a}", '/A"\n(', "/A\n", "/../B", "/Ä", "/a" * 9,
        "/" + "a" * 65, "//A", "/A[B]", "/A\\", "/A@b@", "</A>",
    ],
    "origin_m": ["1,2", "1,2,3,4", "a,b,c", "1e8,0,0", "nan,0,0", ""],
    "heading_deg": ["361", "north", "inf"],
    "pivot": ["1,2", "", "1e7,0,0"],
    "scale": ["0", "-1", "1e7"],
    "up_axis": ["X", "z", ""],
    "meters_per_unit": ["0", "-1", "nan", "1e9"],
    "proxy": ["perhaps"],
}  # fmt: skip
DRIVE = {"mass_kg": 430, "track": {"distance_m": [0, 3], "slope_deg": [5, 12]}, "controls": 80, "horizon_s": 5}
ROUTES = {
    "/v1/predictions": QUESTION,
    "/v1/predictions/batch": {"scenarios": [QUESTION]},
    "/v1/drives": DRIVE,
    "/v1/drives/batch": {"drives": [DRIVE]},
}


def test_every_parameter_is_tried_here():
    assert set(CHANGES) == set(WRONG) == set(StageInputs.model_fields)
    assert set(FleetInputs.model_fields) == {*CHANGES, "spacing_m"}


@pytest.mark.parametrize(("field", "value"), [(field, value) for field in WRONG for value in WRONG[field]])
def test_what_is_wrong_is_named(service, field, value):
    (fault, *_) = faults_in(service.predict(format="usda", **{field: value}), field)
    assert fault["allowed"]


@pytest.mark.parametrize("path", ROUTES)
@pytest.mark.parametrize("field", ["prim_path", "origin_m"])
def test_every_route_refuses_a_wrong_one(shipped, path, field):
    answer = shipped.client.post(path, params={"format": "usda", field: "../x"}, json=ROUTES[path])

    assert faults_in(answer, field)


@pytest.mark.parametrize("path", ROUTES)
@pytest.mark.parametrize("field", CHANGES)
def test_they_belong_to_usd_alone(shipped, path, field):
    for form in ({}, {"format": "npz"}):
        answer = shipped.client.post(path, params={field: CHANGES[field], **form}, json=ROUTES[path])
        (fault,) = faults_in(answer, field)
        assert "usda" in fault["allowed"]


@pytest.mark.parametrize("field", CHANGES)
def test_each_has_an_entity_tag_of_its_own(service, field):
    plain = service.predict(format="usda")
    other = service.predict(format="usda", **{field: CHANGES[field]})
    usual = {"prim_path": None, "pivot": None, "scale": None, "origin_m": "0,0,0", "heading_deg": 0, "up_axis": "Z",
             "meters_per_unit": 1, "proxy": "false"}[field]  # fmt: skip

    assert other.headers["etag"] != plain.headers["etag"]
    assert other.content != plain.content
    known = {"if-none-match": other.headers["etag"]}
    query = QUESTION | {"format": "usda", field: CHANGES[field]}
    assert service.client.get("/v1/predictions", params=query, headers=known).status_code == 304
    if usual is not None:
        assert service.predict(format="usda", **{field: usual}).content == plain.content


def test_a_point_may_come_as_one_value_or_as_three(service):
    query = [*QUESTION.items(), ("format", "usda")]
    one, three = ([*query, *each] for each in ([("origin_m", "1,2,3")], [("origin_m", value) for value in (1, 2, 3)]))

    bodies = [service.client.get("/v1/predictions", params=each).content for each in (one, three)]
    assert bodies[0] == bodies[1]
    assert b"xformOp:translate = (" in bodies[0]


@given(path=st.text(max_size=40) | st.from_regex(r"(/[A-Za-z_0-9.\[\]{}\" ]{0,5}){0,4}", fullmatch=True))
@settings(max_examples=60, deadline=None)
def test_no_path_says_more_than_a_path(service, path):
    """Every path that is taken is one of USD's, and nothing else of the layer changes with it."""
    answer = service.predict(format="usda", prim_path=path, horizon_s=1, dt_s=1)
    if answer.status_code == 422:
        return
    layer = stage_of(answer.content).GetRootLayer()
    found = []
    layer.Traverse("/", lambda each: found.append(str(each)) if each.IsPrimPath() else None)

    assert Sdf.Path.IsValidPathString(path)
    assert sorted(found) == sorted(str(each) for each in Sdf.Path(path).GetPrefixes())


@pytest.mark.parametrize("up_axis", ["Y", "Z"])
def test_a_fleet_is_one_layer_with_the_rovers_side_by_side(shipped, up_axis):
    scenarios = [{**QUESTION, "slope_deg": slope, "horizon_s": 4 + slope / 10} for slope in (5, 46, 12)]
    asked = {"format": "usda", "up_axis": up_axis, "spacing_m": "3", "heading_deg": "90", "proxy": "true"}
    answer = shipped.client.post("/v1/predictions/batch", params=asked, json={"scenarios": scenarios})
    stage = stage_of(answer.content)
    alone = shipped.client.post("/v1/predictions", json={**scenarios[2], "frame": "world"}).json()["trajectory"]
    code = alone["time_s"][-1] * stage.GetTimeCodesPerSecond()
    placed = UsdGeom.XformCache(Usd.TimeCode(code)).GetLocalToWorldTransform(stage.GetPrimAtPath("/Rovers/Rover_2"))

    assert answer.headers["rover-twin-failed"] == "1"
    assert [each.GetName() for each in stage.GetPrimAtPath("/Rovers").GetChildren()] == ["Rover_0", "Rover_2"]
    # looking along the other horizontal axis, the right is X
    x, ahead, up = 6.0, alone["x_m"][-1], alone["z_m"][-1]
    expected = (x, up, -ahead) if up_axis == "Y" else (x, ahead, up)
    np.testing.assert_allclose(placed.Transform(Gf.Vec3d(0)), expected, atol=1e-6)
    assert stage.GetEndTimeCode() == code
    assert stage.GetPrimAtPath("/Rovers/Rover_2/Shape")


def test_drives_are_a_fleet_too(shipped):
    drives = {"drives": [DRIVE, {**DRIVE, "mass_kg": 500, "until_distance_m": 1}], "dt_s": 0.5, "frame": "world"}
    params = {"format": "usda", "prim_path": "/World/Rover"}
    stage = stage_of(shipped.client.post("/v1/drives/batch", params=params, json=drives).content)
    answer = shipped.client.post("/v1/drives/batch", json=drives).json()

    for row in range(2):
        rover = stage.GetPrimAtPath(f"/World/Rover_{row}")
        codes = rover.GetAttribute("xformOp:translate").GetTimeSamples()
        points = answer["drives"]["points"][row]
        times = answer["trajectory"]["time_s"][row][:points]
        assert [code / stage.GetTimeCodesPerSecond() for code in codes] == times
        found = [rover.GetAttribute("xformOp:translate").Get(code)[0] for code in codes]
        assert found == answer["trajectory"]["x_m"][row][:points]


def test_a_fleet_of_which_nothing_is_left_is_a_layer(shipped):
    answer = shipped.client.post(
        "/v1/predictions/batch", params={"format": "usda"}, json={"scenarios": [{**QUESTION, "slope_deg": 46}]}
    )

    assert answer.status_code == 200
    assert not list(stage_of(answer.content).Traverse())


def test_the_model_and_the_band_are_on_the_rover_itself(banded):
    answer = banded.client.post("/v1/predictions", params={"format": "usda"}, json=QUESTION | {"include": ["band"]})
    stage = stage_of(answer.content)
    rover = stage.GetDefaultPrim()

    assert re.fullmatch(r"[a-z-]+@\d+", rover.GetCustomDataByKey("roverTwin:model"))
    assert rover.GetCustomDataByKey("roverTwin:bandLevel") == "0.9"
    assert rover.GetAttribute("roverTwin:x_lower_m").GetNumTimeSamples() == 201
