"""The S3 server of the tests keeps the promises that the store needs, asked by the client that the store uses."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import obstore
import pytest
from obstore.exceptions import AlreadyExistsError, PreconditionError
from obstore.store import S3Store

from model_store.backend import Backend
from tests.s3 import S3Server

pytestmark = pytest.mark.processes


@pytest.fixture(scope="module")
def s3(tmp_path_factory):
    with S3Server.started(tmp_path_factory.mktemp("s3")) as server:
        yield server


@pytest.fixture
def backend(s3, monkeypatch, request):
    for name, value in s3.environment.items():
        monkeypatch.setenv(name, value)
    return Backend.open(s3.url(request.node.name.replace("_", "-")))


def test_of_many_who_create_one_key_one_wins(backend):
    with ThreadPoolExecutor(8) as pool:
        won = list(pool.map(lambda n: backend.create("models/one", b"%d" % n), range(40)))

    assert sum(won) == 1
    assert backend.read("models/one", limit_bytes=9) == b"%d" % won.index(True)


def test_a_write_over_an_older_state_is_refused(s3):
    store = S3Store("updates", endpoint=s3.endpoint, client_options={"allow_http": True}, region="us-east-1",
                    access_key_id="tests", secret_access_key="of-tests")  # fmt: skip
    first = obstore.put(store, "alias", b"1")
    assert first["e_tag"]

    obstore.put(store, "alias", b"2", mode={"e_tag": first["e_tag"]})

    with pytest.raises((PreconditionError, AlreadyExistsError)):
        obstore.put(store, "alias", b"3", mode={"e_tag": first["e_tag"]})
    assert bytes(obstore.get(store, "alias").bytes()) == b"2"


def test_listings_and_removals(backend):
    names = {f"versions/{n:04d}/manifest.json" for n in range(1100)}  # more than one page
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(lambda name: backend.create(f"models/a b/{name}", b"{}"), names))

    assert set(backend.keys("models/a b")) == names
    assert len(backend.folders("models/a b/versions")) == 1100
    assert backend.remove("models/a b/versions/0001/manifest.json")
    assert backend.read("models/a b/versions/0001/manifest.json", limit_bytes=9) is None


def test_what_was_acknowledged_survives_a_kill_and_requests_are_counted(s3, backend):
    before = s3.counts()
    assert backend.create("kept", b"x" * 100_000)
    assert s3.counts() - before == {"PUT": 1}

    s3.restart()

    assert backend.read("kept", limit_bytes=1 << 20) == b"x" * 100_000
    assert not backend.exists("models/nothing")
