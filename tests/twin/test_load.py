"""A version into memory: each of its files is read once, the manifest too."""

from __future__ import annotations

from pathlib import Path

import pytest

import model_store
from model_store import WEIGHTS, Manifest, ModelStore
from service.errors import CheckpointError
from service.learning.band import BAND_FILE
from service.learning.checkpoint import describe_model
from service.training.evidence import read_evidence
from service.twin import TwinRegistry
from service.twin.load import load_twin
from tests.model_store.watched import watched
from tests.twin.published import draft, publish, publish_banded, zero_model

SHIPPED = Path(model_store.__file__).parent
SHIPPED_VERSIONS = ModelStore.open(SHIPPED).versions("viper-lunar")


def files_of_a_twin(manifest: Manifest) -> list[str]:
    folder = f"models/{manifest.name}/versions/{manifest.version}"
    files = ["manifest.json", "weights.safetensors", *([BAND_FILE] if manifest.band else [])]
    return sorted(f"{folder}/{file}" for file in files)


@pytest.mark.parametrize("version", SHIPPED_VERSIONS)
def test_a_load_reads_manifest_weights_and_band_once_each(version):
    store, read = watched(SHIPPED)
    twin = load_twin(store, "viper-lunar", version)
    assert sorted(read) == files_of_a_twin(twin.manifest)


@pytest.mark.parametrize("make", [publish, publish_banded])
def test_the_registry_reads_them_once_each_whatever_the_version_is_called(store, make):
    manifest = make(store)
    store.move_alias("unit", "champion", 1, actor="a test", reason="newest")
    watched_store, read = watched(store.location)
    registry = TwinRegistry(watched_store, "unit")
    for reference in (None, "unit", "unit@champion", "unit@1"):
        registry.get(reference)
    of_versions = sorted(key for key in read if "/aliases/" not in key and "/lifecycle/" not in key)
    assert of_versions == files_of_a_twin(manifest)


def test_evidence_is_read_with_the_manifest_in_hand():
    store, read = watched(SHIPPED)
    read_evidence(store, store.manifest("viper-lunar", SHIPPED_VERSIONS[-1]))
    assert sum(key.endswith("/manifest.json") for key in read) == 1
    assert len(set(read)) == len(read) == 2


def test_a_version_of_a_former_architecture_is_refused_by_name_with_what_to_do(store):
    described = describe_model(zero_model()) | {"architecture": {"name": "resistance_process", "arguments": {}}}
    store.publish("unit", {WEIGHTS: b"whatever"}, draft(zero_model()).model_copy(update={"checkpoint": described}))
    with pytest.raises(CheckpointError, match=r"^unit@1: this version is a resistance process.*train anew"):
        load_twin(store, "unit", 1)
