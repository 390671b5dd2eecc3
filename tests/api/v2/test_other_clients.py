"""What clients of other projects send, byte by byte as it was recorded from them, and what they need of the answer.

The clients themselves are too large to be here: `make other-clients` runs them (docs/clients.md).
"""

from __future__ import annotations

import json
import struct

import numpy as np
import pytest

INFER = "/v2/models/viper-lunar/infer"
LENGTH = "inference-header-content-length"
ASKED = {"slope_deg": [10.0, 40.0], "mass_kg": [430, 430], "torque_nm": [60, 60]}


def packed(kinds):
    return b"".join(struct.pack(f"<2{kind}", *ASKED[name]) for name, kind in zip(ASKED, kinds, strict=True))


def kserve_binary():
    """KServe 0.21: the model's name stands in the body too, the header is in small letters."""
    inputs = [
        {"name": name, "shape": [2], "datatype": "FP64", "parameters": {"binary_data_size": 16}} for name in ASKED
    ]
    outputs = [{"name": "outcome", "parameters": {"binary_data": True}}, {"name": "x_m"}]
    head = json.dumps({"id": "q", "model_name": "viper-lunar", "inputs": inputs, "outputs": outputs}).encode()
    return head + packed("ddd"), {LENGTH: str(len(head)), "content-type": "application/octet-stream"}


def mlserver_infer_binary():
    """`mlserver infer --binary-data` 1.7.1: shapes [N, 1], integers where the numbers are whole, JSON as media type."""
    inputs = [
        {"name": name, "shape": [2, 1], "datatype": datatype, "parameters": {"binary_data_size": 16}}
        for name, datatype in zip(ASKED, ("FP64", "INT64", "INT64"), strict=True)
    ]
    outputs = [{"name": "outcome", "parameters": {"binary_data": True}}]
    head = json.dumps({"id": "0", "inputs": inputs, "outputs": outputs}).encode()
    more = {"seldon-puid": "0", "x-request-id": "0", LENGTH: str(len(head)), "content-type": "application/json"}
    return head + packed("dqq"), more


def mlserver_pandas():
    """PandasCodec's request as `model_dump` writes it."""
    inputs = [
        {"name": name, "shape": [2, 1], "datatype": "FP64" if name == "slope_deg" else "INT64", "data": values}
        for name, values in ASKED.items()
    ]
    document = {"parameters": {"content_type": "pd"}, "inputs": inputs, "outputs": [{"name": "outcome"}]}
    return json.dumps(document).encode(), {"content-type": "application/json"}


def open_inference():
    """open-inference-openapi 2.0."""
    inputs = [{"name": name, "shape": [2], "datatype": "FP64", "data": values} for name, values in ASKED.items()]
    document = {"id": "7", "inputs": inputs, "outputs": [{"name": "outcome"}]}
    return json.dumps(document).encode(), {"content-type": "application/json", "x-fern-language": "Python"}


CLIENTS = (kserve_binary, mlserver_infer_binary, mlserver_pandas, open_inference)


@pytest.mark.parametrize("client", CLIENTS, ids=lambda each: each.__name__)
def test_a_client_gets_the_outcomes_it_asked_for(shipped, client):
    body, headers = client()
    answer = shipped.client.post(INFER, content=body, headers=headers)

    assert answer.status_code == 200, answer.text
    length = int(answer.headers.get(LENGTH, len(answer.content)))
    document = json.loads(answer.content[:length])
    outcome = document["outputs"][0]
    assert (outcome["name"], outcome["datatype"], outcome["shape"]) == ("outcome", "BYTES", [2])
    if "data" in outcome:
        assert outcome["data"] == ["climbs", "slides"]
    else:
        assert answer.content[length:] == b"\x06\0\0\0climbs\x06\0\0\0slides"
        assert outcome["parameters"] == {"binary_data_size": 20}
    if len(document["outputs"]) > 1:
        assert np.shape(document["outputs"][1]["data"]) == (2 * 201,)


@pytest.mark.parametrize("client", CLIENTS, ids=lambda each: each.__name__)
def test_a_client_is_told_what_is_wrong_where_it_looks_for_it(shipped, client):
    """KServe reads `error` only where the media type is exactly JSON's."""
    body, headers = client()
    answer = shipped.client.post("/v2/models/nope/infer", content=body, headers=headers)

    assert (answer.status_code, answer.headers["content-type"]) == (404, "application/json")
    assert answer.json() == {"error": "no model 'nope'; there are viper-lunar, viper-lunar-paper"}


def test_metadata_has_what_mlserver_and_kserve_read(shipped):
    server, model = (shipped.get(path).json() for path in ("/v2", "/v2/models/viper-lunar"))

    assert set(server) == {"name", "version", "extensions"}
    assert {"name", "versions", "platform", "inputs", "outputs"} <= set(model)
    assert all({"name", "datatype", "shape"} <= set(each) for each in (*model["inputs"], *model["outputs"]))
    assert shipped.get("/v2/health/live").json()["live"] is True
    assert shipped.get("/v2/health/ready").json()["ready"] is True
    assert shipped.get("/v2/models/viper-lunar/ready").status_code == 200
    assert shipped.get("/v2/models/nope/ready").status_code == 404
