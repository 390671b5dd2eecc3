"""Two APIs, two workers, a database and a bucket: they are one service, and any one of them may die at any time."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator

import pytest

from tests.api.chrono_uploads import archive
from tests.api.conftest import publish_version
from tests.cluster.faults import PARTS, Row, cluster, kill
from tests.cluster.load import ELSEWHERE
from tests.cluster.machines import APIS, DATASETS, JOBS, QUESTION, WORKERS, Machines, until

pytestmark = [
    pytest.mark.kills,
    pytest.mark.slow,
    pytest.mark.skipif(importlib.util.find_spec("pgserver") is None, reason="pgserver is not installed"),
]

FOLLOWED_S = 30.0  # two seconds are promised; a busy machine may take longer


@pytest.fixture(scope="module")
def machines(processes: None) -> Iterator[Machines]:
    with cluster() as machines:
        yield machines


def served(machines: Machines, name: str, reference: str) -> int | None:
    """The version with which an API answers."""
    answer = machines.api(name).get("/v1/predictions", params=QUESTION | {"model": reference})
    return answer.json()["model"]["version"] if answer.is_success else None


def test_what_one_replica_is_told_all_of_them_know(machines):
    """Upload to one API, train on a worker, promote on the other API, ask both."""
    one, other = (machines.api(name) for name in APIS)
    sent = one.post(DATASETS, content=archive(seed=0.5), params={"name": "sent"})
    assert sent.status_code == 201, sent.text
    assert other.get(f"{DATASETS}/sent").json()["id"] == sent.json()["id"]

    job = {"model": "walked", "datasets": ["unit"], "architecture": "zero", "prior": "rigid_slope"}
    job |= {"split": {"test_slopes_deg": [12]}}
    keys = {"Idempotency-Key": '"walk"'}
    started = one.post(JOBS, json=job, headers=keys)
    assert started.status_code == 202, started.text
    again = other.post(JOBS, json=job, headers=keys)
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
        until(lambda name=name: served(machines, name, "walked@champion") == version, FOLLOWED_S, f"{name} follows")
    late = one.put(alias, json=content, headers={"If-None-Match": "*"})
    assert late.status_code == 412


def test_a_followed_alias_moves_on_both_replicas(machines):
    """Both have it in memory before it moves, so each has to notice by itself."""
    version = publish_version(machines.store, coefficient=0.2)
    assert {served(machines, name, "viper-lunar@champion") for name in APIS} == {1}
    champion = "/v1/models/viper-lunar/aliases/champion"
    tag = machines.api("api-a").get(champion).headers["ETag"]
    content = {"version": version, "reason": "the next one"}
    moved = machines.api("api-b").put(champion, json=content, headers={"If-Match": tag})
    assert moved.status_code == 200, moved.text
    for name in APIS:
        until(lambda name=name: served(machines, name, "viper-lunar@champion") == version, FOLLOWED_S, name)


@pytest.fixture(scope="module", params=PARTS)
def row(request: pytest.FixtureRequest, machines: Machines) -> Row:
    """What the kill of a part did; that everything is well again before a deadline is part of it."""
    return kill(machines, request.param)


def test_whatever_dies_the_job_makes_one_version_and_nothing_acknowledged_is_lost(row):
    assert row.lost == []
    assert row.job["state"] == "succeeded", row.job
    assert row.versions == [row.job["result"]["version"]]


def test_predictions_fail_only_on_the_replica_that_is_dead(row):
    for name in APIS:
        failures = [lane.failures() for lane in row.load.of("predictions", name)]
        assert name == row.part or failures == [0]
    assert row.failures(ELSEWHERE)[0] == 0  # a client that then asks the other one has all its answers
    assert row.failures(ELSEWHERE)[1] > 10


def test_lists_fail_only_with_what_they_are_read_from(row):
    own = {"database": "list of jobs", "bucket": "list of models"}
    for kind in own.values():
        for name in APIS:
            failures = sum(lane.failures() for lane in row.load.of(kind, name))
            assert failures == 0 or name == row.part or own.get(row.part) == kind
