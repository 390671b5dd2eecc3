"""The service without PyTorch, SciPy and Matplotlib, as in the serving image: it serves, and says what it cannot do."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from model_store import ModelStore
from service.settings import Settings
from tests.api.chrono_uploads import archive
from tests.api.conftest import ADMIN, QUESTION, TOKEN, process_serving

pytestmark = pytest.mark.processes

WITHOUT = ("torch", "scipy", "matplotlib")
# what every process of Python imports first, those that the service starts as well
BLOCKING = f"""
import sys
class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {WITHOUT!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, Absent())
"""
PROBLEM = "urn:rover-twin:problem:not-installed"
DRIVE = {
    "mass_kg": 430,
    "track": {"distance_m": [0, 4], "slope_deg": [10, 20]},
    "controls": {"time_s": [0], "torque_nm": [100]},
    "horizon_s": 5,
}
ROVER = {"id": "one", "start": {"mass_kg": 430}, "slope_deg": 10, "torque_nm": 60, "dt_s": 0.1}
MAP = {"mass_kg": 430, "torque_min_nm": 30, "torque_max_nm": 120, "torque_steps": 2, "slope_min_deg": 10}
MAP |= {"slope_max_deg": 30, "slope_steps": 3, "horizon_s": 4}
TENSORS = [{"name": name, "shape": [1], "datatype": "FP64", "data": [value]} for name, value in QUESTION.items()]


@pytest.fixture(scope="module")
def without(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder for PYTHONPATH: processes with it find none of the libraries."""
    folder = tmp_path_factory.mktemp("without")
    (folder / "sitecustomize.py").write_text(BLOCKING)
    return folder


@pytest.fixture(scope="module")
def environment(without: Path) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", f"{without}{os.pathsep}{os.environ.get('PYTHONPATH', '')}")
        yield


@pytest.fixture(scope="module")
def client(environment: None, processes: None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[httpx.Client]:
    """A service over a copy of the shipped store, its admin endpoints on."""
    folder = tmp_path_factory.mktemp("shipped") / "store"
    for part in ("models", "datasets"):
        shutil.copytree(Path(Settings().store_url) / part, folder / part)
    with process_serving(ModelStore.open(str(folder)), admin_token=TOKEN) as (client, process):
        client.headers.update(ADMIN)
        yield client
        process.terminate()
        assert "no worker is started" in process.communicate(timeout=30)[1]


def refused(answer: httpx.Response, *libraries: str) -> bool:
    problem = answer.json()
    told = all(each in problem["detail"] for each in (*libraries, "the whole image"))
    return answer.status_code == 501 and problem["type"] == PROBLEM and told


@pytest.mark.parametrize("form", ["json", "csv", "npz", "arrow", "parquet", "usda"])
def test_predictions_in_every_form_but_pictures(client: httpx.Client, form: str) -> None:
    assert (
        client.get("/v1/predictions", params={**QUESTION, "include": "band,speed", "format": form}).status_code == 200
    )


@pytest.mark.parametrize("form", ["svg", "png", "html"])
def test_a_picture_is_refused_by_what_is_missing(client: httpx.Client, form: str) -> None:
    assert refused(client.get("/v1/predictions", params={**QUESTION, "format": form}), "Matplotlib")


def test_a_browser_gets_the_numbers_where_there_is_no_page_for_it(client: httpx.Client) -> None:
    accept = {"accept": "text/html,application/xhtml+xml,application/xml;q=0.9,*/*;q=0.8"}
    version = "/v1/models/viper-lunar/versions/5"
    answers = [
        client.get("/v1/predictions", params=QUESTION, headers=accept),
        client.get("/v1/mobility", params=MAP, headers=accept),
        client.get(f"{version}/card", headers=accept),
        client.get(f"{version}/comparison", params={"against": "viper-lunar@1"}, headers=accept),
    ]

    assert [each.headers["content-type"] for each in answers] == ["application/json"] * 4
    assert refused(client.get(f"{version}/card", params={"format": "html"}), "Matplotlib")


def test_the_rest_that_serving_is(client: httpx.Client) -> None:
    version = "/v1/models/viper-lunar/versions/5"
    answers = [
        client.post("/v1/predictions/batch", json={"scenarios": [QUESTION]}),
        client.get("/v1/mobility", params=MAP),
        client.get(f"{version}/suggested-runs", params={"n": 2}),
        client.get(f"{version}/fmu"),
        client.post("/v1/drives", json=DRIVE),
        client.post("/v1/drives/batch", json={"drives": [DRIVE]}),
        client.post("/v1/steps", json={"rovers": [ROVER]}),
        client.post("/v2/models/viper-lunar/infer", json={"inputs": TENSORS}),
        client.post("/v2/repository/index"),
        client.get("/metrics"),
        client.get("/docs"),
    ]

    assert [each.status_code for each in answers] == [200] * len(answers), [each.text[:300] for each in answers]


def test_a_network_answers_without_what_trained_it(client: httpx.Client) -> None:
    paper = "viper-lunar-paper"

    answers = [
        client.get("/v1/predictions", params={**QUESTION, "model": paper, "include": "speed,prior"}),
        client.post(f"/v2/models/{paper}/infer", json={"inputs": TENSORS}),
        client.post(f"/v2/repository/models/{paper}/load"),
        client.get("/v1/models/viper-lunar/versions/5/comparison", params={"against": f"{paper}@1"}),
    ]

    assert [each.status_code for each in answers] == [200] * 4, [each.text[:300] for each in answers]
    assert answers[-1].json()["curves_missing"] is None


def test_datasets_are_taken_in_and_jobs_queued_for_a_worker_elsewhere(client: httpx.Client) -> None:
    files = {"file": ("my runs.zip", archive())}
    checked = client.post("/v1/admin/datasets", params={"dry_run": "true"}, files=files, data={"name": "mine"})
    stored = client.post("/v1/admin/datasets", files=files, data={"name": "mine"})
    job = client.post(
        "/v1/admin/training-jobs", json={"model": "mine", "datasets": ["paper"], "architecture": "drive_model"}
    )

    assert [checked.status_code, stored.status_code] == [200, 201]
    assert client.get("/v1/admin/datasets/mine/download").status_code == 200
    assert refused(client.get("/v1/admin/datasets/mine/preview"), "Matplotlib")
    assert job.status_code == 202, job.text
    assert client.get(job.headers["Location"]).json()["state"] == "queued"


def cli(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "service", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)


def test_the_command_line_predicts_and_names_what_is_missing_for_the_rest(environment: None) -> None:
    asked = ["predict", "--slope-deg", "28", "--mass-kg", "430", "--torque-nm", "60"]

    assert cli(*asked).returncode == 0
    assert cli(*asked, "--model", "viper-lunar-paper").returncode == 0
    for refusal in (
        cli("worker"),
        cli("train", "--dataset", "paper", "--model", "x"),
    ):
        assert refusal.returncode == 1
        assert "PyTorch" in refusal.stderr
        assert len(refusal.stderr.splitlines()) == 1
