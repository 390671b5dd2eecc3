"""Questions about training jobs made from the published contract, by somebody with the token."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, settings

from tests.api.test_schemathesis import CHECKS, SCHEMA
from tests.api.training import ADDRESS, HEADERS, admin_serving, job_store, submit

pytestmark = pytest.mark.slow

schema = SCHEMA.include(path_regex=f"^{ADDRESS}")


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    with admin_serving(job_store(tmp_path_factory.mktemp("store"))) as running:
        job = submit(running.client)
        running.client.post(job["links"]["cancel"])
        yield running.url


@schema.parametrize()
@settings(max_examples=15, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
def test_training_jobs_keep_their_contract(case, address, session):
    case.call_and_validate(base_url=address, session=session, headers=HEADERS, checks=CHECKS)
