"""Servers that do not answer: nobody takes that for an answer, and connecting goes on as soon as they do."""

from __future__ import annotations

import socket
import threading
from concurrent.futures import ThreadPoolExecutor

import pytest
import sqlalchemy as sa
from dbos._utils import retriable_postgres_exception

from service.jobs.database import make_engine, wait_for_server
from tests.fair_clock import fair_clock


@pytest.fixture
def nobody(tmp_path_factory):
    """The URL of a server that is not there: a socket that was left behind, as by one that was killed."""
    folder = tmp_path_factory.mktemp("s")
    with socket.socket(socket.AF_UNIX) as left:
        left.bind(str(folder / ".s.PGSQL.5432"))
    return f"postgresql://me@/jobs?host={folder}"


@pytest.fixture
def clock():
    with fair_clock() as clock:
        yield clock


@pytest.fixture
def engine(nobody):
    engine = make_engine(nobody, pool_size=1, patience_s=1)
    yield engine
    engine.dispose()


def test_dbos_takes_a_server_that_refuses_for_a_lost_connection(engine):
    with pytest.raises(sa.exc.OperationalError) as raised:
        engine.connect()
    assert "connection failed" not in str(raised.value.orig)  # which is all that dbos knows by itself
    assert raised.value.connection_invalidated
    assert retriable_postgres_exception(raised.value)


def test_one_that_is_told_to_end_connects_no_longer(engine):
    ending = threading.Event()
    wait_for_server(engine, ending)
    with ThreadPoolExecutor(1) as pool:
        connecting = pool.submit(engine.connect)
        with pytest.raises(TimeoutError):
            connecting.result(timeout=1.2)
        ending.set()
        assert isinstance(connecting.exception(timeout=5), sa.exc.OperationalError)


@pytest.mark.kills
def test_one_that_waits_for_a_server_has_it_within_seconds(postgres, clock):
    engine = make_engine(postgres.new_database(), pool_size=1, patience_s=1)
    wait_for_server(engine, threading.Event())
    with ThreadPoolExecutor(1) as pool:
        postgres.kill()
        connecting = pool.submit(engine.connect)
        with pytest.raises(TimeoutError):
            connecting.result(timeout=1)
        postgres.start()
        started = clock()
        with connecting.result(timeout=30) as connection:
            assert clock() - started < 3
            assert connection.scalar(sa.text("SELECT 1")) == 1
    engine.dispose()
