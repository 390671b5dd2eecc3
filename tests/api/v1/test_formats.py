"""One prediction in many forms: the same numbers in each, read by the libraries that users have."""

from __future__ import annotations

import io
import json
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.image import imread
from pxr import Gf, Usd, UsdGeom

from tests.api.conftest import QUESTION
from tests.api.readings import DATA_FORMS, about_in, columns_in, stage_of
from tests.digits import TEXT_FORMS, in_text, rounded

MEDIA_TYPES = {
    "json": "application/json",
    "csv": "text/csv",
    "npz": "application/x-npz",
    "arrow": "application/vnd.apache.arrow.stream",
    "parquet": "application/vnd.apache.parquet",
    "usda": "model/vnd.usda",
    "svg": "image/svg+xml",
    "png": "image/png",
    "html": "text/html",
}
times = st.lists(st.floats(0, 600), min_size=1, max_size=40, unique=True).map(sorted).filter(lambda t: t[-1] >= 1e-4)
steps = st.builds(
    lambda dt, n: {"dt_s": dt, "horizon_s": dt * n}, st.sampled_from([0.05, 0.3, 1 / 3]), st.floats(1, 40)
)
samplings = st.one_of(times.map(lambda each: {"times_s": each}), steps)
views = st.sampled_from(
    [{}, {"frame": "world"}, {"include": ["prior"]}, {"include": ["band"]}, {"include": ["prior", "band"]},
     {"frame": "world", "include": ["prior"]}]
)  # fmt: skip
questions = st.builds(
    lambda slope, torque, sampling, view: {"slope_deg": slope, "mass_kg": 430, "torque_nm": torque} | sampling | view,
    st.floats(-45, 45), st.floats(0, 300), samplings, views,
)  # fmt: skip


def ask(service, form, question):
    answer = service.client.post("/v1/predictions", params={"format": form}, json=question)
    assert answer.status_code == 200, answer.text
    assert answer.headers["content-type"].partition(";")[0] == MEDIA_TYPES[form]
    return answer.content


@pytest.mark.slow
@given(question=questions)
@settings(max_examples=40)
def test_binary_forms_hold_the_very_numbers_and_text_forms_the_same_digits(banded, question):
    exact = columns_in("npz", ask(banded, "npz", question))

    for form in DATA_FORMS:
        expected = in_text(exact) if form in TEXT_FORMS else exact
        columns = columns_in(form, ask(banded, form, question))
        assert set(columns) == set(expected), form
        for name, values in expected.items():
            assert columns[name].dtype == np.float64
            assert columns[name].tobytes() == values.tobytes(), (form, name)


@pytest.mark.parametrize("form", ["npz", "arrow", "parquet", "usda"])
@pytest.mark.parametrize("view", [{"frame": "world"}, {"include": ["prior", "band"], "band_level": 0.8}])
def test_what_is_no_column_is_beside_the_columns_as_in_json(banded, form, view):
    answer = banded.client.post("/v1/predictions", json=QUESTION | view).json()
    about = about_in(form, ask(banded, form, QUESTION | view))

    assert {name: about[name] for name in ("model", "scenario", "frame", "domain", "summary")} == {
        name: answer[name] for name in ("model", "scenario", "frame", "domain", "summary")
    }
    assert about.get("prior", {}).get("name") == answer.get("prior", {}).get("name")
    assert about.get("band", {}).get("level") == answer.get("band", {}).get("level")
    columns = columns_in(form, ask(banded, form, QUESTION | view))
    assert about["units"] == {name: "s" if name == "time_s" else "m" for name in columns}


@pytest.mark.slow
@pytest.mark.parametrize("form", MEDIA_TYPES)
def test_the_same_question_gives_the_same_bytes(banded, form):
    assert ask(banded, form, QUESTION) == ask(banded, form, QUESTION)


@pytest.mark.slow
@pytest.mark.parametrize("form", MEDIA_TYPES)
def test_a_form_can_be_asked_for_by_its_media_type(service, form):
    answer = service.client.post("/v1/predictions", json=QUESTION, headers={"accept": MEDIA_TYPES[form]})

    assert answer.headers["content-type"].partition(";")[0] == MEDIA_TYPES[form]
    assert answer.headers["rover-twin-model"] == "viper-lunar@1"
    assert answer.headers["rover-twin-frame"] == "slope"


def test_the_stage_says_units_axes_and_when_it_begins_and_ends(service):
    stage = stage_of(ask(service, "usda", QUESTION | {"horizon_s": 4, "dt_s": 0.05}))
    layer, rover = stage.GetRootLayer(), stage.GetDefaultPrim()

    assert UsdGeom.GetStageUpAxis(stage) == "Z"
    assert (UsdGeom.GetStageMetersPerUnit(stage), stage.GetMetadata("kilogramsPerUnit")) == (1, 1)
    assert rover.GetAttribute("xformOp:translate").Get() == rover.GetAttribute("xformOp:translate").Get(0)
    assert (stage.GetTimeCodesPerSecond(), stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (20, 0, 80)
    assert stage.HasAuthoredTimeCodeRange()
    assert layer.customLayerData["roverTwin"]["frame"] == "world"
    assert (layer.framesPerSecond, layer.defaultPrim) == (20, "Rover")
    assert rover.GetCustomDataByKey("roverTwin:frame") == "slope"  # of the columns
    assert rover.GetCustomDataByKey("roverTwin:model") == "viper-lunar@1"
    assert (rover.GetPath(), rover.GetTypeName()) == ("/Rover", "Xform")
    assert rover.GetAttribute("xformOp:orient").GetTypeName() == "quatd"


@pytest.mark.parametrize("slope_deg", [-30, 0, 28])
def test_both_frames_put_the_rover_at_the_same_place_pitched_like_the_slope(service, slope_deg):
    question = QUESTION | {"slope_deg": slope_deg, "horizon_s": 4}
    world = columns_in("json", ask(service, "json", question | {"frame": "world"}))
    ahead = Gf.Vec3d(np.cos(np.radians(slope_deg)), 0, np.sin(np.radians(slope_deg)))

    for frame in ("slope", "world"):
        stage = stage_of(ask(service, "usda", question | {"frame": frame}))
        rover = UsdGeom.Xformable(stage.GetDefaultPrim())
        for code in (0, 17, 80):
            placed = rover.ComputeLocalToWorldTransform(Usd.TimeCode(code))
            at = placed.Transform(Gf.Vec3d(0, 0, 0))
            assert list(at) == pytest.approx([world["x_m"][code], 0, world["z_m"][code]], abs=1e-6)
            assert list(placed.TransformDir(Gf.Vec3d(1, 0, 0))) == pytest.approx(list(ahead), abs=1e-6)


@pytest.mark.slow
def test_a_plot_is_a_picture_of_bounded_size_whatever_is_asked(banded):
    everything = QUESTION | {"include": ["prior", "band"], "horizon_s": 100}
    few, many = (ask(banded, "svg", everything | {"dt_s": dt}) for dt in (0.1, 0.002))

    assert len(many) < 1.1 * len(few) < 200_000
    assert ET.fromstring(many).tag == "{http://www.w3.org/2000/svg}svg"
    assert imread(io.BytesIO(ask(banded, "png", everything | {"dt_s": 0.002}))).shape == (594, 825, 4)


@pytest.mark.slow
def test_a_plot_of_one_point_is_a_plot(service):
    lone = QUESTION | {"times_s": [3]}

    assert ask(service, "svg", lone) != ask(service, "svg", lone | {"slope_deg": 20})


def test_the_examples_of_the_page_run(service):
    page = (Path(__file__).parents[3] / "docs" / "formats.md").read_text()
    (example,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    found = {}

    exec(compile(example.replace("http://127.0.0.1:8000", service.url), "docs/formats.md", "exec"), found)

    trajectory = service.predict().json()["trajectory"]
    assert found["x_m"].tolist() == found["table"]["x_m"].to_pylist()
    assert rounded(found["x_m"]).tolist() == trajectory["x_m"]
    assert json.loads(found["summary"]) == service.predict().json()["summary"]
    assert all(f"`{form}`" in page for form in MEDIA_TYPES)
    assert all(f"`{media_type}`" in page for media_type in MEDIA_TYPES.values())
