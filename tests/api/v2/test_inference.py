"""The Open Inference Protocol as the unmodified `tritonclient` speaks it: what it gets is what `/v1` answers."""

from __future__ import annotations

import numpy as np
import pytest
import tritonclient.http as triton
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tritonclient.utils import InferenceServerException, triton_to_np_dtype

from service.settings import LIMITS
from tests.api.conftest import ADMIN, TOKEN
from tests.digits import in_text, rounded

SCENARIO = ("slope_deg", "mass_kg", "torque_nm")
LIMIT_OF = {
    "slope_deg": (-LIMITS.slope_deg, LIMITS.slope_deg),
    "mass_kg": LIMITS.mass_kg,
    "torque_nm": LIMITS.torque_nm,
}


@pytest.fixture(scope="module")
def client(banded):
    with triton.InferenceServerClient(banded.url.removeprefix("http://")) as connected:
        yield connected


def tensors(datatype="FP64", binary=True, **columns):
    made = []
    for name, values in columns.items():
        array = np.asarray(values, dtype=triton_to_np_dtype(datatype))
        tensor = triton.InferInput(name, list(array.shape), datatype)
        made.append(tensor.set_data_from_numpy(array, binary_data=binary))
    return made


def scenarios(count=1):
    """So many scenarios, all different, most of them inside the domain."""
    return {
        "slope_deg": np.linspace(-5.0, 30.0, count),
        "mass_kg": np.linspace(320.0, 560.0, count)[::-1],
        "torque_nm": np.linspace(35.0, 85.0, count),
    }


def wanted(*names, binary=True):
    return [triton.InferRequestedOutput(name, binary_data=binary) for name in names]


def refusal(call):
    with pytest.raises(InferenceServerException) as caught:
        call()
    return caught.value


def test_server_and_models_say_that_they_are_there(client):
    assert client.is_server_live()
    assert client.is_server_ready()
    assert client.is_model_ready("viper-lunar")
    assert client.is_model_ready("viper-lunar", "2")
    assert client.is_model_ready("viper-lunar", "champion")
    assert not client.is_model_ready("viper-lunar", "3")
    assert not client.is_model_ready("nobody")
    metadata = client.get_server_metadata()
    assert metadata["name"] == "rover-twin"
    assert {"binary_tensor_data", "model_repository", "statistics"} <= set(metadata["extensions"])


@pytest.mark.parametrize("count", [1, 7])
@pytest.mark.parametrize("frame", ["slope", "world"])
def test_every_output_is_the_very_one_of_the_single_route(banded, client, count, frame):
    asked = scenarios(count)
    names = ["time_s", "x_m", "y_m" if frame == "slope" else "z_m", "outcome", "inside_domain"]
    names += [f"prior_{name}" for name in names[1:3]]
    bounds = ["x_lower_m", "x_upper_m", "y_lower_m", "y_upper_m"] if frame == "slope" else []

    answer = client.infer(
        "viper-lunar",
        tensors(**asked),
        outputs=wanted(*names, "speed_m_s", *bounds),
        parameters={"frame": frame, "dt_s": 0.3, "band_level": 0.8},
    )

    found = {name: answer.as_numpy(name) for name in (*names, "speed_m_s", *bounds)}
    for row in range(count):
        include = {"include": "prior,speed,band", "band_level": 0.8} if bounds else {"include": "prior,speed"}
        one = {name: float(values[row]) for name, values in asked.items()}
        document = banded.predict(**one, frame=frame, dt_s=0.3, **include).json()
        shown = {name: found[name] if name == "time_s" else found[name][row] for name in found}
        for name in (*names[:3], "speed_m_s"):
            assert in_text(shown)[name].tolist() == document["trajectory"][name]
        for name in names[1:3]:
            assert rounded(shown[f"prior_{name}"]).tolist() == document["prior"][name]
        for name in bounds:
            assert rounded(shown[name]).tolist() == document["band"][name]
        assert found["outcome"][row].decode() == document["summary"]["outcome"]
        assert bool(found["inside_domain"][row]) == document["domain"]["inside"]
    assert answer.get_response()["parameters"]["frame"] == frame
    assert answer.get_response()["parameters"]["alias"] == "champion"


@pytest.mark.slow
def test_the_prior_is_the_prior_where_a_network_corrects_it(publish, move, serve, store):
    move(store, publish(store, architecture="paper_network"))
    running = serve()
    running.wait_ready()
    names = ("x_m", "y_m", "prior_x_m", "prior_y_m")
    with triton.InferenceServerClient(running.url.removeprefix("http://")) as connected:
        answer = connected.infer("viper-lunar", tensors(**scenarios()), outputs=wanted(*names))
    one = {name: float(values[0]) for name, values in scenarios().items()}
    document = running.predict(**one, include="prior").json()

    for name in ("x_m", "y_m"):
        assert rounded(answer.as_numpy(name)[0]).tolist() == document["trajectory"][name] != document["prior"][name]
        assert rounded(answer.as_numpy(f"prior_{name}")[0]).tolist() == document["prior"][name]


@st.composite
def forms(draw):
    """How tensors travel: each input and output in JSON or binary, in any order."""
    inputs = draw(st.permutations([(name, draw(st.booleans())) for name in (*SCENARIO, "horizon_s")]))
    outputs = draw(
        st.lists(
            st.tuples(
                st.sampled_from(["time_s", "x_m", "y_m", "outcome", "inside_domain", "prior_y_m", "x_upper_m"]),
                st.booleans(),
            ),
            unique_by=lambda output: output[0],
            min_size=1,
        )
    )
    return inputs, outputs, draw(st.sampled_from([None, "gzip", "deflate"]))


@pytest.mark.slow
@given(forms(), st.integers(1, 6))
@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_the_numbers_do_not_depend_on_how_they_travel(client, form, count):
    inputs, outputs, packed = form
    columns = scenarios(count) | {"horizon_s": np.array([2.0])}
    sent = [tensor for name, binary in inputs for tensor in tensors(binary=binary, **{name: columns[name]})]
    answers = [
        client.infer(
            "viper-lunar",
            each,
            outputs=[triton.InferRequestedOutput(name, binary_data=binary and as_asked) for name, binary in outputs],
            parameters={"dt_s": 0.5},
            request_compression_algorithm=packed if as_asked else None,
            response_compression_algorithm=packed if as_asked else None,
        )
        for each, as_asked in ((sent, True), (tensors(**columns, binary=False), False))
    ]

    assert [each["name"] for each in answers[0].get_response()["outputs"]] == [name for name, _ in outputs]
    for name, _ in outputs:
        one, other = (answer.as_numpy(name) for answer in answers)
        assert one.shape == other.shape
        if one.ndim == 2 and name != "time_s":  # over time: of text it has seven decimals
            one, other = rounded(one), rounded(other)
        assert [_text(each) for each in one.ravel()] == [_text(each) for each in other.ravel()]


def _text(value):
    return value.decode() if isinstance(value, bytes) else value


def test_fp32_is_taken_as_the_same_value_in_fp64(banded, client):
    def in_json(datatype, slope_deg):
        sent = scenarios() | {"slope_deg": [slope_deg]}
        inputs = [
            {"name": name, "shape": [1], "datatype": datatype, "data": [*map(float, values)]}
            for name, values in sent.items()
        ]
        return banded.client.post("/v2/models/viper-lunar/infer", json={"inputs": inputs}).json()["outputs"]

    assert in_json("FP32", 28.1) == in_json("FP64", float(np.float32(28.1))) != in_json("FP64", 28.1)
    columns = {name: values.astype(np.float32) for name, values in scenarios(5).items()}
    exact = {name: values.astype(np.float64) for name, values in columns.items()}

    for binary in (True, False):
        short = client.infer("viper-lunar", tensors("FP32", binary=binary, **columns))
        long = client.infer("viper-lunar", tensors(**exact))
        assert short.as_numpy("x_m").tobytes() == long.as_numpy("x_m").tobytes()


def test_own_times_answer_what_a_grid_of_them_answers(client):
    asked = scenarios(3)
    grid = client.infer("viper-lunar", tensors(**asked, horizon_s=[1.0]), parameters={"dt_s": 0.25})
    times = grid.as_numpy("time_s")
    own = client.infer("viper-lunar", tensors(**asked, time_s=times))
    sparse = client.infer("viper-lunar", tensors(**asked, time_s=times[[1, 4]]))

    assert times.tolist() == [0.0, 0.25, 0.5, 0.75, 1.0]
    assert own.as_numpy("x_m").tobytes() == grid.as_numpy("x_m").tobytes()
    np.testing.assert_allclose(sparse.as_numpy("x_m"), grid.as_numpy("x_m")[:, [1, 4]], rtol=0, atol=1e-9)
    assert sparse.as_numpy("outcome").tolist() == grid.as_numpy("outcome").tolist()


def test_each_scenario_may_have_its_own_horizon(client):
    asked, horizons = scenarios(3), np.array([1.0, 0.45, 2.0])
    names = ("time_s", "x_m", "y_m", "outcome", "sample_count")
    together = client.infer(
        "viper-lunar", tensors(**asked, horizon_s=horizons), outputs=wanted(*names), parameters={"dt_s": 0.2}
    )

    assert together.as_numpy("sample_count").tolist() == [6, 4, 11]
    for row, count in enumerate(together.as_numpy("sample_count")):
        alone = client.infer(
            "viper-lunar",
            tensors(**{name: values[[row]] for name, values in asked.items()}, horizon_s=horizons[[row]]),
            parameters={"dt_s": 0.2},
        )
        assert together.as_numpy("time_s")[row, :count].tolist() == alone.as_numpy("time_s").tolist()
        for name in ("x_m", "y_m"):
            values = together.as_numpy(name)[row]
            np.testing.assert_allclose(values[:count], alone.as_numpy(name)[0], rtol=0, atol=1e-9)
            assert set(values[count:]) <= {values[count - 1]}
        assert together.as_numpy("outcome")[row] == alone.as_numpy("outcome")[0]


def test_a_version_in_the_address_is_the_one_that_answers(banded, client):
    by_version = {
        version: client.infer("viper-lunar", tensors(**scenarios(2)), model_version=version)
        for version in ("1", "2", "champion")
    }

    assert [each.get_response()["model_version"] for each in by_version.values()] == ["1", "2", "1"]
    assert by_version["1"].as_numpy("x_m").tobytes() == by_version["champion"].as_numpy("x_m").tobytes()
    assert by_version["1"].as_numpy("x_m").tobytes() != by_version["2"].as_numpy("x_m").tobytes()


@pytest.mark.parametrize("request_id", ["42", 'ü\n"\\', "x" * 1024])
def test_the_id_comes_back(client, request_id):
    assert client.infer("viper-lunar", tensors(**scenarios()), request_id=request_id).get_response()["id"] == request_id


def test_without_an_id_there_is_none(client):
    assert "id" not in client.infer("viper-lunar", tensors(**scenarios())).get_response()


@pytest.mark.parametrize("version", ["1", "2"])
def test_metadata_lists_just_the_tensors_that_are_there(client, version):
    metadata = client.get_model_metadata("viper-lunar", version)
    configuration = client.get_model_config("viper-lunar", version)
    given_names = [each["name"] for each in metadata["inputs"] if not each["parameters"]["optional"]]
    slope_frame = [each for each in metadata["outputs"] if each["parameters"].get("frame") != "world"]

    answer = client.infer(
        "viper-lunar",
        tensors(**{name: scenarios(2)[name] for name in given_names}),
        model_version=version,
        outputs=wanted(*(each["name"] for each in slope_frame)),
    )
    usual = client.infer("viper-lunar", tensors(**scenarios(2)), model_version=version).get_response()["outputs"]

    assert metadata["versions"] == ["1", "2"]
    for each, found in zip(slope_frame, answer.get_response()["outputs"], strict=True):
        assert (each["name"], each["datatype"], len(each["shape"])) == (
            found["name"],
            found["datatype"],
            len(found["shape"]),
        )
    assert [each["name"] for each in usual] == [
        each["name"] for each in slope_frame if not each["parameters"]["on_request"]
    ]
    assert ("x_lower_m" in {each["name"] for each in slope_frame}) == (version == "1")
    for kind in ("input", "output"):
        assert [each["name"] for each in configuration[kind]] == [each["name"] for each in metadata[f"{kind}s"]]


@pytest.mark.parametrize("name", SCENARIO)
def test_the_ranges_in_the_metadata_are_those_that_hold(banded, client, name):
    (tensor,) = [each for each in client.get_model_metadata("viper-lunar")["inputs"] if each["name"] == name]
    lowest, highest = tensor["parameters"]["minimum"], tensor["parameters"]["maximum"]

    assert (lowest, highest) == LIMIT_OF[name]
    trained = [tensor["parameters"][f"trained_{side}"] for side in ("minimum", "maximum")]
    assert trained == banded.get("/v1/models/viper-lunar/versions/1").json()["domain"][name]
    for value, answered in (
        (lowest, True),
        (highest, True),
        (np.nextafter(lowest, -np.inf), False),
        (np.nextafter(highest, np.inf), False),
    ):
        asked = tensors(**(scenarios() | {name: [value]}))
        if answered:
            assert np.isfinite(client.infer("viper-lunar", asked).as_numpy("x_m")).all()
        else:
            assert name in str(refusal(lambda asked=asked: client.infer("viper-lunar", asked)))


@pytest.mark.parametrize("binary", [True, False])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("name", [*SCENARIO, "horizon_s", "time_s"])
def test_what_is_not_finite_is_refused_by_name_and_place(client, name, value, binary):
    columns = scenarios(4)
    columns[name] = np.array([1.0, 2.0, value, 3.0])

    error = refusal(lambda: client.infer("viper-lunar", tensors(binary=binary, **columns)))

    assert error.status() == "400"
    assert f"{name}[2] is " in error.message()
    assert "allowed is" in error.message()


def test_bounds_of_a_request(client):
    assert client.infer("viper-lunar", tensors(**scenarios(1000)), parameters={"dt_s": 5}).as_numpy("x_m").shape == (
        1000,
        3,
    )
    for columns, parameters, named in (
        (scenarios(1001), {"dt_s": 5}, "slope_deg.shape"),
        (scenarios(1000), {"dt_s": 0.005}, "dt_s"),
        (scenarios(1) | {"horizon_s": [600.0]}, {"dt_s": 0.001}, "dt_s"),
        (scenarios(2) | {"horizon_s": [1.0, 1.0, 1.0]}, {}, "horizon_s.shape"),
        (scenarios(2) | {"mass_kg": [400.0]}, {}, "mass_kg.shape"),
        (scenarios(1) | {"time_s": [0.0, 1.0, 1.0]}, {}, "time_s[2]"),
        (scenarios(1) | {"time_s": [0.0]}, {}, "time_s[0]"),
        (scenarios(1) | {"time_s": [1.0], "horizon_s": [1.0]}, {}, "horizon_s"),
        (scenarios(1) | {"time_s": [1.0]}, {"dt_s": 1.0}, "dt_s"),
    ):
        error = refusal(lambda c=columns, p=parameters: client.infer("viper-lunar", tensors(**c), parameters=p))
        assert error.status() == "400"
        assert error.message().startswith(f"{named} is "), error.message()


@pytest.mark.slow
def test_the_step_that_is_offered_is_accepted(client):
    asked = tensors(**scenarios(900))
    error = refusal(lambda: client.infer("viper-lunar", asked, parameters={"dt_s": 0.001}))

    finest = float(error.message().partition("allowed is ")[2].partition(" ")[0])

    shape = client.infer("viper-lunar", asked, outputs=wanted("x_m"), parameters={"dt_s": finest}).as_numpy("x_m").shape
    assert 0.98e6 < shape[0] * shape[1] <= 1e6


def test_a_version_without_a_band_has_no_such_outputs(client):
    error = refusal(
        lambda: client.infer(
            "viper-lunar", tensors(**scenarios()), model_version="2", outputs=wanted("x_m", "x_lower_m")
        )
    )

    assert error.status() == "400"
    assert "x_lower_m" in error.message()
    assert "viper-lunar@2" in error.message()


@pytest.mark.slow
def test_statistics_count_what_was_asked(publish, move, serve, store):
    move(store, publish(store))
    running = serve()
    running.wait_ready()
    with triton.InferenceServerClient(running.url.removeprefix("http://")) as client:
        for count in (1, 5):
            client.infer("viper-lunar", tensors(**scenarios(count)))
        refusal(lambda: client.infer("viper-lunar", tensors(slope_deg=[1.0])))
        (counted,) = client.get_inference_statistics()["model_stats"]

        assert (counted["name"], counted["version"]) == ("viper-lunar", "1")
        assert (counted["inference_count"], counted["execution_count"]) == (6, 2)
        durations = counted["inference_stats"]
        assert {kind: each["count"] for kind, each in durations.items()} == {
            "success": 2,
            "fail": 1,
            "queue": 2,
            "compute_input": 2,
            "compute_infer": 2,
            "compute_output": 2,
            "cache_hit": 0,
        }
        parts = sum(durations[part]["ns"] for part in ("queue", "compute_input", "compute_infer", "compute_output"))
        assert durations["success"]["ns"] == parts
        assert all(each["ns"] > 0 for kind, each in durations.items() if kind != "cache_hit")
        for of in (("viper-lunar",), ("viper-lunar", "1"), ("viper-lunar", "champion")):
            assert client.get_inference_statistics(*of)["model_stats"] == [counted]
        assert refusal(lambda: client.get_inference_statistics("nobody")).status() == "404"


@pytest.mark.slow
def test_the_repository_shows_what_is_in_memory(publish, move, serve, store):
    move(store, publish(store))
    move(store, publish(store, "other"), name="other")
    running = serve(admin_token=TOKEN, start_worker=False)
    running.wait_ready()
    with triton.InferenceServerClient(running.url.removeprefix("http://")) as client:

        def states():
            return {each["name"]: each["state"] for each in client.get_model_repository_index()}

        assert states() == {"viper-lunar": "READY", "other": "UNAVAILABLE"}
        client.load_model("other", headers=ADMIN)
        assert states() == {"viper-lunar": "READY", "other": "READY"}
        refused = refusal(lambda: client.unload_model("viper-lunar", headers=ADMIN))
        assert (refused.status(), "default" in refused.message()) == ("400", True)
        assert refusal(lambda: client.load_model("nobody", headers=ADMIN)).status() == "404"
        assert refusal(lambda: client.unload_model("nobody", headers=ADMIN)).status() == "404"
        assert refusal(lambda: client.load_model("other", headers=ADMIN, config="{}")).status() == "501"
        assert client.is_model_ready("viper-lunar")
        client.unload_model("other", headers=ADMIN)
        assert states() == {"viper-lunar": "READY", "other": "UNAVAILABLE"}
        assert client.is_model_ready("other"), "asking loads it again"
        assert states()["other"] == "READY"


@pytest.mark.slow
def test_damage_of_one_version_is_told_of_that_version_only(publish, move, serve, store):
    move(store, publish(store))
    publish(store, coefficient=0.2)
    running = serve()
    running.wait_ready()
    (running.folder / "models/viper-lunar/versions/2/weights.safetensors").write_bytes(b"")
    with triton.InferenceServerClient(running.url.removeprefix("http://")) as client:
        assert not client.is_model_ready("viper-lunar", "2")
        error = refusal(lambda: client.infer("viper-lunar", tensors(**scenarios()), model_version="2"))
        assert error.status() == "503"
        assert client.infer("viper-lunar", tensors(**scenarios())).get_response()["model_version"] == "1"
        assert client.is_server_ready()


@pytest.mark.slow
def test_a_server_without_models_is_alive_and_not_ready(serve, store):
    running = serve()
    with triton.InferenceServerClient(running.url.removeprefix("http://")) as client:
        assert client.is_server_live()
        assert not client.is_server_ready()
        assert client.get_model_repository_index() == []
        assert not client.is_model_ready("viper-lunar")
    answer = running.get("/v2/health/ready")
    assert (answer.status_code, answer.json()["live"], answer.json()["ready"]) == (503, True, False)
    assert running.get("/v2/models").json() == {"models": []}
