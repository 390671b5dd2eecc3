"""Damaged, foreign or missing versions: a clear problem for them, answers from the others, healing without restart."""

from __future__ import annotations

import json
import time
from pathlib import Path

import pytest

from tests.api.conftest import ADMIN, TOKEN

ASKED = {"admin_token": TOKEN, "start_worker": False, "refresh_s": 0.1}


def version_folder(store, version):
    return Path(store.location) / "models" / "viper-lunar" / "versions" / str(version)


def truncate_weights(folder):
    weights = folder / "weights.safetensors"
    weights.write_bytes(weights.read_bytes()[:-7])


def alter_weights(folder):
    weights = folder / "weights.safetensors"
    data = bytearray(weights.read_bytes())
    data[-1] ^= 1
    weights.write_bytes(data)


def remove_weights(folder):
    (folder / "weights.safetensors").unlink()


def edit_manifest(**changes):
    def edit(folder):
        path = folder / "manifest.json"
        path.write_text(json.dumps(json.loads(path.read_text()) | changes))

    return edit


def cut_manifest(folder):
    path = folder / "manifest.json"
    path.write_bytes(path.read_bytes()[:100])


DAMAGES = {
    "truncated weights": (truncate_weights, "artefact-corrupt", "truncated"),
    "wrong digest": (alter_weights, "artefact-corrupt", "sha256"),
    "no weights": (remove_weights, "artefact-corrupt", "gone"),
    "newer major": (edit_manifest(format_version="2.0"), "unsupported-format", "upgrade the service"),
    "cut manifest": (cut_manifest, "artefact-corrupt", "not JSON"),
    "unknown architecture": (
        edit_manifest(checkpoint={"architecture": {"name": "os.system"}}),
        "artefact-corrupt",
        "2:",
    ),
    "no domain": (edit_manifest(domain={}), "artefact-corrupt", "slope_deg"),
}


def eventually(look, within_s=30.0):
    end = time.monotonic() + within_s
    while not (found := look()):
        assert time.monotonic() < end, "did not happen in time"
        time.sleep(0.05)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("name", DAMAGES)
def test_a_damaged_version_is_a_problem_of_its_own(serve, store, publish, move, name):
    damage, slug, word = DAMAGES[name]
    move(store, publish(store, architecture="paper_network"))
    damage(version_folder(store, publish(store, architecture="paper_network")))
    service = serve()
    service.wait_ready()

    refused = service.predict(model="viper-lunar@2")

    assert refused.status_code == 503
    assert refused.json()["type"] == f"urn:rover-twin:problem:{slug}"
    assert word in refused.json()["detail"]
    assert service.predict().json()["model"]["version"] == 1
    assert service.get("/health/ready").status_code == 200


@pytest.mark.slow
@pytest.mark.parametrize("name", ["truncated weights", "newer major"])
def test_a_champion_that_turns_out_damaged_leaves_the_old_one_serving(serve, store, publish, move, name):
    damage, _, word = DAMAGES[name]
    move(store, publish(store))
    service = serve(**ASKED)
    service.wait_ready()
    service.client.headers.update(ADMIN)
    version = publish(store)
    damage(version_folder(store, version))
    move(store, version)

    failures = eventually(lambda: service.get("/health/ready").json()["failures"])

    assert failures[0]["reference"] == "viper-lunar@champion"
    assert word in failures[0]["message"]
    assert service.predict().json()["model"]["version"] == 1
    move(store, 1)
    eventually(lambda: service.get("/health/ready").json()["failures"] == [])


@pytest.mark.slow
def test_an_empty_store_is_alive_not_ready_and_heals(serve, store, publish, move):
    service = serve(**ASKED)

    assert service.get("/health/live").json() == {"status": "alive"}
    stranger = service.get("/health/ready")
    service.client.headers.update(ADMIN)
    refused = service.get("/health/ready")
    assert stranger.status_code == refused.status_code == 503
    assert "publish" not in stranger.text
    assert refused.json()["type"] == "urn:rover-twin:problem:not-ready"
    assert "publish a version first" in refused.json()["detail"]
    assert service.predict().json()["type"] == "urn:rover-twin:problem:model-not-found"

    version = publish(store)
    assert "no alias" in service.get("/health/ready").json()["detail"]
    move(store, version)
    service.wait_ready()
    assert service.predict().status_code == 200


@pytest.mark.slow
def test_a_broken_default_is_alive_not_ready_and_heals(serve, store, publish, move):
    move(store, publish(store))
    truncate_weights(version_folder(store, 1))
    service = serve(**ASKED)

    assert service.get("/health/live").status_code == 200
    assert "truncated" not in service.get("/health/ready").text + service.get("/v2/health/ready").text
    service.client.headers.update(ADMIN)
    assert "truncated" in service.get("/v2/health/ready").json()["error"]
    assert "truncated" in service.get("/health/ready").json()["detail"]
    assert service.predict().json()["type"] == "urn:rover-twin:problem:artefact-corrupt"

    move(store, publish(store))
    assert service.wait_ready().json()["model"]["version"] == 2


@pytest.mark.slow
def test_an_alias_to_nothing_is_told_and_does_not_hide_other_models(serve, store, publish, move):
    move(store, publish(store))
    move(store, publish(store, name="other"), name="other")
    (version_folder(store, 1) / "manifest.json").unlink()
    service = serve(default_model="other")
    service.wait_ready()

    refused = service.predict(model="viper-lunar@champion")

    assert refused.status_code == 404
    assert service.predict().json()["model"]["name"] == "other"
    assert service.get("/v1/models").json()["models"][0]["name"] == "other"


@pytest.mark.slow
def test_a_damaged_alias_record_is_told(serve, store, publish, move):
    move(store, publish(store))
    record = version_folder(store, 1).parents[1] / "aliases" / "champion" / "00000001.json"
    record.write_text("{")
    service = serve()

    assert service.predict().json()["type"] == "urn:rover-twin:problem:artefact-corrupt"
    assert service.predict(model="viper-lunar@1").status_code == 200
    assert service.get("/v1/models/viper-lunar/aliases/champion").status_code == 503
    (listed,) = service.get("/v1/models").json()["models"]
    assert (listed["versions"], listed["aliases"]) == ([1], {})
    assert "00000001.json" in listed["unreadable"]


@pytest.mark.slow
def test_an_answer_that_is_not_finite_is_never_sent(serve, store, publish, move):
    move(store, publish(store))
    publish(store, architecture="paper_network", scale=1e30)
    service = serve()
    service.wait_ready()

    refused = service.predict(model="viper-lunar@2")

    assert refused.status_code == 500
    assert refused.json()["type"] == "urn:rover-twin:problem:internal"
    assert "Traceback" not in refused.text
    assert "viper" not in refused.text  # what happened is in the log, under the request's id
    assert refused.headers["x-request-id"]
    assert service.predict().status_code == 200


@pytest.mark.slow
def test_a_store_that_vanishes_leaves_what_is_loaded(serve, store, publish, move):
    move(store, publish(store))
    service = serve(refresh_s=0.1)
    service.wait_ready()
    models = Path(store.location) / "models"
    models.rename(models.with_name("elsewhere"))
    models.write_text("no folder")
    time.sleep(0.5)

    assert service.predict().status_code == 200
    assert service.get("/health/ready").status_code == 200
    listed = service.get("/v1/models")
    assert listed.status_code in (200, 503)
    assert store.location not in listed.text
