"""Bodies of the protocol as bytes: what is malformed, too large or unsupported ends in the protocol's error form."""

from __future__ import annotations

import gzip
import json
import struct
import zlib

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from service.app import openapi_document

INFER = "/v2/models/viper-lunar/infer"
LENGTH = "Inference-Header-Content-Length"
VALUES = {"slope_deg": [20.0, 28.0], "mass_kg": [430.0, 430.0], "torque_nm": [60.0, 60.0]}


def tensor(name, values=None, **more):
    values = VALUES[name] if values is None else values
    return {"name": name, "shape": [len(values)], "datatype": "FP64", "data": values} | more


def request(**more):
    return {"inputs": [tensor(name) for name in VALUES]} | more


def request_with(name, **more):
    """A good request with one input changed; a member set to None is left out."""
    changed = [tensor(each) | (more if each == name else {}) for each in VALUES]
    return {"inputs": [{key: value for key, value in each.items() if value is not None} for each in changed]}


def in_binary(name="mass_kg", size=16, content=None, **more):
    """A good request with one input in binary, and its body."""
    document = request_with(name, data=None, parameters={"binary_data_size": size}, **more)
    head = json.dumps(document).encode()
    return head, head + (struct.pack("<2d", *VALUES[name]) if content is None else content)


def failed(answer, status=400):
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/json"
    document = answer.json()
    assert list(document) == ["error"]
    assert document["error"]
    assert "\n" not in document["error"]
    return document["error"]


def test_json_in_and_out(banded):
    answer = banded.client.post(INFER, json=request(id="7", outputs=[{"name": "x_m"}, {"name": "inside_domain"}]))

    assert answer.headers["content-type"] == "application/json"
    assert LENGTH not in answer.headers
    document = answer.json()
    assert list(document) == ["model_name", "model_version", "id", "parameters", "outputs"]
    position, inside = document["outputs"]
    assert (position["name"], position["datatype"], position["shape"]) == ("x_m", "FP64", [2, 201])
    assert len(position["data"]) == 402
    assert set(map(type, inside["data"])) == {bool}


def test_the_binary_part_is_the_tensors_bytes_in_their_order(banded):
    head, body = in_binary()
    outputs = [{"name": name} for name in ("outcome", "x_m", "time_s", "sample_count", "inside_domain")]
    document = json.loads(head) | {"outputs": outputs, "parameters": {"binary_data_output": True, "dt_s": 5}}
    document["outputs"][2]["parameters"] = {"binary_data": False}
    head = json.dumps(document).encode()

    answer = banded.client.post(INFER, content=head + body[-16:], headers={LENGTH: str(len(head))})

    assert answer.headers["content-type"] == "application/octet-stream"
    length = int(answer.headers[LENGTH])
    described = json.loads(answer.content[:length])["outputs"]
    assert int(answer.headers["content-length"]) == len(answer.content)
    sizes = [each.get("parameters", {}).get("binary_data_size") for each in described]
    assert [each["name"] for each in described] == [each["name"] for each in outputs]
    assert sizes == [sum(4 + len(outcome) for outcome in ("climbs", "climbs")), 2 * 3 * 8, None, 2 * 8, 2]
    assert described[2]["data"] == [0, 5, 10]
    tail = answer.content[length:]
    assert len(tail) == sum(filter(None, sizes))
    assert tail[: sizes[0]] == b"\x06\x00\x00\x00climbs" * 2
    positions = np.frombuffer(tail[sizes[0] : sizes[0] + 48], dtype="<f8").reshape(2, 3)
    assert positions[:, 0].tolist() == [0, 0]
    assert (np.diff(positions, axis=1) > 0).all()
    in_json = banded.client.post(INFER, json=request(outputs=[{"name": "inside_domain"}])).json()
    assert tail[-18:] == struct.pack("<2q", 3, 3) + bytes(in_json["outputs"][0]["data"])


def in_columns(values, datatype="FP64", nested=False, **more):
    """As MLServer's codecs write a column of a table: shape [n, 1], and a content type."""
    data = [[value] for value in values] if nested else values
    return {"shape": [len(values), 1], "datatype": datatype, "data": data, "parameters": {"content_type": "np"}} | more


CODECS = {
    "PandasCodec": {name: in_columns(values) for name, values in VALUES.items()},
    "nested rows": {name: in_columns(values, nested=True) for name, values in VALUES.items()},
    "NumpyCodec of integers": {name: in_columns([*map(int, values)], "INT64") for name, values in VALUES.items()},
    "whole numbers that look like floats": {name: in_columns(values, "UINT16") for name, values in VALUES.items()},
    "a column each": {
        "slope_deg": in_columns([20, 28], "INT8"),
        "mass_kg": in_columns([430, 430], "INT32", parameters=None),
        "torque_nm": {"shape": [2], "datatype": "UINT8", "data": [60, 60]},
    },
}


@pytest.mark.parametrize("codec", CODECS)
def test_what_codecs_write_is_answered_as_plain_tensors_are(banded, codec):
    inputs = [{"name": name, **column} for name, column in CODECS[codec].items()]
    sent = {"id": None, "parameters": {"content_type": "pd"}, "inputs": inputs, "outputs": None}
    plain = banded.client.post(INFER, json=request())
    answer = banded.client.post(INFER, json=sent)
    assert answer.status_code == 200, answer.text
    assert answer.json()["outputs"] == plain.json()["outputs"]


@pytest.mark.parametrize("kind", ["<i8", "<i2", "<u4"])
def test_integers_in_binary_are_numbers(banded, kind):
    datatype = f"{'UINT' if 'u' in kind else 'INT'}{8 * np.dtype(kind).itemsize}"
    content = np.array([430, 430], dtype=kind).tobytes()
    head, body = in_binary(size=len(content), content=content, datatype=datatype, shape=[2, 1])
    answer = banded.client.post(INFER, content=body, headers={LENGTH: str(len(head))})
    assert answer.status_code == 200, answer.text
    assert answer.json()["outputs"] == banded.client.post(INFER, json=request()).json()["outputs"]


WRONG = {
    "no inputs": ({}, "inputs is missing"),
    "inputs of another kind": ({"inputs": "x"}, "inputs is 'x'"),
    "an input of another kind": ({"inputs": [7]}, "inputs[0] is 7"),
    "no shape": (request_with("mass_kg", shape=None), "inputs[1].shape is missing"),
    "shape of another kind": (request_with("mass_kg", shape=[2.5]), "inputs[1].shape[0] is 2.5"),
    "negative shape": (request_with("mass_kg", shape=[-2]), "inputs[1].shape[0] is -2"),
    "two dimensions": (request_with("mass_kg", shape=[1, 2]), "mass_kg.shape is '[1, 2]'"),
    "three dimensions": (request_with("mass_kg", shape=[2, 1, 1]), "mass_kg.shape is '[2, 1, 1]'"),
    "no elements": (request_with("mass_kg", shape=[0], data=[]), "mass_kg.shape"),
    "datatype": (
        request_with("mass_kg", datatype="BOOL"),
        "mass_kg.datatype is 'BOOL', allowed is one of FP64, FP32",
    ),
    "half of an integer": (request_with("mass_kg", datatype="INT64", data=[430.0, 430.5]), "mass_kg[1] is 430.5"),
    "too large an integer": (request_with("mass_kg", datatype="UINT8", data=[200, 430]), "mass_kg[1] is 430, allowed"),
    "nested too deep": (request_with("mass_kg", shape=[2, 1], data=[[[430.0]], [430.0]]), "mass_kg[0]"),
    "rows of two": (request_with("mass_kg", shape=[2, 1], data=[[430.0, 1.0], [430.0, 1.0]]), "mass_kg[0]"),
    "too few values": (request_with("mass_kg", data=[1.0]), "mass_kg.data is '1 values', allowed is 2 values"),
    "nested values": (request_with("mass_kg", data=[[430.0], [430.0]]), "mass_kg[0]"),
    "text": (request_with("mass_kg", data=[430.0, "430"]), "mass_kg[1] is '430'"),
    "truth": (request_with("mass_kg", data=[430.0, True]), "mass_kg[1] is true"),
    "null": (request_with("mass_kg", data=[430.0, None]), "mass_kg[1] is null"),
    "huge integer": (request_with("mass_kg", data=[430.0, 10**400]), "mass_kg[1]"),
    "out of range": (request_with("mass_kg", data=[430.0, 0.5]), "mass_kg[1] is 0.5, allowed is 1 to 10000 kg"),
    "FP32 overflow": (request_with("mass_kg", datatype="FP32", data=[430.0, 1e300]), "mass_kg[1]"),
    "unknown input": ({"inputs": [tensor("mass", [1.0])]}, "no field 'mass'; allowed is one of slope_deg"),
    "input twice": ({"inputs": [tensor("mass_kg"), tensor("mass_kg")]}, "mass_kg"),
    "missing input": ({"inputs": [tensor("mass_kg"), tensor("torque_nm")]}, "slope_deg is missing"),
    "unknown output": (request(outputs=[{"name": "z_m"}]), "'z_m', allowed is one of time_s"),
    "output twice": (request(outputs=[{"name": "x_m"}, {"name": "x_m"}]), "each output once"),
    "band in the world": (
        request(outputs=[{"name": "x_lower_m"}], parameters={"frame": "world"}),
        "viper-lunar@1 in the world frame",
    ),
    "unknown parameter": (request(parameters={"dt": 1}), "no field 'dt'; allowed is one of frame, band_level, dt_s"),
    "wrong frame": (request(parameters={"frame": "body"}), "frame is 'body', allowed is one of slope, world"),
    "frame of another kind": (request(parameters={"frame": 1}), "frame is 1"),
    "step out of range": (request(parameters={"dt_s": 0}), "dt_s is 0, allowed is 0.0001 to 60"),
    "step of another kind": (request(parameters={"dt_s": True}), "dt_s is true"),
    "level": (request(parameters={"band_level": 0.2}), "band_level is 0.2, allowed is 0.5 to 0.99"),
    "binary of another kind": (request(parameters={"binary_data_output": 1}), "binary_data_output is 1"),
    "parameter of another kind": (request(parameters={"frame": []}), "parameters is"),
    "id of another kind": (request(id=7), "id is 7, allowed is a text"),
    "size without a binary part": (
        request_with("mass_kg", data=None, parameters={"binary_data_size": 16}),
        "mass_kg.binary_data_size is 16, allowed is at most the 0 bytes",
    ),
    "wrong size": (
        request_with("mass_kg", data=None, parameters={"binary_data_size": 8}),
        "allowed is 16, for 2 values",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_named_with_what_is_allowed(banded, case):
    document, said = WRONG[case]

    error = failed(banded.client.post(INFER, content=json.dumps(document)))

    assert said in error
    assert "allowed is " in error


@pytest.mark.parametrize(
    ("document", "named"),
    [
        (request(parameters={"sequence_id": 7, "sequence_start": True}), "sequence_id"),
        (request(outputs=[{"name": "x_m", "parameters": {"classification": 2}}]), "x_m"),
        (request(outputs=[{"name": "x_m", "parameters": {"shared_memory_region": "r"}}]), "x_m"),
        (request_with("mass_kg", data=None, parameters={"shared_memory_region": "r"}), "mass_kg"),
    ],
)
def test_what_there_is_not_is_unsupported(banded, document, named):
    assert named in failed(banded.client.post(INFER, json=document), 501)


def test_hints_for_a_scheduler_and_unknown_members_are_ignored(banded):
    hints = {"priority": 1, "timeout": 5, "triton_enable_empty_final_response": False}

    answer = banded.client.post(INFER, json=request(model_name="viper-lunar", parameters=hints))

    assert answer.content == banded.client.post(INFER, json=request()).content


@pytest.mark.parametrize(
    "body", [b"", b"{", b"[]", b"7", b"null", b"[" * 60_000, b'{"inputs":' + b"[" * 5000, b"\xff\xfe", b'{"id":"\xff"}']
)
def test_what_is_no_json_object_is_refused(banded, body):
    failed(banded.client.post(INFER, content=body))


@pytest.mark.parametrize("length", ["0", "-1", "1e3", "", "x", "+5", "99999999999999999999", "100000", "5"])
def test_a_header_length_that_does_not_fit_is_refused(banded, length):
    failed(banded.client.post(INFER, content=in_binary()[1], headers={LENGTH: length}))


def test_the_binary_part_has_the_tensors_bytes_and_no_others(banded):
    whole = struct.pack("<2d", *VALUES["mass_kg"])
    for content in (b"", whole[:-1], whole + b"\0"):
        head, body = in_binary(content=content)
        failed(banded.client.post(INFER, content=body, headers={LENGTH: str(len(head))}))
    document = request_with("mass_kg", parameters={"binary_data_size": 16})
    head = json.dumps(document).encode()
    error = failed(banded.client.post(INFER, content=head + b"\0" * 16, headers={LENGTH: str(len(head))}))
    assert "mass_kg.data" in error


@pytest.mark.parametrize("encoding", ["gzip", "deflate", "GZIP", "identity"])
def test_a_packed_body_is_unpacked(banded, encoding):
    body = json.dumps(request()).encode()
    packed = {"gzip": gzip.compress, "deflate": zlib.compress}.get(encoding.lower(), bytes)(body)

    answer = banded.client.post(INFER, content=packed, headers={"Content-Encoding": encoding})

    assert answer.content == banded.client.post(INFER, content=body).content


@pytest.mark.slow
def test_a_body_that_cannot_be_unpacked_is_refused(banded):
    def post(content, encoding="gzip"):
        return banded.client.post(INFER, content=content, headers={"Content-Encoding": encoding})

    whole = gzip.compress(json.dumps(request()).encode())
    for content in (b"", b"{}", whole[:-9], whole + b"x", whole + whole):
        failed(post(content))
    assert "br" in failed(post(whole, "br"), 415)
    # a small body that would unpack to a hundred megabytes
    assert "65536 bytes" in failed(post(gzip.compress(b" " * 100_000_000)[:60_000]), 413)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "path", "status"),
    [
        ("GET", "/v2/nothing", 404),
        ("GET", "/v2/models/nobody", 404),
        ("GET", "/v2/models/..%2f..%2fetc", 404),
        ("GET", "/v2/models/VIPER", 404),
        ("GET", "/v2/models/viper-lunar/versions/99", 404),
        ("GET", "/v2/models/viper-lunar/versions/01/ready", 404),
        ("GET", "/v2/models/viper-lunar/versions/nobody/stats", 404),
        ("GET", "/v2/models/nobody/config", 404),
        ("POST", "/v2/models/nobody/infer", 404),
        ("POST", "/v2/models/viper-lunar/versions/%2e%2e/infer", 404),
        ("GET", INFER, 405),
        ("POST", "/v2", 405),
        ("POST", "/v2/trace/setting", 404),
    ],
)
def test_errors_of_the_address_have_the_form_too(banded, method, path, status):
    answer = banded.client.request(method, path)

    failed(answer, status)
    assert ("allow" in answer.headers) == (status == 405)


def test_a_body_over_the_limit_has_the_form_too(banded):
    failed(banded.client.post(INFER, content=b"x" * 70_000), 413)


@pytest.mark.parametrize("path", ["/v1/predictions/nothing", "/v2x", "/v1"])
def test_other_addresses_keep_their_problems(banded, path):
    assert banded.get(path).headers["content-type"] == "application/problem+json"


@pytest.mark.parametrize("path", ["index", "models/viper-lunar/load", "models/other/unload"])
def test_bodies_of_the_repository_are_checked(service_with_token, path):
    for content in (b"{", b"[]", b'{"ready": 1, "parameters": 7}'):
        failed(service_with_token.client.post(f"/v2/repository/{path}", content=content))


@pytest.mark.slow
def test_the_index_can_be_of_what_is_ready_only(publish, move, serve, store):
    move(store, publish(store))
    publish(store, coefficient=0.2)
    running = serve()
    running.wait_ready()

    def index(**asked):
        return running.client.post("/v2/repository/index", json=asked).json()

    assert [(each["version"], each["state"]) for each in index()] == [("1", "READY"), ("2", "UNAVAILABLE")]
    assert [each["version"] for each in index(ready=True)] == ["1"]
    assert index()[0]["reason"] == ""
    assert index()[1]["reason"] != ""


def test_an_addresses_trailing_slash_is_that_of_the_specification(banded):
    assert banded.get("/v2/").json() == banded.get("/v2").json()


@pytest.mark.slow
@given(
    st.binary(max_size=300) | st.sampled_from([in_binary()[1], json.dumps(request()).encode()]),
    st.none() | st.integers(-3, 400).map(str) | st.just(str(len(in_binary()[0]))),
    st.integers(0, 600),
    st.binary(max_size=3),
)
@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_bytes_get_an_answer_and_never_a_fault_of_ours(banded, body, length, at, noise):
    body = body[:at] + noise + body[at + len(noise) :]

    answer = banded.client.post(INFER, content=body, headers={} if length is None else {LENGTH: length})

    if answer.status_code != 200:
        failed(answer, 501 if answer.status_code == 501 else 400)


@pytest.mark.slow
def test_every_route_of_the_protocol_declares_its_errors_in_the_form():
    paths = {path: each for path, each in openapi_document()["paths"].items() if path.startswith("/v2")}

    assert len(paths) == 18
    for path, operations in paths.items():
        for operation in operations.values():
            failures = {status: each for status, each in operation["responses"].items() if status >= "4"}
            assert "500" in failures, path
            assert "422" not in failures, path
            assert all(list(each["content"]) == ["application/json"] for each in failures.values())
