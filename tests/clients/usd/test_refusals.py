"""What `rover-twin-usd` refuses: in words of its own, and without leaving a file behind."""

from __future__ import annotations

import json

import pytest
from pxr import Sdf, Usd

from rover_twin_usd import stages
from rover_twin_usd.failures import StageError
from rover_twin_usd.motion import Motion
from rover_twin_usd.standing import Wishes, standing
from tests.clients.usd.serving import DRIVE, SCENARIO, run
from tests.clients.usd.stages import ROVER, answers, stage_in

ASKED = ["--prim", ROVER, *SCENARIO]
POINT = "three numbers with commas between them"


@pytest.mark.parametrize(
    ("option", "said"),
    [
        ("--pivot=nan,0,0", f"'nan,0,0', allowed is x,y,z: {POINT}, each -1000000 to 1000000"),
        ("--pivot=1,2", f"'1,2', allowed is x,y,z: {POINT}"),
        ("--origin-m=1e308,0,0", "each -10000000 to 10000000"),
        ("--origin-m=a,b,c", POINT),
        ("--heading-deg=nan", "'nan', allowed is a number from -360 to 360"),
        ("--heading-deg=1e9", "'1e9', allowed is a number from -360 to 360"),
        ("--start-s=inf", "'inf', allowed is a number from 0 to 1000000"),
        ("--spacing-m=-1", "allowed is a number from 0 to 1000"),
        ("--mass-kg=nan", "allowed is a finite number"),
    ],
)
def test_a_number_out_of_bounds_is_named_with_what_is_allowed(shipped, tmp_path, capsys, option, said):
    site = stage_in(tmp_path, "Z", 1.0)

    with pytest.raises(SystemExit) as stopped:
        run(shipped, site, *ASKED, option)

    assert stopped.value.code == 2
    error = capsys.readouterr().err
    assert said in error
    assert option.partition("=")[0] in error
    assert sorted(each.name for each in tmp_path.iterdir()) == ["site.usda", "viper.usda"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (SCENARIO, "name --prim"),
        (["--proxy"], "name --prim"),
        ([*ASKED, "--output", "FOLDER/x.png"], "allowed is a name that ends with .usda, .usdc, .usd"),
        ([*ASKED, "--output", "FOLDER/x.usdz"], "allowed is a name that ends with"),
        ([*ASKED, "--output", "FOLDER/none/x.usda"], "no folder that can be written to"),
        ([*ASKED, "--output", "FOLDER/viper.usda", "--force"], "viper.usda exists already"),
        ([*ASKED, "--prim", ROVER], "a rover is named once"),
        ([*ASKED, "--prim", "/World"], "none inside another"),
        ([*ASKED, "--spacing-m", "3"], "no effect without"),
        ([*ASKED, "--service", "http://[::1"], "no answer from http://[::1"),
        (["--prim", "/R", *SCENARIO, "--proxy", "--pivot=0,0,0"], "--pivot has no effect with --proxy"),
        (["--prim", "/R", *SCENARIO, "--proxy", "--forward", "X"], "--forward has no effect with --proxy"),
        (["--prim", "/R", *SCENARIO, "--proxy", "--in-place"], "--in-place has no effect with --proxy"),
        (["--prim", "R/", *SCENARIO, "--proxy"], "allowed is a new path such as /RoverTwin"),
    ],
)  # fmt: skip
def test_what_has_no_place_or_no_effect_is_refused(shipped, tmp_path, capsys, arguments, said):
    site = stage_in(tmp_path, "Z", 1.0)
    before = {each: each.read_bytes() for each in tmp_path.iterdir()}

    assert run(shipped, site, *(each.replace("FOLDER", str(tmp_path)) for each in arguments)) == 1

    error = capsys.readouterr().err
    assert said in error
    assert "pxrInternal" not in error
    assert {each: each.read_bytes() for each in tmp_path.iterdir()} == before


@pytest.mark.parametrize(
    ("content", "said"),
    [(None, "there is no file"), ("no stage", "no USD stage"), ("#usda 1.0\n\n nonsense", "no USD stage")],
)
def test_a_stage_that_is_none_is_said_in_one_sentence(shipped, tmp_path, capsys, content, said):
    file = tmp_path / "x.usda"
    if content is not None:
        file.write_text(content)

    assert run(shipped, file, *ASKED) == 1

    error = capsys.readouterr().err
    assert said in error
    assert "pxrInternal" not in error


def test_a_token_with_a_line_end_is_refused(shipped, tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("ROVER_TWIN_TOKEN", "one\nX-Other: two")

    assert run(shipped, stage_in(tmp_path, "Z", 1.0), *ASKED) == 1
    assert "ROVER_TWIN_TOKEN has a line end" in capsys.readouterr().err


def test_a_package_is_not_changed_in_place(shipped, tmp_path, capsys):
    from pxr import UsdUtils

    package = tmp_path / "site.usdz"
    assert UsdUtils.CreateNewUsdzPackage(str(stage_in(tmp_path, "Z", 1.0)), str(package))

    assert run(shipped, package, *ASKED, "--in-place") == 1
    assert "cannot be changed in place" in capsys.readouterr().err
    assert run(shipped, package, *ASKED) == 0


@pytest.mark.parametrize(("metadata", "said"), [("active = false", "is inactive"), ("", "invisible")])
def test_a_rover_that_nobody_sees_is_refused_or_said(tmp_path, metadata, said):
    stage = Usd.Stage.Open(str(stage_in(tmp_path, "Z", 1.0, "none", more=metadata)))
    if metadata:
        with pytest.raises(StageError, match=said):
            standing(stage, ROVER, Usd.TimeCode(1), Wishes())
        return
    stage.GetPrimAtPath("/World/Site").CreateAttribute("visibility", Sdf.ValueTypeNames.Token).Set("invisible")

    assert any(said in each for each in standing(stage, ROVER, Usd.TimeCode(1), Wishes()).notes)


@pytest.mark.parametrize("alone", [False, True])
def test_a_failed_check_leaves_what_was_there(tmp_path, alone):
    stage, output = Usd.Stage.Open(str(stage_in(tmp_path, "Z", 1.0))), tmp_path / "drive.usda"
    output.write_text("#usda 1.0\n")
    motion, clock = Motion.of(answers()["prediction"]), stages.clock_of(stage)
    rover = standing(stage, ROVER, Usd.TimeCode(1), Wishes(pivot=(float("nan"), 0, 0)))
    layer = Sdf.Layer.CreateAnonymous()
    stages.write(layer, stage, [(rover, motion)], clock)

    with pytest.raises(StageError, match="not finite"):
        stages.into_new(stage, layer, output, [(rover, motion)], clock, alone=alone)

    assert output.read_text() == "#usda 1.0\n"
    assert sorted(each.name for each in tmp_path.iterdir()) == ["drive.usda", "site.usda", "viper.usda"]


def test_a_fleet_from_one_origin_needs_room(shipped, tmp_path, capsys):
    site = stage_in(tmp_path, "Z", 1.0)
    question = tmp_path / "fleet.json"
    one = {name: value for name, value in DRIVE.items() if name != "dt_s"}
    question.write_text(json.dumps({"drives": [one, {**one, "mass_kg": 500}], "dt_s": 0.1}))

    assert run(shipped, site, "--prim", "/Proxy", "--proxy", "--question", question) == 1
    assert "2 rovers would start on one spot: say with --spacing-m" in capsys.readouterr().err
