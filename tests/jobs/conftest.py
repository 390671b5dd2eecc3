"""A small dataset in a real store: synthetic runs, only for tests."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from model_store import DatasetDraft, ModelStore
from service.datasets import Dataset, Run, dataset_id, parse_passport, to_parquet
from service.datasets.summary import summarise
from service.jobs.dataset_import import PASSPORT_FILE, RUNS_FILE
from tests.databases import Postgres, start_postgres
from tests.jobs.nursery import Nursery
from tests.learning.synthetic import HORIZON_S, synthetic_runs

PASSPORT = b"""{"format": "rover-twin-passport/1", "gravity_m_s2": 1.62, "frame": "slope frame",
"reference_body": "rear left wheel", "rover": {"wheel_radius_m": %s}}"""


def put_dataset(store: ModelStore, name: str, runs: list[Run], wheel_radius_m: float = 0.25) -> str:
    dataset = Dataset(name, parse_passport(PASSPORT % str(wheel_radius_m).encode()), tuple(runs))
    identity = dataset_id(dataset)
    files = {RUNS_FILE: to_parquet(dataset), PASSPORT_FILE: dataset.passport.canonical_json().encode()}
    draft = DatasetDraft(name=name, created_by="a test", summary=summarise(dataset).as_json())
    return store.put_dataset(identity, files, draft).id


def stored_runs() -> list[Run]:
    return [
        Run(
            name=run.name,
            set_name="unit",
            slope_deg=run.slope_deg,
            mass_kg=run.mass_kg,
            torque_nm=run.torque_nm,
            horizon_s=HORIZON_S,
            columns={"time_s": run.time_s, "rear_x_m": run.x_m, "rear_y_m": run.y_m},
        )
        for run in synthetic_runs()
    ]


@pytest.fixture
def store(tmp_path: Path) -> ModelStore:
    store = ModelStore.open(tmp_path / "store", create=True)
    put_dataset(store, "unit", stored_runs())
    return store


@pytest.fixture(scope="session")
def postgres() -> Iterator[Postgres]:
    yield from start_postgres()


@pytest.fixture(params=["sqlite", "postgresql"])
def jobs_url(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """A fresh, empty database on each of the two engines."""
    if request.param == "sqlite":
        return f"sqlite:///{tmp_path / 'jobs' / 'jobs.sqlite'}"
    return request.getfixturevalue("postgres").new_database()


@pytest.fixture(scope="session")
def nursery() -> Iterator[Nursery]:
    with Nursery() as nursery:
        yield nursery
