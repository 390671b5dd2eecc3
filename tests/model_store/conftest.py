"""Small real artefacts, and a store on a directory that tests may damage by hand."""

from __future__ import annotations

import pytest

from model_store import Lineage, ManifestDraft, ModelStore


@pytest.fixture
def draft():
    return ManifestDraft(
        created_by="tests",
        description="a small real manifest",
        checkpoint={"architecture": "mlp", "arguments": {"widths": [30, 2]}},
        domain={"slope_deg": [20.0, 32.0]},
        metrics={"final_position_error_m": 0.05},
        lineage=Lineage(datasets=["ab" * 32], seed=7, libraries={"torch": "2.10"}, command="rover-twin train"),
    )


@pytest.fixture
def files():
    return {"weights.safetensors": b"weights" * 1000, "report/loss.svg": b"<svg/>"}


@pytest.fixture
def directory(tmp_path):
    return tmp_path / "store"


@pytest.fixture
def store(directory):
    return ModelStore.open(str(directory), create=True)
