"""Questions made from the published contract itself: no 500, and every answer is one that the contract announces."""

from __future__ import annotations

import pytest
import schemathesis
from hypothesis import HealthCheck, settings
from schemathesis.checks import not_a_server_error
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    negative_data_rejection,
    response_headers_conformance,
    response_schema_conformance,
    status_code_conformance,
    unsupported_method,
)

from service.app import openapi_document

# Arrow tables are no questions that it could make: tests/api/v1/test_steps.py does
pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore:Skipped test cases with unsupported payload media types"),
]


def refused_where_wrong(ctx, response, case):
    """As the check of that name, which does not know that a head may be too large to look at the rest."""
    return None if response.status_code == 431 else negative_data_rejection(ctx, response, case)


CHECKS = [
    not_a_server_error,
    status_code_conformance,
    content_type_conformance,
    response_headers_conformance,
    response_schema_conformance,
    refused_where_wrong,
    unsupported_method,
]


# without a token the gate answers before the route does; test_schemathesis_admin.py asks with one
SCHEMA = schemathesis.openapi.from_dict(openapi_document())
schema = SCHEMA.exclude(path_regex="^/v1/admin")


@schema.parametrize()
@settings(max_examples=40, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
def test_the_service_keeps_its_contract(case, service, session):
    # a batch answers 200 where some of its scenarios are wrong, and lists these in `errors`; so do steps of rovers
    batch = case.path.endswith(("/batch", "/steps"))
    checks = [each for each in CHECKS if not batch or each is not refused_where_wrong]
    case.call_and_validate(base_url=service.url, session=session, checks=checks)
