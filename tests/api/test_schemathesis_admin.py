"""The same questions for those who have the token: datasets and aliases keep the published contract too."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, settings

from tests.api.chrono_uploads import archive
from tests.api.conftest import ADMIN, move_alias, publish_version
from tests.api.test_schemathesis import CHECKS, SCHEMA

pytestmark = pytest.mark.processes

WRITTEN = r"^/v1/(admin/(datasets|models)|models/\{name\}/(aliases/\{alias\}(/rollback)?$|versions/\{version\}/state))"
schema = SCHEMA.include(path_regex=WRITTEN)


@pytest.fixture(scope="module")
def filled(service_with_token):
    """A service with something to find: a dataset, and an alias with a history."""
    for version in (publish_version(service_with_token.store), publish_version(service_with_token.store)):
        move_alias(service_with_token.store, version)
    answer = service_with_token.client.post("/v1/admin/datasets?name=stored", content=archive())
    assert answer.status_code == 201
    return service_with_token


@schema.parametrize()
@settings(max_examples=10, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
def test_the_admin_side_keeps_its_contract(case, filled, session):
    case.call_and_validate(base_url=filled.url, session=session, checks=CHECKS, headers=ADMIN)
