"""`/v1/predictions/batch` answers each scenario as the single route does, in every form."""

from __future__ import annotations

import io
import json
import random
import time

import httpx
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from service.wire.batch_answer import BatchAnswer
from tests.api.conftest import QUESTION, Running
from tests.api.readings import rover_columns, stage_of
from tests.digits import in_text

PATH = "/v1/predictions/batch"
FORMS = ["json", "ndjson", "npz", "arrow", "parquet", "usda"]
# x and y, m: a batch sums in another order
scenarios = st.fixed_dictionaries(
    {"slope_deg": st.floats(-45, 45), "mass_kg": st.floats(100, 2000), "torque_nm": st.floats(0, 300)},
    optional={"horizon_s": st.sampled_from([0.05, 1.0, 10.0, 12.34])},
)
shared_parts = st.fixed_dictionaries(
    {"dt_s": st.sampled_from([0.1, 0.5, 3.0])},
    optional={"frame": st.sampled_from(["slope", "world"]), "include": st.sampled_from([[], ["prior"]])},
)


def ask(service: Running, sent: list[object], form: str = "json", **shared: object) -> httpx.Response:
    return service.client.post(PATH, params={"format": form}, json={"scenarios": sent, **shared})


def alone(service: Running, scenario: dict[str, object], **shared: object) -> dict[str, object]:
    answer = service.client.post("/v1/predictions", json={**scenario, **shared})
    assert answer.status_code == 200, answer.text
    return dict(answer.json())


def tables_of(answer: httpx.Response, form: str) -> tuple[list[dict[str, object]], list[dict[str, object]]]:
    """Each scenario's columns, as a single CSV has them, with `index` and the summary; and the errors."""
    assert answer.status_code == 200, answer.text
    read = {
        "json": from_json,
        "ndjson": from_ndjson,
        "npz": from_npz,
        "arrow": from_arrow,
        "parquet": from_parquet,
        "usda": from_usda,
    }
    return read[form](answer)


def flat(trajectory: dict[str, object], prior: dict[str, object], band: dict[str, object]) -> dict[str, object]:
    columns = trajectory | {f"prior_{name}": each for name, each in prior.items()} | band
    return {name: each for name, each in columns.items() if name not in ("level", "prior_name")}


def from_json(answer: httpx.Response):
    document = answer.json()
    BatchAnswer.model_validate(document)
    found = []
    for row, index in enumerate(document["scenarios"]["index"]):
        groups = {name: dict(document.get(name, {})) for name in ("trajectory", "prior", "band")}
        time_s = groups["trajectory"].pop("time_s")
        columns = flat(*groups.values())
        columns = {name: each[row] for name, each in columns.items()}
        shared = not isinstance(time_s[0], list)
        inside = document["domain"]["inside"][row]
        summary = {name: each[row] for name, each in document["summary"].items()}
        found.append(
            {"index": index, "time_s": time_s if shared else time_s[row], **columns, **summary, "inside": inside}
        )
    return found, document["errors"]


def from_ndjson(answer: httpx.Response):
    found, errors = [], []
    assert answer.text.endswith("\n") or not answer.text
    for each in map(json.loads, answer.text.splitlines()):
        if "status" in each:
            errors.append(each)
            continue
        columns = flat(each["trajectory"], each.get("prior", {}), each.get("band", {}))
        found.append({"index": each["index"], **columns, **each["summary"], "inside": each["domain"]["inside"]})
    return found, errors


def from_usda(answer: httpx.Response):
    stage = stage_of(answer.content)
    about = json.loads(stage.GetRootLayer().customLayerData["roverTwin"]["metadata"])
    found = []
    for row, index in enumerate(about["scenarios"]["index"]):
        columns = rover_columns(stage, stage.GetPrimAtPath(f"/Rovers/Rover_{index}"))
        columns = {name: each.tolist() for name, each in columns.items()}
        summary = {name: each[row] for name, each in about["summary"].items()}
        found.append({"index": index, **columns, **summary, "inside": about["domain"]["inside"][row]})
    return found, about["errors"]


def from_npz(answer: httpx.Response):
    with np.load(io.BytesIO(answer.content), allow_pickle=False) as archive:
        arrays = dict(archive)
    about = json.loads(str(arrays.pop("metadata")))
    count = len(arrays["index"])
    time_s = arrays.pop("time_s")
    found = []
    for row in range(count):
        points = int(arrays["points"][row])
        each = {"time_s": (time_s if time_s.ndim == 1 else time_s[row])[:points]}
        for name, array in arrays.items():
            each[name] = array[row][:points] if array.ndim == 2 else array[row].item()
        each["slip_ratio"] = each["slip_ratio"] if each.pop("slip_ratio_known") else None
        found.append(each)
    return found, about["errors"]


def from_arrow(answer: httpx.Response):
    return from_table(pa.ipc.open_stream(answer.content).read_all())


def from_parquet(answer: httpx.Response):
    return from_table(pq.read_table(io.BytesIO(answer.content)))


def from_table(table: pa.Table):
    metadata = {name.decode(): part for name, part in table.schema.metadata.items()}
    scenarios, summary, domain = (json.loads(metadata[name]) for name in ("scenarios", "summary", "domain"))
    columns = {name: table.column(name).to_numpy() for name in table.column_names}
    of = columns.pop("scenario")
    found = []
    for row, index in enumerate(scenarios["index"]):
        own = {name: column[of == index] for name, column in columns.items()}
        found.append({"index": index, **own, **{name: each[row] for name, each in summary.items()}})
        found[-1]["inside"] = domain["inside"][row]
    assert set(of.tolist()) == set(scenarios["index"])
    return found, json.loads(metadata["errors"])


def assert_as_alone(found: dict[str, object], single: dict[str, object]) -> None:
    """To the bit: what is text alone has 1e-7 of each number, whichever form the batch has."""
    columns = flat(single["trajectory"], single.get("prior", {}), single.get("band", {}))
    for name, column in in_text({name: found[name] for name in columns}).items():
        np.testing.assert_array_equal(column, columns[name], err_msg=name)
    assert found["inside"] == single["domain"]["inside"]
    for name in ("outcome", "final_x_m", "distance_m", "mean_speed_m_s", "slip_ratio"):
        assert found[name] == single["summary"][name], name


@pytest.mark.slow
@pytest.mark.parametrize("form", FORMS)
@given(sent=st.lists(scenarios, min_size=1, max_size=20), shared=shared_parts)
@settings(max_examples=8, deadline=None)
def test_a_batch_is_the_loop_in_every_form(banded: Running, form, sent, shared):
    found, errors = tables_of(ask(banded, sent, form, **shared), form)

    assert errors == []
    assert [each["index"] for each in found] == list(range(len(sent)))
    for each, scenario in zip(found, sent, strict=True):
        assert_as_alone(each, alone(banded, scenario, **shared))


@pytest.mark.parametrize("form", FORMS)
def test_bands_and_times_of_ones_own(banded: Running, form):
    sent = [{**QUESTION, "slope_deg": slope} for slope in (12, 20, 31)]
    shared = {"times_s": [0.5, 1, 4, 9.5], "include": ["band", "prior"], "band_level": 0.8}
    found, errors = tables_of(ask(banded, sent, form, **shared), form)

    assert errors == []
    for each, scenario in zip(found, sent, strict=True):
        assert {"x_lower_m", "prior_y_m"} <= set(each)
        assert_as_alone(each, alone(banded, scenario, **shared))


WRONG: list[object] = [
    {**QUESTION, "slope_deg": 46},
    {**QUESTION, "mass_kg": "430"},
    {"slope_deg": 28, "torque_nm": 60},
    {**QUESTION, "torque": 1, "horizon_s": -1},
    {**QUESTION, "slope_deg": None},
    {**QUESTION, "mass_kg": True},
]


@pytest.mark.parametrize("form", FORMS)
def test_wrong_scenarios_fail_alone_as_the_single_route_fails_them(service: Running, form):
    sent = [QUESTION]
    for wrong in WRONG:
        sent += [wrong, QUESTION]
    answer = ask(service, sent, form)
    found, errors = tables_of(answer, form)

    assert [each["index"] for each in found] == list(range(0, len(sent), 2))
    assert [each["index"] for each in errors] == list(range(1, len(sent), 2))
    assert answer.headers["rover-twin-failed"] == str(len(WRONG))
    for error, wrong in zip(errors, WRONG, strict=True):
        single = service.client.post("/v1/predictions", json=wrong).json()
        for name in ("type", "title", "status"):
            assert error[name] == single[name]
        fields = [(each["field"], each["value"]) for each in error["errors"]]
        assert fields == [(each["field"], each["value"]) for each in single["errors"]]


@pytest.mark.parametrize("value", [3, "x", None, [], [QUESTION]])
def test_what_is_no_object_fails_alone(service: Running, value):
    found, errors = tables_of(ask(service, [value, QUESTION]), "json")
    assert [each["index"] for each in found] == [1]
    assert errors[0]["errors"][0]["field"] == "scenario"


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("include", [[], ["prior", "band"]])
def test_a_batch_of_which_nothing_is_left(banded: Running, form, include):
    answer = ask(banded, WRONG, form, include=include)
    found, errors = tables_of(answer, form)
    assert found == []
    assert len(errors) == len(WRONG)
    if form == "arrow":
        names = pa.ipc.open_stream(answer.content).read_all().column_names
        some = pa.ipc.open_stream(ask(banded, [QUESTION], form, include=include).content).read_all().column_names
        assert names == some


@pytest.mark.parametrize("form", FORMS)
def test_strict_refuses_single_scenarios(banded: Running, form):
    sent = [{**QUESTION, "slope_deg": 12, "mass_kg": mass, "horizon_s": 4} for mass in (430, 9000, 440, 8000)]
    found, errors = tables_of(ask(banded, sent, form, strict=True), form)

    assert [each["index"] for each in found] == [0, 2]
    assert [each["index"] for each in errors] == [1, 3]
    single = banded.client.post("/v1/predictions", json={**sent[1], "strict": True}).json()
    assert {**errors[0], "index": None} == {
        "index": None,
        **{name: part for name, part in single.items() if name not in ("instance", "error")},
    }


def test_what_is_outside_is_named(banded: Running):
    sent = [{**QUESTION, "mass_kg": mass, "horizon_s": 10} for mass in (430, 9000)]
    document = ask(banded, sent).json()
    for row, scenario in enumerate(sent):
        domain = alone(banded, scenario)["domain"]
        assert document["domain"]["outside_of"][row] == [each["field"] for each in domain["reasons"]]
        assert document["domain"]["distance"][row] == pytest.approx(domain["distance"])
        assert document["domain"]["nearest_run"][row] == domain["nearest_runs"][0]["run"]


def test_a_horizon_beside_times_must_be_their_last(service: Running):
    sent = [{**QUESTION, "horizon_s": horizon} for horizon in (2, 3)] + [QUESTION]
    found, errors = tables_of(ask(service, sent, times_s=[1, 2]), "json")
    assert [each["index"] for each in found] == [0, 2]
    assert errors[0]["errors"][0]["field"] == "horizon_s"
    assert errors[0]["index"] == 1


@pytest.mark.parametrize(
    ("body", "status", "field"),
    [
        ({}, 422, "scenarios"),
        ({"scenarios": []}, 422, "scenarios"),
        ({"scenarios": [QUESTION] * 1001}, 422, "scenarios"),
        ({"scenarios": QUESTION}, 422, "scenarios"),
        ({"scenarios": [QUESTION], "slope_deg": 3}, 422, "slope_deg"),
        ({"scenarios": [QUESTION], "horizon_s": 3}, 422, "horizon_s"),
        ({"scenarios": [QUESTION], "dt_s": 0}, 422, "dt_s"),
        ({"scenarios": [QUESTION], "frame": "moon"}, 422, "frame"),
        ({"scenarios": [QUESTION], "times_s": [1, 1]}, 422, "times_s"),
        ({"scenarios": [QUESTION], "times_s": [1, 2], "dt_s": 0.1}, 422, "dt_s"),
        ({"scenarios": [QUESTION], "include": ["band"], "frame": "world"}, 422, "frame"),
        ({"scenarios": [QUESTION] * 200, "dt_s": 0.001}, 422, "dt_s"),
        ({"scenarios": [QUESTION] * 1000, "times_s": [at / 100 for at in range(1, 1002)]}, 422, "times_s"),
        ({"scenarios": [{**QUESTION, "horizon_s": 600}], "dt_s": 0.001}, 422, "dt_s"),
        ([QUESTION], 422, "body"),
    ],
)
def test_what_concerns_all_is_refused_once(banded: Running, body, status, field):
    answer = banded.client.post(PATH, json=body)
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    assert [each["field"] for each in answer.json()["errors"]] == [field]


@pytest.mark.parametrize(
    ("content", "media_type", "status"),
    [
        (b"", "application/json", 400),
        (b"{", "application/json", 400),
        (b"[" * 100_000, "application/json", 400),
        (b"\xff", "application/json", 400),
        (b"{}", "text/plain", 415),
        (b'{"scenarios":[{"slope_deg":1,"mass_kg":430,"torque_nm":60}],"dt_s":1,"dt_s":2}', "application/json", 422),
        (b'{"scenarios":[{"slope_deg":1,"mass_kg":430,"torque_nm":60,"mass_kg":1}]}', "application/json", 422),
        (b'{"scenarios":[{"slope_deg":1,"mass_kg":430,"torque_nm":60}],"model":"a:b"}', "application/json", 422),
    ],
)
def test_bodies_that_cannot_be_read(service: Running, content, media_type, status):
    answer = service.client.post(PATH, content=content, headers={"content-type": media_type})
    assert answer.status_code == status, answer.text


def test_unknown_models_and_forms(service: Running):
    assert ask(service, [QUESTION], model="nobody").status_code == 404
    assert service.client.post(PATH, params={"format": "csv"}, json={"scenarios": [QUESTION]}).status_code == 422
    twice = service.client.post(PATH + "?format=json&format=npz", json={"scenarios": [QUESTION]})
    assert twice.status_code == 422


@pytest.mark.parametrize(
    ("accept", "media_type"),
    [
        ("*/*", "application/json"),
        ("application/x-ndjson", "application/x-ndjson"),
        ("application/json;q=0.1, application/x-npz", "application/x-npz"),
        ("application/vnd.apache.arrow.stream", "application/vnd.apache.arrow.stream"),
        ("text/csv", "application/problem+json"),
    ],
)
def test_the_form_follows_accept(service: Running, accept, media_type):
    answer = service.client.post(PATH, json={"scenarios": [QUESTION]}, headers={"accept": accept})
    assert answer.headers["content-type"].partition(";")[0] == media_type
    assert answer.status_code == (406 if media_type == "application/problem+json" else 200)


def test_lines_come_in_chunks_and_json_compressed(service: Running):
    body = {"scenarios": [QUESTION] * 400}
    with service.client.stream("POST", PATH, params={"format": "ndjson"}, json=body) as answer:
        assert answer.headers["transfer-encoding"] == "chunked"
        assert "content-encoding" not in answer.headers
        pieces = list(answer.iter_raw())
    assert len(pieces) > 10
    assert b"".join(pieces).count(b"\n") == 400
    answer = service.client.post(PATH, json=body, headers={"accept-encoding": "gzip"})
    assert answer.headers["content-encoding"] == "gzip"


def test_the_same_batch_gives_the_same_bytes(service: Running):
    sent = [{**QUESTION, "slope_deg": slope} for slope in range(20)]
    for form in FORMS:
        assert ask(service, sent, form).content == ask(service, sent, form).content


@pytest.mark.slow
def test_a_thousand_scenarios_cost_less_than_a_hundred_requests(service: Running):
    """In processor time, of client and service; `make bench` measures the real ratio."""
    rng = random.Random(1)
    sent = [{**QUESTION, "slope_deg": rng.uniform(10, 30)} for _ in range(1000)]

    def seconds(call) -> float:
        began = time.process_time()
        assert call().status_code == 200
        return time.process_time() - began

    ask(service, sent, "arrow")
    batch = min(seconds(lambda: ask(service, sent, "arrow")) for _ in range(3))
    single = min(seconds(lambda: service.client.post("/v1/predictions", json=sent[0])) for _ in range(20))
    assert 1000 * single > 10 * batch


def test_a_nan_is_refused_where_it_stands(service: Running):
    body = b'{"scenarios": [{"slope_deg": NaN, "mass_kg": 430, "torque_nm": 60}]}'

    answer = service.client.post(PATH, content=body, headers={"content-type": "application/json"})

    (error,) = answer.json()["errors"]
    assert (error["index"], error["errors"][0]["field"], error["errors"][0]["value"]) == (0, "slope_deg", "NaN")
