"""The worker beside the service: there, there again after a kill, and gone with the service."""

from __future__ import annotations

import os
import signal

import anyio
import pytest

from service.jobs.supervisor import WorkerSupervisor
from service.settings import Settings

pytestmark = [pytest.mark.anyio, pytest.mark.processes]


@pytest.fixture
def anyio_backend():
    return "asyncio"


@pytest.fixture
def settings(tmp_path):
    return Settings(
        store_url=str(tmp_path / "store"),
        jobs_database_url=f"sqlite:///{tmp_path / 'jobs.sqlite'}",
        admin_token="0123456789abcdef",
        log_level="warning",
    )


def lives(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


async def until(condition):
    with anyio.fail_after(240):
        while not condition():
            await anyio.sleep(0.05)


@pytest.mark.kills
async def test_a_killed_worker_is_started_again_and_the_last_one_ends_with_the_service(settings, tmp_path):
    supervisor = WorkerSupervisor(settings, pauses_s=(0.1, 60.0))
    locks = tmp_path / "jobs.sqlite.workers"
    async with anyio.create_task_group() as tasks:
        tasks.start_soon(supervisor.run)
        await until(lambda: locks.is_dir() and any(locks.iterdir()))  # it has settings, store and database
        first = supervisor.pid
        assert os.getpriority(os.PRIO_PROCESS, first) == 10 + os.getpriority(os.PRIO_PROCESS, 0)
        os.kill(first, signal.SIGKILL)
        await until(lambda: supervisor.pid not in (first, None))
        second = supervisor.pid
        supervisor.end()
    assert supervisor.pid is None
    assert not lives(first)
    assert not lives(second)


async def test_one_that_cannot_work_is_tried_again(settings, tmp_path):
    (tmp_path / "jobs.sqlite").mkdir()
    supervisor = WorkerSupervisor(settings, pauses_s=(0.1, 60.0))
    seen = set()
    async with anyio.create_task_group() as tasks:
        tasks.start_soon(supervisor.run)
        await until(lambda: seen.add(supervisor.pid) or len(seen - {None}) == 2)
        supervisor.end()
    assert supervisor.pid is None
