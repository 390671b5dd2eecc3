"""`POST /v1/steps`: states travel with the request, each wrong rover is told why, and the others are moved on."""

from __future__ import annotations

import base64
import json
import struct
import zlib

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st

from model_store import ModelStore
from service.twin.load import load_twin
from service.twin.steps import Live, write_states
from service.wire.steps.answer import StepsAnswer
from tests.api.v1.stepping import begin, go_on, stepping

ARROW = "application/vnd.apache.arrow.stream"


@pytest.fixture(scope="module")
def steps(tmp_path_factory):
    with stepping(tmp_path_factory.mktemp("steps")) as running:
        yield running


@pytest.fixture(scope="module")
def elsewhere(tmp_path_factory):
    """Another server, with a store of its own."""
    with stepping(tmp_path_factory.mktemp("elsewhere")) as running:
        yield running


@pytest.fixture(scope="module")
def twin(steps):
    return load_twin(ModelStore.open(str(steps.folder)), "viper-lunar", 5)


def ask(running, *rovers, **shared):
    answer = running.client.post("/v1/steps", json={"rovers": list(rovers), **shared})
    assert answer.status_code == 200, answer.text
    document = answer.json()
    StepsAnswer.model_validate(document)
    assert answer.headers["rover-twin-failed"] == str(len(document["errors"]))
    return document


def state_of(running, name="a", **told) -> str:
    return ask(running, begin(name, **told))["rovers"][0]["state"]


def refused(running, rover, **shared):
    """The problem of the one rover that is sent between two that are right."""
    document = ask(running, begin("before"), rover, begin("after"), **shared)
    assert [each["id"] for each in document["rovers"]] == ["before", "after"]
    (error,) = document["errors"]
    assert error["index"] == 1
    assert error["status"] in (404, 422)
    return error


def test_rovers_are_where_the_model_says_whoever_answers(steps, elsewhere, twin):
    live, state = Live(twin), None
    live.start("a", mass_kg=430, slope_deg=20)
    for count in range(12):
        running = (steps, elsewhere)[count % 2]
        slope, brake = 20 + count, count in (5, 6)
        rover = go_on("a", state, brake=brake, slope_deg=slope) if state else begin("a", slope_deg=slope)
        (found,) = ask(running, rover)["rovers"]
        expected = live.step("a", slope_deg=slope, torque_nm=60, brake=brake, dt_s=0.1)
        state = found["state"]
        for name in ("time_s", "x_m", "y_m", "speed_m_s", "rear_wheel_speed_rad_s", "slip_ratio", "x_half_width_m"):
            assert found[name] == getattr(expected, name)[0], name
        assert found["domain"] == {"inside": not expected.outside_of[0], "reasons": expected.outside_of[0]}
    assert base64.b64decode(state) == live.states()["a"]


def test_the_answer_says_who_answered(steps):
    document = ask(steps, begin())
    assert document["model"] == {"name": "viper-lunar", "version": 5, "alias": "champion"}
    assert ask(steps, go_on("a", document["rovers"][0]["state"]))["model"]["version"] == 5
    assert ask(steps, begin(), model="viper-lunar@5")["model"]["alias"] is None


def test_a_start_speed_is_that_of_the_start(steps):
    (fast, slow) = ask(
        steps,
        begin("fast", start={"mass_kg": 430, "start_speed_m_s": 1.0}, dt_s=0.0001),
        begin("slow", start={"mass_kg": 430, "start_speed_m_s": 0.0}, dt_s=0.0001),
    )["rovers"]
    assert fast["speed_m_s"] == pytest.approx(1.0, abs=0.01)
    assert slow["speed_m_s"] == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize(
    ("told", "field"),
    [
        ({"dt_s": 0}, "dt_s"),
        ({"dt_s": 1e9}, "dt_s"),
        ({"dt_s": "0.1"}, "dt_s"),
        ({"dt_s": None}, "dt_s"),
        ({"slope_deg": 45.1}, "slope_deg"),
        ({"slope_deg": -1e308}, "slope_deg"),
        ({"slope_deg": 10**400}, "slope_deg"),
        ({"torque_nm": -1}, "torque_nm"),
        ({"torque_nm": None}, "torque_nm"),
        ({"torque_nm": True}, "torque_nm"),
        ({"brake": 1}, "brake"),
        ({"brake": "yes"}, "brake"),
        ({"id": ""}, "id"),
        ({"id": 5}, "id"),
        ({"id": "x" * 101}, "id"),
        ({"start": {"mass_kg": 0.5}}, "start.mass_kg"),
        ({"start": {}}, "start.mass_kg"),
        ({"start": {"mass_kg": 430, "start_speed_m_s": 5.1}}, "start.start_speed_m_s"),
        ({"start": {"mass_kg": 430, "colour": "red"}}, "start.colour"),
        ({"start": 430}, "start"),
        ({"start": None}, "state"),
        ({"weight_kg": 430}, "weight_kg"),
        ({"id": "before"}, "id"),
        ({"state": 5, "start": None}, "state"),
        ({"state": ["a"], "start": None}, "state"),
    ],
)
def test_a_wrong_field_is_named_with_value_and_what_is_allowed(steps, told, field):
    error = refused(steps, begin("x", **told))
    assert [each["field"] for each in error["errors"]] == [field]
    assert error["errors"][0]["allowed"]
    assert error["type"] == "urn:rover-twin:problem:invalid-input"


@pytest.mark.parametrize("text", ["NaN", "Infinity", "-Infinity"])
def test_what_is_no_number_is_refused_by_the_name_of_its_field(steps, text):
    body = json.dumps({"rovers": [begin("x")]}).replace("0.1", text)
    answer = steps.client.post("/v1/steps", content=body, headers={"content-type": "application/json"})
    assert answer.status_code == 200, answer.text
    assert answer.json()["errors"][0]["errors"][0]["field"] == "dt_s"


def test_what_is_no_rover_is_refused(steps):
    for value in (5, "a", None, [], [begin()]):
        assert "a JSON object" in refused(steps, value)["detail"]


def signed(head: bytes) -> str:
    return base64.b64encode(head + zlib.crc32(head).to_bytes(4, "little")).decode()


def forged(name: str, version: int, numbers: int = 103) -> str:
    return base64.b64encode(write_states(name, version, np.ones((1, numbers)))[0]).decode()


HOSTILE = {
    "empty": lambda state: "",
    "cut": lambda state: state[:-40],
    "cut to a few": lambda state: state[:8],
    "grown": lambda state: state[:-4] + "AAAA" + state[-4:],
    "altered": lambda state: state[:600] + ("A" if state[600] != "A" else "B") + state[601:],
    "altered head": lambda state: "V" + state[1:],
    "no base64": lambda state: "?" * 100,
    "url base64": lambda state: state.replace("A", "-"),
    "not ascii": lambda state: "ä" * 100,
    "rubbish": lambda state: base64.b64encode(b"rubbish" * 100).decode(),
    "huge": lambda state: "A" * 8193,
    "foreign magic": lambda state: signed(b"RVST" + bytes(800)),
    "newer format": lambda state: signed(struct.pack("<4sHHI", b"RTST", 9, 1, 1) + b"a" + bytes(8)),
    "no name": lambda state: signed(struct.pack("<4sHHI", b"RTST", 1, 0, 1) + bytes(8)),
    "a path for a name": lambda state: forged("../../etc", 1),
    "an alias for a name": lambda state: forged("viper-lunar@champion", 1),
    "version zero": lambda state: forged("viper-lunar", 0),
    "other numbers": lambda state: forged("viper-lunar", 5, numbers=7),
    "another law": lambda state: forged("viper-lunar", 5),
    "no drive model": lambda state: forged("viper-lunar-paper", 1),
    "unknown model": lambda state: forged("nobody", 1),
    "unknown version": lambda state: forged("viper-lunar", 77),
}


@pytest.mark.parametrize("kind", HOSTILE)
def test_a_hostile_state_is_refused_with_a_reason_and_hinders_nobody(steps, kind):
    error = refused(steps, go_on("x", HOSTILE[kind](state_of(steps))))
    assert error["detail"]
    assert len(json.dumps(error)) < 2000


@given(st.text(max_size=300))
def test_any_text_for_a_state_is_refused(steps, text):
    assert refused(steps, go_on("x", text))["errors"][0]["field"] == "state"


@given(st.data())
def test_any_altered_state_is_refused(steps, data):
    state = state_of(steps)
    at = data.draw(st.integers(0, len(state) - 1))
    letter = data.draw(st.sampled_from("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/="))
    if letter != state[at]:
        refused(steps, go_on("x", state[:at] + letter + state[at + 1 :]))


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=100, max_size=100), st.floats(0.0001, 60))
def test_forged_numbers_of_the_right_law_end_in_finite_numbers_or_a_refusal(steps, twin, numbers, dt_s):
    law = twin.model.law.number
    table = np.array([[1.0, law, 430.0, *numbers]])
    state = base64.b64encode(write_states("viper-lunar", 5, table)[0]).decode()
    answer = steps.client.post("/v1/steps", json={"rovers": [go_on("x", state, dt_s=dt_s), begin("a")]})
    assert answer.status_code == 200
    document = answer.json()
    assert document["rovers"][-1]["id"] == "a"
    for rover in document["rovers"]:
        assert all(np.isfinite(each) for each in rover.values() if isinstance(each, float))


def test_state_and_start_together_name_the_masses(steps):
    state = state_of(steps)
    other = refused(steps, go_on("x", state, start={"mass_kg": 500}))
    assert other["errors"][0] | {"message": ""} == {
        "field": "start.mass_kg",
        "value": 500,
        "allowed": "430, the mass of the state's rover; send a state or a start",
        "message": "",
    }
    assert refused(steps, go_on("x", state, start={"mass_kg": 430}))["errors"][0]["field"] == "start"


def test_a_state_of_another_version_than_asked_for_is_refused(steps):
    document = ask(steps, go_on("x", state_of(steps)), model="viper-lunar@1")
    (error,) = document["errors"]
    assert "viper-lunar@5" in error["detail"]
    assert "viper-lunar@1" in error["detail"]
    assert document["model"] is None


def test_a_version_without_steps_says_so(steps):
    (error,) = ask(steps, begin(), model="viper-lunar-paper@1")["errors"]
    assert error["errors"][0]["field"] == "model"
    assert "drive_model" in error["errors"][0]["allowed"]


def test_many_versions_in_one_request_are_bounded(steps):
    states = [forged(f"nobody{n}", 1) for n in range(30)]
    document = ask(steps, *(go_on(f"r{n}", state) for n, state in enumerate(states)))
    assert len(document["errors"]) == 30
    assert sum("more than 4 versions" in each["detail"] for each in document["errors"]) == 26


@pytest.mark.parametrize(
    ("document", "field"),
    [
        ({}, "rovers"),
        ({"rovers": []}, "rovers"),
        ({"rovers": {}}, "rovers"),
        ({"rovers": [1], "model": "No Model!"}, "model"),
        ({"rovers": [1], "model": 5}, "model"),
        ({"rovers": [1], "include": ["state"]}, "include"),
        ([], "body"),
    ],
)
def test_what_is_wrong_with_all_of_it_is_a_problem(steps, document, field):
    answer = steps.client.post("/v1/steps", json=document)
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["field"] == field


def test_rovers_that_are_missing_are_no_null(steps):
    for document, said in (({}, "rovers is missing, allowed is"), ({"rovers": None}, "rovers is null, allowed is")):
        assert steps.client.post("/v1/steps", json=document).json()["detail"].startswith(said)


def test_an_unknown_model_is_a_problem(steps):
    assert steps.client.post("/v1/steps", json={"rovers": [begin()], "model": "nobody"}).status_code == 404


def test_ten_thousand_rovers_may_and_one_more_may_not(steps):
    many = [begin(f"r{n}", dt_s=0.01) for n in range(10_001)]
    answer = steps.client.post("/v1/steps", json={"rovers": many})
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["value"] == "10001 rovers"
    document = ask(steps, *many[:-1])
    assert len(document["rovers"]) == 10_000
    again = ask(steps, *(go_on(each["id"], each["state"]) for each in document["rovers"]))
    assert [each["id"] for each in again["rovers"]] == [each["id"] for each in many[:-1]]


def test_ids_with_colons_and_quotes_come_back(steps):
    names = ["a:b", 'a"b', "ä€😀", "{}", "x" * 100]
    assert [each["id"] for each in ask(steps, *(begin(name) for name in names))["rovers"]] == names


def arrow_body(columns: dict, metadata: dict | None = None, options: pa.ipc.IpcWriteOptions | None = None) -> bytes:
    table = pa.table(columns)
    table = table.replace_schema_metadata(metadata) if metadata else table
    sink = pa.BufferOutputStream()
    with pa.ipc.new_stream(sink, table.schema, options=options) as stream:
        stream.write_table(table)
    return sink.getvalue().to_pybytes()


def ask_arrow(running, body, wanted="arrow"):
    headers = {"content-type": ARROW}
    return running.client.post(f"/v1/steps?format={wanted}", content=body, headers=headers)


def columns(count=3, **more):
    return {
        "id": [f"r{n}" for n in range(count)],
        "slope_deg": np.linspace(0, 20, count),
        "torque_nm": np.full(count, 60.0),
        "dt_s": np.full(count, 0.1),
        "mass_kg": np.linspace(400, 500, count),
    } | more


def test_arrow_says_what_json_says_and_goes_on(steps):
    answer = ask_arrow(steps, arrow_body(columns()))
    assert answer.status_code == 200, answer.text
    table = pa.ipc.open_stream(answer.content).read_all()
    rovers = [
        begin(f"r{n}", mass_kg=m, slope_deg=s)
        for n, (m, s) in enumerate(zip([400, 450, 500], [0, 10, 20], strict=True))
    ]
    document = ask(steps, *rovers)
    for row, rover in zip(table.to_pylist(), document["rovers"], strict=True):
        assert base64.b64encode(row["state"]).decode() == rover["state"]
        assert row["outside_of"] == rover["domain"]["reasons"]
        for name in ("id", "x_m", "y_m", "speed_m_s", "slip_ratio", "x_half_width_m", "moving", "time_s"):
            assert row[name] == rover[name], name
    assert json.loads(table.schema.metadata[b"model"]) == document["model"]
    further = columns(state=table["state"].to_pylist())
    del further["mass_kg"]
    second = pa.ipc.open_stream(ask_arrow(steps, arrow_body(further)).content).read_all()
    assert second["time_s"].to_pylist() == pytest.approx([0.2] * 3)
    assert ask_arrow(steps, arrow_body(further), "json").json()["rovers"][2]["x_m"] == second["x_m"][2].as_py()


def test_arrow_tells_of_each_wrong_row(steps):
    wrong = columns(
        9,
        id=["a", "a", None, "", "e", "f", "g", "h", "i"],
        slope_deg=[0.0, 0, 0, 0, 90.0, np.nan, 0, 0, 0],
        torque_nm=[1.0, 1, 1, 1, 1, 1, None, None, np.inf],
        brake=[False] * 7 + [True, None],
    )
    answer = ask_arrow(steps, arrow_body(wrong, {"model": "viper-lunar@5"}))
    table = pa.ipc.open_stream(answer.content).read_all()
    errors = json.loads(table.schema.metadata[b"errors"])
    assert table["id"].to_pylist() == ["a", "h"]
    assert table["index"].to_pylist() == [0, 7]
    fields = {each["index"]: each["errors"][0]["field"] for each in errors}
    assert fields == {1: "id", 2: "id", 3: "id", 4: "slope_deg", 5: "slope_deg", 6: "torque_nm", 8: "torque_nm"}


def test_arrow_of_states_that_cannot_be(steps):
    state = base64.b64decode(state_of(steps))
    wrong = columns(5, state=[state, state, b"rubbish", None, state[:-1]], mass_kg=[None, 430.0, None, None, None])
    table = pa.ipc.open_stream(ask_arrow(steps, arrow_body(wrong)).content).read_all()
    errors = {each["index"]: each["detail"] for each in json.loads(table.schema.metadata[b"errors"])}
    assert table["index"].to_pylist() == [0]
    assert sorted(errors) == [1, 2, 3, 4]


@pytest.mark.parametrize(
    "body",
    [
        b"",
        b"rubbish",
        b"ARROW1\0\0",
        arrow_body(columns())[:300],
        arrow_body(columns())[:-100],
        arrow_body(columns(), options=pa.ipc.IpcWriteOptions(compression="zstd")),
        arrow_body(columns(), options=pa.ipc.IpcWriteOptions(compression="lz4")),
        arrow_body(columns(id=pa.array(["a", "b", "c"]).dictionary_encode())),
    ],
    ids=["empty", "rubbish", "file", "cut", "end cut", "zstd", "lz4", "dictionary"],
)
def test_what_is_no_plain_stream_is_a_problem(steps, body):
    answer = ask_arrow(steps, body)
    assert answer.status_code in (400, 200 if len(body) > 900 else 400), answer.text


@pytest.mark.parametrize(
    ("changed", "field"),
    [
        ({"id": [1, 2, 3]}, "id"),
        ({"slope_deg": ["1", "2", "3"]}, "slope_deg"),
        ({"brake": [1, 0, 1]}, "brake"),
        ({"state": ["a", "b", "c"]}, "state"),
        ({"colour": [1, 2, 3]}, "colour"),
    ],
)
def test_columns_of_another_kind_are_a_problem(steps, changed, field):
    answer = ask_arrow(steps, arrow_body(columns(**changed)))
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["field"] == field


@given(st.data())
def test_damaged_streams_never_break_the_service(steps, data):
    body = bytearray(arrow_body(columns()))
    for _ in range(data.draw(st.integers(1, 5))):
        body[data.draw(st.integers(0, len(body) - 1))] = data.draw(st.integers(0, 255))
    assert ask_arrow(steps, bytes(body)).status_code in (200, 400, 422)


def test_steps_are_counted(steps):
    ask(steps, begin(), begin("b", dt_s=0))
    text = steps.client.get("/metrics").text
    assert 'rover_twin_steps_total{result="moved",route="/v1/steps"}' in text
    assert 'rover_twin_steps_total{result="refused",route="/v1/steps"}' in text


def test_an_id_that_no_text_can_hold_sinks_no_other(steps):
    rover = {"start": {"mass_kg": 430}, "slope_deg": 10, "torque_nm": 100, "dt_s": 0.1}
    body = b'{"rovers":[' + json.dumps({"id": "a", **rover}).encode() + b","
    body += json.dumps({"id": "x", **rover}).encode().replace(b'"x"', b'"\\ud800"') + b"]}"
    answer = steps.client.post("/v1/steps", content=body, headers={"Content-Type": "application/json"})

    assert answer.status_code == 200
    assert [each["id"] for each in answer.json()["rovers"]] == ["a"]
    assert answer.json()["errors"][0]["errors"][0]["field"] == "id"


def test_all_steps_together_are_bounded(steps):
    rover = {"start": {"mass_kg": 430}, "slope_deg": 10, "torque_nm": 100, "dt_s": 60}
    answer = steps.client.post("/v1/steps", json={"rovers": [{"id": str(at), **rover} for at in range(401)]})

    assert answer.status_code == 422
    assert "24000 s" in answer.json()["detail"]
