"""Rovers of simple shapes that `rover-twin-usd --proxy` brings: below any parents, in the time of the stage."""

from __future__ import annotations

import json
import math

import pytest
from pxr import Usd

from tests.clients.usd.serving import DRIVE, SCENARIO, at, run
from tests.clients.usd.stages import PARENTS, stage_in
from tests.clients.usd.test_stages import validated

PLACED = ["--origin-m=1,2,3", "--heading-deg", "90"]


@pytest.mark.parametrize("parent", PARENTS)
@pytest.mark.parametrize(("up_axis", "meters_per_unit"), [("Z", 1.0), ("Y", 0.01)])
def test_a_rover_below_any_parent_is_where_the_answer_says(shipped, tmp_path, up_axis, meters_per_unit, parent):
    site, output = stage_in(tmp_path, up_axis, meters_per_unit, "none", parent), tmp_path / "with.usda"
    question = tmp_path / "drive.json"
    question.write_text(json.dumps({**DRIVE, "include": ["wheel_speed"]}))
    path = "/World/Site/Proxy"

    arguments = ["--proxy", "--question", question, *PLACED, "--start-s", "2", "--output", output]
    assert run(shipped, site, "--prim", path, *arguments) == 0

    stage = Usd.Stage.Open(str(output))
    answer = shipped.client.post("/v1/drives", json={**DRIVE, "frame": "world"}).json()["trajectory"]
    for number in (0, 33, 80):
        ahead, up = answer["x_m"][number], answer["z_m"][number]
        expected = [1.0, 2 + ahead, 3 + up] if up_axis == "Z" else [1.0, 2 + up, 3 - ahead]
        matrix = at(stage, path, 1 + 60 * (2 + answer["time_s"][number]))
        assert list(matrix.ExtractTranslation() * meters_per_unit) == pytest.approx(expected, abs=1e-6)
        nose = matrix.TransformDir((1, 0, 0))
        assert nose.GetLength() == pytest.approx(1)
        assert nose[2 if up_axis == "Z" else 1] == pytest.approx(math.sin(math.radians(answer["slope_deg"][number])))
    assert (stage.GetTimeCodesPerSecond(), stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (60, 1, 601)
    spin = stage.GetAttributeAtPath(f"{path}/Shape/RearLeft.xformOp:rotateY:spin")
    codes = spin.GetTimeSamples()
    assert (codes[0], codes[-1], len(codes)) == (121, 601, 81)
    assert validated(stage) == []


def test_parents_keep_what_they_are_and_others_are_defined(shipped, tmp_path):
    site, output = stage_in(tmp_path, "Z", 1.0, "none"), tmp_path / "with.usda"
    site.write_text(site.read_text().replace('def Xform "Site"', 'def Scope "Site"').replace("float3 xformOp:", ""))

    assert run(shipped, site, "--prim", "/World/Site/New/Rover", "--proxy", *SCENARIO, "--output", output) == 0

    stage = Usd.Stage.Open(str(output))
    assert stage.GetPrimAtPath("/World/Site").GetTypeName() == "Scope"
    assert stage.GetPrimAtPath("/World/Site/New").GetTypeName() == "Xform"
    assert stage.GetPrimAtPath("/World/Site/New/Rover").IsDefined()


@pytest.mark.parametrize(
    ("metadata", "said"), [("instanceable = true", "is an instance"), ("active = false", "is inactive")]
)
def test_where_nothing_can_be_put_it_is_said(shipped, tmp_path, capsys, metadata, said):
    site = stage_in(tmp_path, "Z", 1.0, more=metadata)

    assert run(shipped, site, "--prim", "/World/Site/Rover/Proxy", "--proxy", *SCENARIO) == 1

    assert f"/World/Site/Rover {said}" in capsys.readouterr().err
    assert not list(tmp_path.glob("*rover-twin*"))


def test_a_fleet_stands_in_a_row_and_has_a_line_for_each(shipped, tmp_path, capsys):
    site, output, question = stage_in(tmp_path, "Z", 1.0), tmp_path / "with.usda", tmp_path / "fleet.json"
    steep = [{"slope_deg": slope, "mass_kg": 430, "torque_nm": 60} for slope in (5, 35)]
    question.write_text(json.dumps({"scenarios": steep}))

    arguments = ["--proxy", "--question", question, *PLACED, "--spacing-m", "3", "--output", output]
    assert run(shipped, site, "--prim", "/Proxy", *arguments) == 0

    said = capsys.readouterr().out.splitlines()
    outcomes = [line for line in said if "outcome" in line]
    assert [line.partition(":")[0] for line in outcomes] == ["/Proxy_0", "/Proxy_1"]
    assert "outcome climbs" in outcomes[0]
    assert "outcome climbs" not in outcomes[1]
    stage = Usd.Stage.Open(str(output))
    first, second = (at(stage, f"/Proxy_{number}", 1).ExtractTranslation() for number in (0, 1))
    assert second[0] - first[0] == pytest.approx(3)  # they look along Y
