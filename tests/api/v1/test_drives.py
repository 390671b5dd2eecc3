"""`/v1/drives` and its batch over HTTP: right answers in every form, and for what is wrong field, value and allowed."""

from __future__ import annotations

import json
from typing import Any

import httpx
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from service.wire.drives.answer import DriveAnswer
from service.wire.drives.batch import MOST_DRIVES
from service.wire.drives.batch_answer import DriveBatchAnswer
from tests.api.conftest import Running
from tests.api.readings import DATA_FORMS, columns_in
from tests.digits import in_text

PATH = "/v1/drives"
TRACK = {"distance_m": [0, 3, 6, 9], "slope_deg": [10, 22, 18, 12]}
DRIVE = {"mass_kg": 430, "track": TRACK, "controls": 60}


def ask(running: Running, drive: Any, path: str = PATH, **query: object) -> httpx.Response:
    content = drive if isinstance(drive, bytes) else json.dumps(drive).encode()
    return running.client.post(path, params=query, content=content, headers={"content-type": "application/json"})


def refused(answer: httpx.Response, field: str) -> dict[str, Any]:
    assert answer.status_code == 422, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    document = answer.json()
    assert document["type"] == "urn:rover-twin:problem:invalid-input"
    assert "\n" not in document["detail"]
    fault = next((each for each in document["errors"] if each["field"] == field), None)
    assert fault is not None, document
    assert fault["allowed"]
    assert field.rpartition(".")[2] in fault["message"] or field in fault["message"]
    return dict(fault)


def test_a_drive_is_answered(shipped):
    answer = ask(shipped, DRIVE)

    assert answer.status_code == 200, answer.text
    found = DriveAnswer.model_validate(answer.json())
    assert len(found.trajectory.time_s) == 401
    assert found.trajectory.time_s[-1] == 20.0
    assert found.summary.outcome == "passes"
    assert answer.headers["rover-twin-outcome"] == "passes"
    assert answer.headers["rover-twin-domain"] == "inside"


@pytest.mark.parametrize("form", DATA_FORMS)
def test_every_form_has_the_same_numbers(shipped, form):
    known = columns_in("json", ask(shipped, DRIVE | {"frame": "world"}).content)
    found = in_text(columns_in(form, ask(shipped, DRIVE | {"frame": "world"}, format=form).content))

    for name, column in known.items():
        np.testing.assert_array_equal(found[name].astype(float), column.astype(float), err_msg=name)


@pytest.mark.parametrize("form", ["svg", "png"])
def test_a_drive_can_be_looked_at(shipped, form):
    assert len(ask(shipped, DRIVE | {"dt_s": 1}, format=form).content) > 5_000


def test_a_constant_drive_is_a_prediction(shipped):
    drive = {"mass_kg": 430, "track": {"distance_m": [0], "slope_deg": [24]}, "controls": 70, "horizon_s": 10}
    one = ask(shipped, drive).json()["trajectory"]
    other = shipped.predict(slope_deg=24, mass_kg=430, torque_nm=70, include="speed").json()["trajectory"]

    for name in ("time_s", "x_m", "y_m", "speed_m_s"):
        np.testing.assert_allclose(one[name], other[name], rtol=0, atol=1e-9)


def test_controls_may_be_a_number_or_change(shipped):
    number = ask(shipped, DRIVE).json()
    listed = ask(shipped, DRIVE | {"controls": {"time_s": [0], "torque_nm": [60.0]}}).json()
    braked = ask(
        shipped, DRIVE | {"controls": {"time_s": [0, 5], "torque_nm": [60, 60], "brake": [False, True]}}
    ).json()

    assert number == listed
    assert braked["trajectory"]["brake"][99:101] == [False, True]
    assert braked["trajectory"]["torque_nm"][-1] == 0
    assert braked["summary"]["final_x_m"] < number["summary"]["final_x_m"]


def test_until_a_distance_alone_ends_there(shipped):
    found = ask(shipped, DRIVE | {"until_distance_m": 8.2}).json()

    assert found["drive"]["horizon_s"] == 600
    assert found["trajectory"]["x_m"][-1] == pytest.approx(8.2, abs=1e-9)
    assert found["trajectory"]["time_s"][-1] == found["summary"]["arrival_time_s"]
    assert found["events"][-1]["event"] == "arrives"
    assert found["summary"]["arrival_earliest_s"] < found["summary"]["arrival_time_s"]


def test_times_of_ones_own(shipped):
    found = ask(shipped, DRIVE | {"times_s": [0.3, 7, 11]}).json()

    assert found["trajectory"]["time_s"] == [0.3, 7, 11]
    assert found["drive"]["horizon_s"] == 11


def test_ten_thousand_knots_and_controls_fit(shipped):
    track = {"distance_m": [0.001234567 * k for k in range(10_000)], "slope_deg": [12.3456789012] * 10_000}
    controls = {
        "time_s": [0.002 * k for k in range(10_000)],
        "torque_nm": [60.123456789] * 10_000,
        "brake": [False] * 10_000,
    }
    found = ask(shipped, {"mass_kg": 430, "track": track, "controls": controls})

    assert found.status_code == 200, found.text[:500]
    assert found.json()["drive"]["knots"] == found.json()["drive"]["controls"] == 10_000


WRONG: list[tuple[str, dict[str, Any]]] = [
    ("track", {"track": {}}),
    ("track", {"track": {"distance_m": [0, 1]}}),
    ("track", {"track": {"distance_m": [0, 1], "elevation_m": [0, 0]}}),
    ("track", {"track": TRACK | {"horizontal_m": [0, 1], "elevation_m": [0, 0]}}),
    ("track", {"track": 5}),
    ("track", {"track": None}),
    ("track", {"track": [TRACK]}),
    ("track.slope", {"track": {"distance_m": [0], "slope": [0]}}),
    ("track.distance_m", {"track": {"distance_m": [], "slope_deg": []}}),
    ("track.distance_m", {"track": {"distance_m": [0, 2, 1], "slope_deg": [1, 1, 1]}}),
    ("track.distance_m", {"track": {"distance_m": [0, 0], "slope_deg": [1, 1]}}),
    ("track.distance_m", {"track": {"distance_m": [0, 1e9], "slope_deg": [1, 1]}}),
    ("track.distance_m", {"track": {"distance_m": ["0"], "slope_deg": [1]}}),
    ("track.distance_m", {"track": {"distance_m": [True], "slope_deg": [1]}}),
    ("track.distance_m", {"track": {"distance_m": [[0]], "slope_deg": [1]}}),
    ("track.distance_m", {"track": {"distance_m": 0, "slope_deg": 1}}),
    ("track.distance_m", {"track": {"distance_m": list(range(10_001)), "slope_deg": [0] * 10_001}}),
    ("track.slope_deg", {"track": {"distance_m": [0, 1], "slope_deg": [1]}}),
    ("track.slope_deg", {"track": {"distance_m": [0], "slope_deg": [45.1]}}),
    ("track.slope_deg", {"track": {"distance_m": [0], "slope_deg": [-90]}}),
    ("track.slope_deg", {"track": {"distance_m": [0], "slope_deg": [None]}}),
    ("track.horizontal_m", {"track": {"horizontal_m": [0], "elevation_m": [0]}}),
    ("track.horizontal_m", {"track": {"horizontal_m": [1, 0], "elevation_m": [0, 0]}}),
    ("track.elevation_m", {"track": {"horizontal_m": [0, 1, 2], "elevation_m": [0, 0]}}),
    ("track.elevation_m", {"track": {"horizontal_m": [0, 1, 2], "elevation_m": [0, 0, 1.5]}}),
    ("track.elevation_m", {"track": {"horizontal_m": [0, 1], "elevation_m": [0, 1e300]}}),
    ("controls", {"controls": None}),
    ("controls", {"controls": "60"}),
    ("controls", {"controls": True}),
    ("controls", {"controls": [60]}),
    ("controls", {"controls": -1}),
    ("controls", {"controls": 1e300}),
    ("controls.torque_nm", {"controls": {"time_s": [0]}}),
    ("controls.torque_nm", {"controls": {"time_s": [0, 1], "torque_nm": [1]}}),
    ("controls.torque_nm", {"controls": {"time_s": [0], "torque_nm": [-0.1]}}),
    ("controls.torque_nm", {"controls": {"time_s": [0], "torque_nm": []}}),
    ("controls.time_s", {"controls": {"time_s": [], "torque_nm": []}}),
    ("controls.time_s", {"controls": {"time_s": [-1, 0], "torque_nm": [1, 1]}}),
    ("controls.time_s", {"controls": {"time_s": [0.5], "torque_nm": [1]}}),
    ("controls.time_s", {"controls": {"time_s": [0, 3, 2], "torque_nm": [1, 1, 1]}}),
    ("controls.time_s", {"controls": {"time_s": [0, 601], "torque_nm": [1, 1]}}),
    ("controls.time_s", {"controls": {"time_s": [k / 100 for k in range(10_001)], "torque_nm": [1] * 10_001}}),
    ("controls.brake", {"controls": {"time_s": [0], "torque_nm": [1], "brake": [1]}}),
    ("controls.brake", {"controls": {"time_s": [0], "torque_nm": [1], "brake": ["true"]}}),
    ("controls.brake", {"controls": {"time_s": [0], "torque_nm": [1], "brake": []}}),
    ("controls.brake", {"controls": {"time_s": [0], "torque_nm": [1], "brake": [True, False]}}),
    ("controls.brakes", {"controls": {"time_s": [0], "torque_nm": [1], "brakes": [True]}}),
    ("mass_kg", {"mass_kg": 0}),
    ("mass_kg", {"mass_kg": 1e9}),
    ("mass_kg", {"mass_kg": "430"}),
    ("mass_kg", {"mass_kg": None}),
    ("start_speed_m_s", {"start_speed_m_s": 5.1}),
    ("start_speed_m_s", {"start_speed_m_s": -1e308}),
    ("start_speed_m_s", {"start_speed_m_s": "fast"}),
    ("horizon_s", {"horizon_s": 0}),
    ("horizon_s", {"horizon_s": 601}),
    ("horizon_s", {"horizon_s": 5, "times_s": [0, 6]}),
    ("until_distance_m", {"until_distance_m": 0}),
    ("until_distance_m", {"until_distance_m": -3}),
    ("until_distance_m", {"until_distance_m": 1e7}),
    ("dt_s", {"dt_s": 0}),
    ("dt_s", {"dt_s": 1e9}),
    ("dt_s", {"dt_s": 0.0001}),
    ("dt_s", {"dt_s": 0.1, "times_s": [0, 1]}),
    ("dt_s", {"until_distance_m": 3, "dt_s": 0.001}),
    ("times_s", {"times_s": []}),
    ("times_s", {"times_s": [0, 3, 2]}),
    ("times_s", {"times_s": [-1, 3]}),
    ("times_s", {"times_s": [0, 601]}),
    ("times_s", {"times_s": [0]}),
    ("frame", {"frame": "moon"}),
    ("frame", {"frame": "world", "include": ["band"]}),
    ("include", {"include": ["prior"]}),
    ("include", {"include": "band"}),
    ("band_level", {"band_level": 0.999}),
    ("strict", {"strict": "yes"}),
    ("model", {"model": "Viper!"}),
    ("model", {"model": "viper-lunar-paper"}),
    ("slope_deg", {"slope_deg": 3}),
]


@pytest.mark.parametrize(("field", "change"), WRONG, ids=[f"{at}-{each[0]}" for at, each in enumerate(WRONG)])
def test_what_is_wrong_is_refused_by_the_name_of_its_field(shipped, field, change):
    refused(ask(shipped, DRIVE | change), field)


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "1e999"])
@pytest.mark.parametrize(
    ("field", "text"),
    [
        ("mass_kg", '{"mass_kg":%s,"track":{"distance_m":[0],"slope_deg":[1]},"controls":1}'),
        ("track.distance_m", '{"mass_kg":400,"track":{"distance_m":[0,%s],"slope_deg":[1,1]},"controls":1}'),
        ("track.slope_deg", '{"mass_kg":400,"track":{"distance_m":[0],"slope_deg":[%s]},"controls":1}'),
        ("track.elevation_m", '{"mass_kg":400,"track":{"horizontal_m":[0,1],"elevation_m":[0,%s]},"controls":1}'),
        ("controls", '{"mass_kg":400,"track":{"distance_m":[0],"slope_deg":[1]},"controls":%s}'),
        (
            "until_distance_m",
            '{"mass_kg":4,"track":{"distance_m":[0],"slope_deg":[1]},"controls":1,"until_distance_m":%s}',
        ),
    ],
)
def test_numbers_that_are_none_are_refused(shipped, field, text, number):
    answer = ask(shipped, (text % number).encode())

    if answer.status_code == 400:  # what neither parser takes for a number
        assert answer.json()["type"] == "urn:rover-twin:problem:malformed-body"
    else:
        refused(answer, field)


@pytest.mark.parametrize("missing", ["mass_kg", "track", "controls"])
def test_what_is_missing_is_named(shipped, missing):
    fault = refused(ask(shipped, {name: value for name, value in DRIVE.items() if name != missing}), missing)

    assert "missing" in fault["message"]


numbers = st.one_of(st.floats(), st.integers(-(10**20), 10**20), st.none(), st.booleans(), st.text(max_size=3))
lists = st.lists(numbers, max_size=5)
anything = st.recursive(
    numbers,
    lambda inner: st.one_of(st.lists(inner, max_size=3), st.dictionaries(st.text(max_size=4), inner, max_size=3)),
    max_leaves=6,
)


@pytest.mark.parametrize("torque", ["-1", "10001", "NaN", "1e999", "1" + "0" * 400])
def test_a_torque_out_of_range_is_refused_as_the_number_it_is(shipped, torque):
    body = json.dumps(DRIVE | {"controls": 12345}).replace("12345", torque).encode()
    fault = refused(ask(shipped, body), "controls")

    assert fault["allowed"] == "a number from 0 to 10000, or time_s with torque_nm and brake"


def test_words_are_listed(shipped):
    assert refused(ask(shipped, DRIVE | {"include": ["x"]}), "include")["allowed"] == (
        "a list with any of band, wheel_speed"
    )


def test_a_batch_without_drives_says_that_they_are_missing(shipped):
    assert refused(ask(shipped, {}, f"{PATH}/batch"), "drives")["message"].startswith("drives is missing, allowed is")
    assert refused(ask(shipped, {"drives": None}, f"{PATH}/batch"), "drives")["message"].startswith("drives is null")


def members(*names: str) -> st.SearchStrategy[Any]:
    """An object with some of these, right or wrong, or something else altogether."""
    each = st.one_of(lists, anything)
    return st.one_of(anything, st.fixed_dictionaries({}, optional=dict.fromkeys(names, each)))


tracks = members("distance_m", "slope_deg", "horizontal_m", "elevation_m")
controls = members("time_s", "torque_nm", "brake")
OTHERS = ("start_speed_m_s", "horizon_s", "until_distance_m", "dt_s", "times_s", "include")


@settings(max_examples=300, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
@given(
    drive=st.fixed_dictionaries(
        {
            "mass_kg": st.one_of(st.just(430.0), numbers),
            "track": st.one_of(st.just(TRACK), tracks),
            "controls": st.one_of(st.just(60.0), controls),
        },
        optional=dict.fromkeys(OTHERS, anything),
    )
)
def test_whatever_is_sent_is_answered_or_refused_in_words(shipped, drive):
    answer = ask(shipped, drive)

    assert answer.status_code in (200, 400, 422), answer.text
    if answer.status_code == 200:
        DriveAnswer.model_validate(answer.json())
    elif answer.status_code == 422:
        for fault in answer.json()["errors"]:
            assert fault["field"]
            assert fault["allowed"]
            assert fault["message"]


def test_strict_refuses_what_leaves_the_domain_and_says_where(shipped):
    steep = DRIVE | {"track": {"distance_m": [0, 2, 3], "slope_deg": [10, 10, 40]}, "strict": True}
    answer = ask(shipped, steep)

    assert answer.status_code == 422
    assert answer.json()["type"] == "urn:rover-twin:problem:outside-domain"
    assert "slope_deg" in [each["field"] for each in answer.json()["errors"]]
    assert ask(shipped, DRIVE | {"strict": True}).status_code == 200


def test_drives_are_counted(shipped):
    def counted() -> float:
        lines = shipped.get("/metrics").text.splitlines()
        return sum(float(line.rpartition(" ")[2]) for line in lines if line.startswith("rover_twin_drives_total{"))

    before = counted()
    ask(shipped, DRIVE)
    ask(shipped, {"drives": [DRIVE, DRIVE, {"mass_kg": 1}]}, f"{PATH}/batch")

    assert counted() == before + 3


def test_a_batch_answers_each_drive_as_the_single_route_does(shipped):
    drives = [DRIVE, DRIVE | {"mass_kg": 600, "until_distance_m": 3}, DRIVE | {"mass_kg": -1}, 7, DRIVE | {"trak": 1}]
    answer = ask(shipped, {"drives": drives, "include": ["band"], "dt_s": 0.5}, f"{PATH}/batch")
    found = answer.json()

    assert answer.status_code == 200, answer.text
    DriveBatchAnswer.model_validate(found)
    assert found["drives"]["index"] == [0, 1]
    for row, index in enumerate(found["drives"]["index"]):
        alone = ask(shipped, drives[index] | {"include": ["band"], "dt_s": 0.5}).json()
        assert {name: each[row] for name, each in found["trajectory"].items()} == alone["trajectory"]
        assert found["events"][row] == alone["events"]
    assert [each["index"] for each in found["errors"]] == [2, 3, 4]
    for error in found["errors"][:1]:
        single = ask(shipped, drives[error["index"]] | {"include": ["band"], "dt_s": 0.5}).json()
        assert {name: value for name, value in single.items() if name not in ("instance", "error")} == {
            name: value for name, value in error.items() if name != "index"
        }


def test_what_stands_beside_the_drives_holds_for_all(shipped):
    beside = {"track": TRACK, "controls": 60, "drives": [{"mass_kg": 430}, {"mass_kg": 430, "controls": 80}]}
    found = ask(shipped, beside, f"{PATH}/batch").json()

    assert found["summary"]["final_x_m"][0] == ask(shipped, DRIVE).json()["summary"]["final_x_m"]
    assert found["summary"]["final_x_m"][1] == ask(shipped, DRIVE | {"controls": 80}).json()["summary"]["final_x_m"]


@pytest.mark.parametrize(
    ("field", "body"),
    [
        ("drives", {}),
        ("drives", {"drives": []}),
        ("drives", {"drives": DRIVE}),
        ("drives", {"drives": [DRIVE] * (MOST_DRIVES + 1)}),
        ("drives", {"drives": [DRIVE | {"horizon_s": 600}] * 41, "dt_s": 1}),
        ("times_s", {"drives": [DRIVE], "times_s": [1, 0]}),
        ("model", {"drives": [DRIVE], "model": "viper-lunar-paper"}),
        ("frame", {"drives": [DRIVE], "frame": "world", "include": ["band"]}),
        ("scenarios", {"drives": [DRIVE], "scenarios": []}),
    ],
)
def test_what_concerns_all_drives_is_refused(shipped, field, body):
    refused(ask(shipped, body, f"{PATH}/batch"), field)


@pytest.mark.parametrize("form", ["json", "ndjson", "npz", "arrow", "parquet"])
def test_every_form_of_a_batch_is_answered(shipped, form):
    answer = ask(shipped, {"drives": [DRIVE, {}]}, f"{PATH}/batch", format=form)

    assert answer.status_code == 200
    assert answer.headers["rover-twin-failed"] == "1"


def test_unknown_forms_and_media_types_are_refused(shipped):
    assert ask(shipped, DRIVE, format="xml").status_code == 422
    assert shipped.client.post(PATH, json=DRIVE, headers={"accept": "text/markdown"}).status_code == 406
    assert shipped.client.post(PATH, content=b"{}", headers={"content-type": "text/plain"}).status_code == 415
    assert ask(shipped, b"{").status_code == 400
