"""A store with one small dataset."""

from __future__ import annotations

from pathlib import Path

import pytest

from model_store import ModelStore
from tests.training.stored import put_dataset, stored_runs


@pytest.fixture
def store(tmp_path: Path) -> ModelStore:
    store = ModelStore.open(tmp_path / "store", create=True)
    put_dataset(store, "unit", stored_runs())
    return store
