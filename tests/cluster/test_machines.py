"""Two APIs, two workers, a database and a bucket: they are one service, and any one of them may die at any time."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator

import pytest

from tests.api.chrono_uploads import archive
from tests.cluster.faults import PARTS, Row, cluster, follow, kill
from tests.cluster.load import ELSEWHERE
from tests.cluster.machines import APIS, DATASETS, JOBS, WORKERS, Machines, until

pytestmark = [
    pytest.mark.kills,
    pytest.mark.slow,
    pytest.mark.timeout(1500),  # workers are nice: beside other test runs they get little of the processor
    pytest.mark.skipif(importlib.util.find_spec("pgserver") is None, reason="pgserver is not installed"),
]

FOLLOWED_S = 30.0  # two seconds are promised; a busy machine may take longer


@pytest.fixture(scope="module")
def machines(processes: None) -> Iterator[Machines]:
    with cluster() as machines:
        yield machines


def test_what_one_replica_is_told_all_of_them_know(machines):
    """Upload to one API, train on a worker, promote on the other API, ask both; later they follow a move."""
    one, other = (machines.api(name) for name in APIS)
    sent = one.post(DATASETS, content=archive(seed=0.5), params={"name": "sent"})
    assert sent.status_code == 201, sent.text
    assert machines.answered(lambda: other.get(f"{DATASETS}/sent")).json()["id"] == sent.json()["id"]

    job = {"model": "walked", "datasets": ["unit"], "architecture": "zero", "prior": "rigid_slope"}
    job |= {"split": {"test_slopes_deg": [12]}}
    keys = {"Idempotency-Key": '"walk"'}
    started = machines.answered(lambda: one.post(JOBS, json=job, headers=keys))
    assert started.status_code == 202, started.text
    again = machines.answered(lambda: other.post(JOBS, json=job, headers=keys))
    assert again.json()["id"] == started.json()["id"]
    ended = machines.ended(started.json()["id"], 120)
    assert ended["state"] == "succeeded", ended
    version = ended["result"]["version"]
    assert machines.runner(ended["id"]) in WORKERS

    alias = "/v1/models/walked/aliases/champion"
    content = {"version": version, "reason": "by hand"}
    moved = other.put(alias, json=content, headers={"If-None-Match": "*"})
    assert moved.status_code == 201, moved.text
    for name in APIS:
        until(lambda name=name: machines.served(name, "walked@champion") == version, FOLLOWED_S, f"{name} follows")
    late = one.put(alias, json=content, headers={"If-None-Match": "*"})
    assert late.status_code == 412

    follow(machines)  # an alias that both have in memory


def test_each_part_is_killed_in_turn(machines):
    """In one test, since test processes beside each other would each start all machines."""
    for part in PARTS:
        row = kill(machines, part)  # that all is well again before a deadline is part of it
        assert row.lost == []
        assert row.job["state"] == "succeeded", row.job
        assert row.versions == [row.job["result"]["version"]]
        assert wrong_failures(row) == []


def wrong_failures(row: Row) -> list[str]:
    """Failures of what does not need the part that was dead."""
    needs = {"predictions": None, "list of jobs": "database", "list of models": "bucket"}
    wrong = []
    for (name, kind), lane in row.load.lanes.items():
        assert len(lane.asked) > 5
        failed = lane.failures()
        # a client that asks the other API when one does not answer has all its answers
        excused = kind != ELSEWHERE and (row.part == name or row.part == needs[kind])
        if failed and not excused:
            wrong.append(f"{row.part} was killed: {failed} of {len(lane.asked)} {kind} at {name} failed")
    return wrong
