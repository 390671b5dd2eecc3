"""A store to train in, a service over it with the admin endpoints on, and a real worker."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx

from model_store import DatasetDraft, ModelStore
from service.datasets import Dataset, dataset_id, parse_passport, to_parquet
from service.datasets.passport import PASSPORT_FILE
from service.datasets.summary import summarise
from service.training.stored_dataset import RUNS_FILE
from tests.api.conftest import Running, move_alias, publish_version, serving
from tests.training.stored import PASSPORT, stored_runs

ADDRESS = "/v1/admin/training-jobs"
TOKEN = "the-token-of-these-tests"
HEADERS = {"Authorization": f"Bearer {TOKEN}"}
ASKED = {
    "model": "rover",
    "datasets": ["unit"],
    "architecture": "paper_network",
    "split": {"test_fraction": 0.25},
    "budget": {"max_epochs": 3},
}


def job_store(folder: Path) -> Path:
    """A store with a champion to predict with, dataset `unit` and dataset `other-rover`."""
    store = ModelStore.open(str(folder / "store"), create=True)
    move_alias(store, publish_version(store))
    _put(store, "unit", 0.25)
    _put(store, "other-rover", 0.3)
    return folder / "store"


def damage(store: Path, name: str) -> None:
    """Add a dataset whose runs were cut off on disk; its record and passport are whole."""
    opened = ModelStore.open(str(store))
    _put(opened, name, 0.26)
    file = store / "datasets" / opened.dataset(name).id / RUNS_FILE
    file.write_bytes(file.read_bytes()[:1000])


def _put(store: ModelStore, name: str, wheel_radius_m: float) -> None:
    dataset = Dataset(name, parse_passport(PASSPORT % str(wheel_radius_m).encode()), tuple(stored_runs()))
    files = {RUNS_FILE: to_parquet(dataset), PASSPORT_FILE: dataset.passport.canonical_json().encode()}
    draft = DatasetDraft(name=name, created_by="tests", summary=summarise(dataset).as_json())
    store.put_dataset(dataset_id(dataset), files, draft)


@contextmanager
def admin_serving(store: Path, **settings: object) -> Iterator[Running]:
    """A service over the store whose client has the token. Nobody works unless `start_worker`."""
    chosen = {"admin_token": TOKEN, "start_worker": False, "max_queued_jobs": 1000} | settings
    with serving(store, **chosen) as running:
        running.client.headers.update(HEADERS)
        yield running


@contextmanager
def admin_client(store: Path, **settings: object) -> Iterator[httpx.Client]:
    """The client of such a service, ready to predict."""
    with admin_serving(store, **settings) as running:
        running.wait_ready()
        yield running.client


def submit(client: httpx.Client, key: str | None = None, **changes: object) -> dict:
    """Queue a job; the answer's JSON."""
    headers = {"Idempotency-Key": key} if key else {}
    answer = client.post(ADDRESS, json=ASKED | changes, headers=headers)
    assert answer.status_code == 202, answer.text
    return answer.json()


@contextmanager
def working(store: Path, **settings: object) -> Iterator[subprocess.Popen[str]]:
    """A worker in a process of its own, ended by SIGTERM."""
    chosen = {"store_url": store, "log_level": "warning"} | settings
    environment = os.environ | {f"ROVER_TWIN_{name.upper()}": str(value) for name, value in chosen.items()}
    command = [sys.executable, "-m", "service", "worker"]
    with subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.terminate()
            process.communicate(timeout=30)
