"""Databases of jobs, workers to run them, and a store with one small dataset."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from model_store import ModelStore
from tests.databases import Postgres, start_postgres
from tests.jobs.nursery import Nursery
from tests.training.stored import put_dataset, stored_runs


@pytest.fixture
def store(tmp_path: Path) -> ModelStore:
    store = ModelStore.open(tmp_path / "store", create=True)
    put_dataset(store, "unit", stored_runs())
    return store


@pytest.fixture(scope="session")
def postgres(processes: None) -> Iterator[Postgres]:
    yield from start_postgres()


@pytest.fixture(params=["sqlite", pytest.param("postgresql", marks=pytest.mark.processes)])
def jobs_url(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """A fresh, empty database on each of the two engines."""
    if request.param == "sqlite":
        return f"sqlite:///{tmp_path / 'jobs' / 'jobs.sqlite'}"
    return request.getfixturevalue("postgres").new_database()


@pytest.fixture(scope="session")
def nursery(processes: None) -> Iterator[Nursery]:
    with Nursery() as nursery:
        yield nursery
