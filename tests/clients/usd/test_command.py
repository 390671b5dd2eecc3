"""`rover-twin-usd` against a real service: what it writes, what it says, and which files it leaves alone."""

from __future__ import annotations

import json
import re
import shlex
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom

import rover_twin_usd
from rover_twin_usd.options import parser
from service.wire.stage_inputs import FleetInputs
from tests.clients.usd.serving import DRIVE, SCENARIO, at, run
from tests.clients.usd.stages import ROVER, stage_in


@pytest.fixture
def site(tmp_path: Path) -> Path:
    return stage_in(tmp_path, "Y", 0.01)


def test_without_a_rover_it_lists_what_could_be_one(shipped, site, capsys):
    assert run(shipped, site) == 0

    assert capsys.readouterr().out.split() == ["/World", "/World/Site", ROVER]


def test_a_prediction_goes_into_a_new_stage(shipped, site, capsys):
    source = site.read_bytes()

    assert run(shipped, site, "--prim", ROVER, *SCENARIO, "--pivot=0,0,0") == 0

    said = capsys.readouterr().out
    assert "checked at 201 times" in said
    assert "outcome climbs" in said
    assert site.read_bytes() == source
    stage = Usd.Stage.Open(str(site.with_name("site.rover-twin.usda")))
    asked = {"slope_deg": 20, "mass_kg": 430, "torque_nm": 80, "frame": "world"}
    answer = shipped.client.post("/v1/predictions", json=asked).json()["trajectory"]
    ends = [np.array(at(stage, ROVER, code).ExtractTranslation()) / 100 for code in (1, 601)]
    across, up = answer["x_m"][-1] - answer["x_m"][0], answer["z_m"][-1] - answer["z_m"][0]
    assert ends[1][1] - ends[0][1] == pytest.approx(up, abs=1e-6)
    assert np.hypot(*(ends[1] - ends[0])[[0, 2]]) == pytest.approx(across, abs=1e-6)


@pytest.mark.parametrize("where", ["file", "in place", "alone"])
def test_a_drive_from_a_file(shipped, site, tmp_path, where):
    question, output, source = tmp_path / "drive.json", tmp_path / "out" / "moved.usd", site.read_bytes()
    question.write_text(json.dumps({**DRIVE, "include": ["band", "wheel_speed"]}))
    output.parent.mkdir()
    options = {"file": [], "in place": ["--in-place"], "alone": ["--layer-only"]}[where]

    assert run(shipped, site, "--prim", ROVER, "--question", question, "--output", output, *options) == 0

    layer = Sdf.Layer.FindOrOpen(str(output))
    assert list(layer.subLayerPaths) == (["../site.usda"] if where == "file" else [])
    assert (site.read_bytes() == source) == (where != "in place")
    stage = Usd.Stage.Open(str(site if where == "in place" else output))
    rover = stage.GetPrimAtPath(ROVER)
    assert rover.GetAttribute("roverTwin:x_upper_m").GetNumTimeSamples() == 81
    assert rover.GetAttribute("roverTwin:front_wheel_speed_rad_s").GetNumTimeSamples() == 81
    assert rover.GetCustomDataByKey("roverTwin:bandLevel") == "0.9"
    assert rover.GetCustomDataByKey("roverTwin:outcome") == "passes"
    # once more, over what is there
    assert run(shipped, site, "--prim", ROVER, "--question", question, "--output", output, *options) == 1
    assert run(shipped, site, "--prim", ROVER, "--question", question, "--output", output, "--force", *options) == 0


def test_in_place_again_begins_where_the_rover_stood_before_the_first(shipped, site, tmp_path):
    away, reference = ["--origin-m=5,6,7", "--heading-deg", "120"], tmp_path / "reference.usda"
    assert run(shipped, site, "--prim", ROVER, *SCENARIO, "--output", reference) == 0
    expected = [at(Usd.Stage.Open(str(reference)), ROVER, code) for code in (1, 601)]

    assert run(shipped, site, "--prim", ROVER, *SCENARIO, *away, "--in-place") == 0
    before = site.with_name("site.rover-twin.before.usda").read_bytes()
    assert run(shipped, site, "--prim", ROVER, *SCENARIO, "--in-place", "--force") == 0

    stage = Usd.Stage.Open(str(site))
    for code, matrix in zip((1, 601), expected, strict=True):
        np.testing.assert_allclose(np.array(at(stage, ROVER, code)), np.array(matrix), atol=1e-6)
    assert site.with_name("site.rover-twin.before.usda").read_bytes() == before


def test_a_fleet_has_a_prim_for_each_rover(shipped, tmp_path, capsys):
    site = stage_in(tmp_path, "Z", 1.0, "translate")
    text = site.read_text()
    rover = text[text.index('        def Xform "Rover"') : text.rindex("    }\n}")]
    site.write_text(text.replace(rover, rover + rover.replace('"Rover"', '"Second"').replace("(3, 4, 5)", "(3, 9, 5)")))
    question = tmp_path / "fleet.json"
    one = {name: value for name, value in DRIVE.items() if name != "dt_s"}
    question.write_text(json.dumps({"drives": [one, {**one, "mass_kg": 500}], "dt_s": 0.1}))

    assert run(shipped, site, "--prim", ROVER, "--prim", "/World/Site/Second", "--question", question) == 0
    stage = Usd.Stage.Open(str(site.with_name("site.rover-twin.usda")))
    heavier, lighter = (at(stage, path, 481).ExtractTranslation() for path in ("/World/Site/Second", ROVER))
    assert heavier[1] - lighter[1] == pytest.approx(5)
    assert heavier[0] != lighter[0]
    outcomes = [line for line in capsys.readouterr().out.splitlines() if "outcome" in line]
    assert [line.partition(":")[0] for line in outcomes] == [ROVER, "/World/Site/Second"]

    assert run(shipped, site, "--prim", ROVER, "--question", question, "--force") == 1
    assert "2 rovers, and 1 are named" in capsys.readouterr().err


@pytest.mark.parametrize(("up_axis", "meters_per_unit"), [("Z", 1.0), ("Y", 0.01)])
def test_a_stage_without_a_rover_gets_one(shipped, tmp_path, up_axis, meters_per_unit):
    site = stage_in(tmp_path, up_axis, meters_per_unit)
    question = tmp_path / "drive.json"
    question.write_text(json.dumps(DRIVE))
    output = tmp_path / "with-rover.usda"
    options = ["--proxy", "--origin-m", "1,2,3", "--heading-deg", "90", "--output", output]

    assert run(shipped, site, "--prim", "/RoverTwin", "--question", question, *options) == 0

    stage = Usd.Stage.Open(str(output))
    answer = shipped.client.post("/v1/drives", json={**DRIVE, "frame": "world"}).json()["trajectory"]
    x, ahead, up = 1.0, answer["x_m"][-1], answer["z_m"][-1]
    expected = [x, 2 + ahead, 3 + up] if up_axis == "Z" else [x, 2 + up, 3 - ahead]
    found = at(stage, "/RoverTwin", 1 + stage.GetTimeCodesPerSecond() * 8).ExtractTranslation()
    assert list(found) == pytest.approx([each / meters_per_unit for each in expected], abs=1e-6 / meters_per_unit)
    assert stage.GetPrimAtPath("/RoverTwin/Shape/FrontLeft")
    assert stage.GetPrimAtPath(ROVER)
    assert UsdGeom.GetStageUpAxis(stage) == up_axis


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--prim", "/Nowhere", *SCENARIO], "/World/Site/Rover"),
        (["--prim", ROVER, "--slope-deg", "20"], "--mass-kg, --torque-nm missing"),
        (["--prim", ROVER, *SCENARIO, "--slope-deg", "46"], "slope_deg is 46.0, allowed is -45 to 45"),
        (["--prim", ROVER, *SCENARIO, "--service", "ftp://x"], "http://"),
        (["--prim", ROVER, *SCENARIO, "--service", "http://127.0.0.1:9"], "no answer from http://127.0.0.1:9"),
        (["--prim", "/R", *SCENARIO, "--proxy", "--service", "http://127.0.0.1:9"], "no answer from"),
        (["--prim", "/R", *SCENARIO, "--proxy", "--mass-kg", "0"], "mass_kg is 0.0, allowed is 1 to 10000"),
        (["--prim", ROVER, *SCENARIO, "--forward", "Y"], "points up or down"),
        (["--prim", ROVER, *SCENARIO, "--proxy"], "does not exist yet"),
        (["--prim", ROVER, "--question", "missing.json"], "missing.json"),
        (["--prim", ROVER, *SCENARIO, "--output", "SITE"], "exists already"),
        (["--prim", ROVER, *SCENARIO, "--output", "SITE", "--force"], "exists already"),
    ],
)  # fmt: skip
def test_what_cannot_be_done_is_said_and_no_file_changes(shipped, tmp_path, capsys, arguments, said):
    site = stage_in(tmp_path, "Z", 1.0)
    before = {each: each.read_bytes() for each in tmp_path.iterdir()}

    assert run(shipped, site, *(str(site) if each == "SITE" else each for each in arguments)) == 1

    assert said in capsys.readouterr().err
    assert {each: each.read_bytes() for each in tmp_path.iterdir()} == before


def test_a_file_that_is_no_stage_is_said(shipped, tmp_path, capsys):
    (tmp_path / "x.usda").write_text("no stage")

    assert run(shipped, tmp_path / "x.usda", "--prim", "/X", *SCENARIO) == 1
    assert run(shipped, tmp_path / "none.usda", "--prim", "/X", *SCENARIO) == 1
    assert capsys.readouterr().err.count("rover-twin-usd: ") == 2


@pytest.mark.parametrize("page", ["docs/omniverse.md", "clients/omniverse/README.md"])
def test_the_pages_show_commands_that_there_are(page):
    text = (Path(__file__).parents[3] / page).read_text()
    commands = [shlex.split(line)[1:] for line in text.splitlines() if line.startswith("rover-twin-usd ")]

    assert len(commands) >= 2
    for each in commands:
        parser().parse_args(each)
    for option in re.findall(r"`(--[a-z-]+)`", text):
        assert option in parser().format_help() or option == "--usd"


def test_the_page_has_every_parameter_of_the_form():
    text = (Path(__file__).parents[3] / "docs" / "omniverse.md").read_text()

    assert re.findall(r"^\| `([a-z_]+)` \|", text, re.MULTILINE) == list(FleetInputs.model_fields)


def test_what_kit_reads_is_there():
    folder = Path(__file__).parents[3] / "clients" / "omniverse"
    described = tomllib.loads((folder / "config" / "extension.toml").read_text())
    packaged = tomllib.loads((folder / "pyproject.toml").read_text())

    assert described["package"]["version"] == packaged["project"]["version"] == rover_twin_usd.__version__
    for file in ("readme", "changelog"):
        assert (folder / described["package"][file]).exists()
    for each in described["python"]["module"]:
        module = folder / (each["name"].replace(".", "/") + ".py")
        assert "(omni.ext.IExt)" in module.read_text()
    assert not {"omni", "carb"} & {name.partition(".")[0] for name in sys.modules}
