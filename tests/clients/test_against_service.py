"""The clients against the real service, started as an operator starts it, with its shipped model."""

from __future__ import annotations

import dataclasses
import os
import re
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rover_twin_client
from rover_twin_client import (
    ConnectionFailedError,
    InvalidInputError,
    MobilityMap,
    NotFoundError,
    OutsideDomainError,
    RoverTwin,
    TimedOutError,
)
from tests.clients.served import REPOSITORY, served
from tests.digits import HALF

pytestmark = pytest.mark.processes


@pytest.fixture(scope="module")
def service_url(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a running `rover-twin serve`, ready to predict."""
    with served(tmp_path_factory.mktemp("service") / "log.txt") as url:
        yield url


@pytest.fixture(scope="module")
def twin(service_url: str) -> Iterator[RoverTwin]:
    """A client of the running service."""
    with RoverTwin(service_url) as twin:
        yield twin


def test_the_readmes_scenario_is_answered_whole(twin: RoverTwin) -> None:
    prediction = twin.predict(28, 430, 60, 10)

    assert prediction.model.name == "viper-lunar"
    assert prediction.model.alias == "champion"
    assert prediction.frame == "slope"
    assert (prediction.time_s[0], prediction.time_s[-1]) == (0.0, 10.0)
    assert np.all(np.diff(prediction.time_s) > 0)
    assert prediction.y_m is not None
    assert prediction.x_m.size == prediction.y_m.size == prediction.time_s.size
    assert prediction.prior is None
    assert prediction.domain.inside
    assert prediction.summary.final_x_m == pytest.approx(prediction.x_m[-1])


def test_the_prior_comes_when_asked_for(twin: RoverTwin) -> None:
    prediction = twin.predict(28, 430, 60, include=["prior"])

    assert prediction.prior is not None
    assert prediction.prior.x_m.size == prediction.time_s.size


def test_the_speed_comes_when_asked_for(twin: RoverTwin) -> None:
    slope, world = (twin.predict(28, 430, 60, frame=frame, include=["speed"]) for frame in ("slope", "world"))

    assert slope.speed_m_s is not None
    assert slope.speed_m_s.size == slope.time_s.size
    assert world.speed_m_s is not None
    np.testing.assert_array_equal(world.speed_m_s, slope.speed_m_s)
    assert slope.rear_wheel_speed_rad_s is None


def test_the_sampling_is_the_one_asked_for_and_ends_at_the_horizon(twin: RoverTwin) -> None:
    time_s = twin.predict(28, 430, 60, 1.0, dt_s=0.3).time_s

    np.testing.assert_allclose(time_s, [0.0, 0.3, 0.6, 0.9, 1.0])


def test_the_world_frame_is_the_slope_frame_turned_by_the_slope(twin: RoverTwin) -> None:
    slope = twin.predict(28, 430, 60, include=["prior"])
    world = twin.predict(28, 430, 60, include=["prior"], frame="world")
    cosine, sine = np.cos(np.radians(28)), np.sin(np.radians(28))

    for before, after in [(slope, world), (slope.prior, world.prior)]:
        assert before is not None
        assert after is not None
        np.testing.assert_allclose(after.x_m, before.x_m * cosine - before.y_m * sine, rtol=0, atol=3 * HALF)
        np.testing.assert_allclose(after.z_m, before.x_m * sine + before.y_m * cosine, rtol=0, atol=3 * HALF)


def test_a_version_asked_for_by_number_answers_without_alias(twin: RoverTwin) -> None:
    champion = twin.predict(28, 430, 60)

    same = twin.predict(28, 430, 60, model=str(champion.model))

    assert (same.model.name, same.model.version) == (champion.model.name, champion.model.version)
    assert same.model.alias is None
    np.testing.assert_array_equal(same.x_m, champion.x_m)


def test_models_and_manifests_agree(twin: RoverTwin) -> None:
    (listed,) = [model for model in twin.models() if model.name == "viper-lunar"]
    one = twin.model("viper-lunar")

    assert listed.versions == one.versions
    assert listed.aliases["champion"] in listed.versions
    assert twin.ready().model.version == listed.aliases["champion"]
    manifest = twin.manifest("viper-lunar", listed.aliases["champion"])
    assert (manifest["name"], manifest["version"]) == ("viper-lunar", listed.aliases["champion"])
    assert "weights.safetensors" in manifest["files"]


BAD = {
    "slope_deg": [90, float("nan"), float("-inf")],
    "mass_kg": [0, -430, 1e9, float("nan")],
    "torque_nm": [-60, 1e9, float("inf")],
    "horizon_s": [0, -1, 1e9, float("nan")],
    "dt_s": [0, -1, 1e9, float("nan")],
}


@pytest.mark.parametrize(("field", "value"), [(field, value) for field, values in BAD.items() for value in values])
def test_each_bad_value_comes_back_with_its_name_and_range(twin: RoverTwin, field: str, value: float) -> None:
    asked = {"slope_deg": 28.0, "mass_kg": 430.0, "torque_nm": 60.0, "horizon_s": 10.0} | {field: value}

    with pytest.raises(InvalidInputError) as caught:
        twin.predict(**asked)

    assert field in [fault.field for fault in caught.value.faults]
    assert all(fault.allowed for fault in caught.value.faults)


@pytest.fixture(scope="module")
def champion_map(twin: RoverTwin) -> MobilityMap:
    """A small map of the shipped champion, 4 torques x 7 slopes."""
    return twin.mobility(430, 30, 120, 4.0, torque_steps=4, slope_min_deg=10, slope_max_deg=40, slope_steps=7)


def test_a_cell_of_the_map_is_the_prediction_of_its_scenario(twin: RoverTwin, champion_map: MobilityMap) -> None:
    for row, column in ((0, 0), (1, 4), (3, 6)):
        torque_nm, slope_deg = champion_map.torque_nm[row], champion_map.slope_deg[column]
        prediction = twin.predict(slope_deg, 430, torque_nm, 4.0)

        assert champion_map.outcome[row, column] == prediction.summary.outcome
        assert champion_map.mean_speed_m_s[row, column] == pytest.approx(prediction.summary.mean_speed_m_s)
        assert champion_map.slip_ratio[row, column] == pytest.approx(prediction.summary.slip_ratio)
        assert champion_map.inside_domain[row, column] == prediction.domain.inside
    assert champion_map.torque_nm.tolist() == [30, 60, 90, 120]
    assert champion_map.slope_deg.tolist() == [10, 15, 20, 25, 30, 35, 40]


def test_the_champions_band_judges_the_steepest_slopes(twin: RoverTwin, champion_map: MobilityMap) -> None:
    assert champion_map.model == twin.predict(28, 430, 60).model
    assert (champion_map.steepest_by, champion_map.confidence) == ("band", 0.9)
    assert np.nanmax(champion_map.steepest_climb_slope_deg) < 40

    paper = twin.mobility(430, 30, slope_min_deg=44, slope_max_deg=45, slope_steps=2, model="viper-lunar-paper")

    assert (paper.steepest_by, paper.confidence) == ("central_estimate", None)
    assert np.isnan(paper.steepest_climb_slope_deg).tolist() == [True]  # what the service sends as null


def test_suggested_runs_are_named_and_explained(twin: RoverTwin) -> None:
    champion = twin.ready().model

    suggested = twin.suggested_runs(champion.name, champion.version, n=3)

    assert str(suggested.model) == str(champion)
    assert len({run.file for run in suggested.runs}) == 3
    assert all(run.reason.nearest_run for run in suggested.runs)
    assert all(run.step_s > 0 and run.horizon_s > 0 and run.set == "suggested" for run in suggested.runs)
    assert len(twin.suggested_runs(champion.name, champion.version).runs) == 8


def test_the_asynchronous_client_hears_the_same(
    service_url: str, twin: RoverTwin, champion_map: MobilityMap, ask: Callable[..., Any]
) -> None:
    name, version = champion_map.model.name, champion_map.model.version
    shape = {"torque_steps": 4, "slope_min_deg": 10, "slope_max_deg": 40, "slope_steps": 7}

    found = ask(service_url, "mobility", 430, 30, 120, 4.0, **shape)

    for field in dataclasses.fields(MobilityMap):
        np.testing.assert_array_equal(getattr(found, field.name), getattr(champion_map, field.name))
    assert ask(service_url, "suggested_runs", name, version, 2) == twin.suggested_runs(name, version, 2)


BAD_MAPS: dict[str, dict[str, Any]] = {
    "mass_kg": {"mass_kg": -1},
    "torque_min_nm": {"torque_min_nm": float("nan")},
    "torque_max_nm": {"torque_max_nm": 20},
    "torque_steps": {"torque_steps": 1},
    "slope_min_deg": {"slope_min_deg": -90},
    "slope_max_deg": {"slope_max_deg": -1},
    "slope_steps": {"slope_steps": 10**9},
    "confidence": {"confidence": 1.0},
    "torques x slopes x horizon_s": {"torque_steps": 64, "slope_steps": 64, "horizon_s": 600},
}


@pytest.mark.parametrize(("field", "changes"), BAD_MAPS.items(), ids=BAD_MAPS)
def test_each_bad_map_comes_back_with_its_field_and_range(
    service_url: str, ask: Callable[..., Any], field: str, changes: dict[str, Any]
) -> None:
    asked = {"mass_kg": 430, "torque_min_nm": 30, "torque_max_nm": 120} | changes

    with pytest.raises(InvalidInputError) as caught:
        ask(service_url, "mobility", **asked)

    assert [fault.field for fault in caught.value.faults] == [field]
    assert all(fault.allowed for fault in caught.value.faults)


def test_suggestions_that_cannot_be_made_are_refused(service_url: str, ask: Callable[..., Any]) -> None:
    for question, field in ((("viper-lunar", 2, 65), "n"), (("viper-lunar", 1), "version")):
        with pytest.raises(InvalidInputError) as caught:
            ask(service_url, "suggested_runs", *question)
        assert [fault.field for fault in caught.value.faults] == [field]


def test_outside_the_domain_is_a_verdict_and_an_error_when_strict(twin: RoverTwin) -> None:
    verdict = twin.predict(45, 9000, 10)

    assert not verdict.domain.inside
    assert verdict.domain.reasons
    with pytest.raises(OutsideDomainError):
        twin.predict(45, 9000, 10, strict=True)


def test_what_is_not_there_is_named(twin: RoverTwin) -> None:
    cases = [
        ("model-not-found", lambda: twin.predict(28, 430, 60, model="nobody")),
        ("model-not-found", lambda: twin.mobility(430, 30, model="nobody")),
        ("version-not-found", lambda: twin.manifest("viper-lunar", 9999)),
        ("version-not-found", lambda: twin.suggested_runs("viper-lunar", 9999)),
        ("alias-not-found", lambda: twin.predict(28, 430, 60, model="viper-lunar@nobody")),
    ]
    for slug, ask in cases:
        with pytest.raises(NotFoundError) as caught:
            ask()
        assert caught.value.problem is not None
        assert caught.value.problem.slug == slug


def test_no_time_at_all_is_a_time_out(service_url: str) -> None:
    with RoverTwin(service_url, timeout=1e-4) as twin, pytest.raises(TimedOutError):
        twin.predict(28, 430, 60, 600, dt_s=0.01)


def test_another_port_is_a_connection_error() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    with RoverTwin(f"http://127.0.0.1:{port}", retries=0) as twin, pytest.raises(ConnectionFailedError):
        twin.ready()


def test_the_shell_script_and_the_python_client_agree(service_url: str, twin: RoverTwin) -> None:
    script = REPOSITORY / "clients" / "curl" / "predict.sh"
    done = subprocess.run(
        ["sh", str(script), "--csv", "28", "430", "60", "10"],
        env=os.environ | {"ROVER_TWIN_URL": service_url},
        capture_output=True,
        text=True,
        check=True,
    )
    header, *rows = done.stdout.splitlines()
    prediction = twin.predict(28, 430, 60, 10)

    assert header == "time_s,x_m,y_m"
    assert prediction.y_m is not None
    expected = np.column_stack([prediction.time_s, prediction.x_m, prediction.y_m])
    np.testing.assert_allclose([[float(cell) for cell in row.split(",")] for row in rows], expected, atol=1e-9)


def test_the_shell_script_says_the_services_reason(service_url: str) -> None:
    done = subprocess.run(
        ["sh", str(REPOSITORY / "clients" / "curl" / "predict.sh"), "28", "-1", "60"],
        env=os.environ | {"ROVER_TWIN_URL": service_url},
        capture_output=True,
        text=True,
        check=False,
    )

    assert done.returncode == 1
    assert len(done.stderr.splitlines()) == 1
    assert "mass_kg" in done.stderr


def test_the_examples_of_the_clients_readme_and_docstring_run(service_url: str, tmp_path: Path) -> None:
    text = (REPOSITORY / "clients" / "python" / "README.md").read_text(encoding="utf-8")
    examples = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    examples = [example for example in examples if "TOKEN" not in example]  # test_training runs the operator's
    examples.append("\n".join(re.findall(r"^    (.+)", rover_twin_client.__doc__ or "", flags=re.MULTILINE)))
    outputs = [
        subprocess.run(
            [sys.executable, "-W", "error", "-c", example.replace("http://127.0.0.1:8000", service_url)],
            cwd=tmp_path,
            env=os.environ | {"MPLBACKEND": "agg"},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for example in examples
    ]

    prediction, tables, batch, gathered, driving, mobility, suggestions, faults, shortest = outputs
    assert "rover.usda" in tables
    assert {path.name for path in tmp_path.iterdir()} == {"prediction.png", "rover.usda"}
    assert re.match(r"\(2000, 21\) \d+ climb, \d+ are refused\nscenarios\[\d+\].slope_deg is 45", batch)
    assert re.search(r"^\d+ climb$", gathered)
    assert re.search(r"viper-lunar@\d+ (climbs|stalls|slides)", prediction)
    assert re.search(r"^passes \S+ \S+$", driving, flags=re.MULTILINE)
    assert re.search(r"^120 N m: up to \d+\.\d deg, by band$", mobility, flags=re.MULTILINE)
    assert re.search(r"^\d+ of 84 cells climb", mobility, flags=re.MULTILINE)
    assert suggestions.count("runs/viper_") == 3
    assert "mass_kg" in faults
    assert re.fullmatch(r"(climbs|stalls|slides) \S+\n", shortest)
