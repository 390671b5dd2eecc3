"""A disk without room: an upload is answered 507 wherever the room runs out, and nothing of it is left."""

from __future__ import annotations

import gzip
import os
from contextlib import contextmanager

import numpy as np
import pytest

from model_store import ModelStore
from tests.api.chrono_uploads import archive
from tests.api.conftest import move_alias as move
from tests.api.conftest import process_serving, publish_version
from tests.api.training import HEADERS, TOKEN
from tests.small_disk import fill, small_disk

pytestmark = pytest.mark.processes

DATASETS = "/v1/admin/datasets"


@contextmanager
def service(store, tmp_path, **environment):
    with pytest.MonkeyPatch.context() as patch:
        for name, value in environment.items():
            patch.setenv(name, str(value))
        url = f"sqlite:///{tmp_path / 'jobs' / 'jobs.sqlite'}"
        with process_serving(
            store, admin_token=TOKEN, start_worker="false", jobs_database_url=url, default_model="viper-lunar"
        ) as (client, _):
            client.headers.update(HEADERS)
            yield client


def files_of(folder):
    return sorted(path.name for path in folder.rglob("*") if path.is_file())


def test_no_room_for_the_body_of_an_upload(tmp_path):
    store = ModelStore.open(str(tmp_path / "store"), create=True)
    move(store, publish_version(store))
    with small_disk(tmp_path / "temporary", "1m") as temporary, service(store, tmp_path, TMPDIR=temporary) as client:
        answer = client.post(DATASETS, content=os.urandom(3 << 20))

        assert answer.status_code == 507, answer.text
        assert answer.json()["type"] == "urn:rover-twin:problem:storage-full"
        assert str(temporary) not in answer.text
        assert files_of(temporary) == []
        assert client.post(DATASETS, content=archive()).status_code == 201


def test_no_room_to_unpack_it(tmp_path):
    store = ModelStore.open(str(tmp_path / "store"), create=True)
    move(store, publish_version(store))
    with small_disk(tmp_path / "temporary", "600k") as temporary, service(store, tmp_path, TMPDIR=temporary) as client:
        packed = gzip.compress(np.arange(1 << 20, dtype=np.uint8).tobytes() * 2)
        assert client.post(DATASETS, content=packed).status_code == 507
        assert files_of(temporary) == []


def test_no_room_in_the_store(tmp_path):
    with small_disk(tmp_path / "store", "8m") as folder:
        store = ModelStore.open(str(folder), create=True)
        move(store, publish_version(store))
        with service(store, tmp_path) as client:
            filler = fill(folder)
            before = files_of(folder)

            for _ in range(2):
                assert client.post(DATASETS, content=archive()).status_code == 507
            assert [name for name in files_of(folder) if name not in before] == []
            assert client.get(DATASETS).json()["datasets"] == []

            filler.unlink()
            assert client.post(DATASETS, content=archive()).status_code == 201
