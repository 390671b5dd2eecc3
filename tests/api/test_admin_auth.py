"""Who gets in: only the token does, it is asked for before anything else, and nothing is told without it."""

from __future__ import annotations

import re
from dataclasses import replace

import httpx
import pytest

from tests.api.conftest import ADMIN, PLAIN, TOKEN
from tests.api.http.test_body_limit import exchange

ROUTES = [
    ("GET", "/v1/admin/datasets"),
    ("POST", "/v1/admin/datasets"),
    ("GET", "/v1/admin/datasets/abcdef"),
    ("GET", "/v1/admin/datasets/abcdef/preview"),
    ("GET", "/v1/admin/datasets/abcdef/download"),
    ("DELETE", "/v1/admin/datasets/abcdef"),
    ("PUT", "/v1/models/viper-lunar/aliases/champion"),
    ("POST", "/v1/models/viper-lunar/aliases/champion/rollback"),
    ("GET", "/v1/admin/audit"),
]
OF_THE_PROTOCOL = [(f"/v2/repository/models/viper-lunar/{verb}") for verb in ("load", "unload")]
UNDER_ADMIN = [
    *((method, "/v1/admin/datasets") for method in ("HEAD", "OPTIONS", "PATCH", "TRACE")),
    ("GET", "/v1/admin"),
    ("GET", "/v1/admin/"),
    ("GET", "/v1/admin/no-such-thing"),
    ("OPTIONS", "/v1/admin/no-such-thing"),
]
WRONG = {
    "none": {},
    "another": {"Authorization": "Bearer another token, long enough"},
    "a start of it": {"Authorization": "Bearer a token of tests, long enoug"},
    "longer": {"Authorization": "Bearer a token of tests, long enough!"},
    "empty": {"Authorization": "Bearer"},
    "no scheme": {"Authorization": "a token of tests, long enough"},
    "basic": {"Authorization": "Basic YWRtaW46YSB0b2tlbiBvZiB0ZXN0cw=="},
    "not ascii": {
        "Authorization": "Bearer \u00e4\u00f6\u00fc\u00e4\u00f6\u00fc\u00e4\u00f6\u00fc\u00e4\u00f6\u00fc".encode(
            "latin-1"
        )
    },
    "another header": {"X-Admin-Token": "a token of tests, long enough"},
}


@pytest.fixture
def admin(service_with_token):
    """The service of this module; each test has a client of its own, which sends the token until it is told not to."""
    with httpx.Client(base_url=service_with_token.url, headers=ADMIN, timeout=30, **PLAIN) as client:
        yield replace(service_with_token, client=client)


@pytest.mark.parametrize(("method", "path"), ROUTES + UNDER_ADMIN)
def test_without_a_configured_token_everything_is_off_and_says_which_setting(service, method, path):
    answer = service.client.request(method, path, headers={"Authorization": "Bearer a token of tests, long enough"})

    assert answer.status_code == 403
    if method != "HEAD":
        assert answer.json()["type"] == "urn:rover-twin:problem:admin-off"
        assert "ROVER_TWIN_ADMIN_TOKEN" in answer.json()["detail"]


@pytest.mark.parametrize("sent", WRONG.values(), ids=WRONG.keys())
def test_without_the_right_token_nothing_is_told(admin, sent):
    del admin.client.headers["Authorization"]
    seen = {}
    for method, path in ROUTES + UNDER_ADMIN:
        answer = admin.client.request(method, path, headers=sent)
        assert answer.status_code in (401, 429), (method, path)  # a wrong token that keeps coming is told to wait
        if answer.status_code == 401:
            assert answer.headers["www-authenticate"].startswith('Bearer realm="rover-twin"')
        assert "allow" not in answer.headers
        if method != "HEAD":
            problem = answer.json()
            problem.pop("instance")
            said = re.sub("in [0-9]+ s", "in a while", str(sorted(problem.items())))
            seen.setdefault(answer.status_code, set()).add(said)

    assert [len(each) for each in seen.values()] == [1] * len(seen)  # what is there and what is not looks the same


@pytest.mark.parametrize("path", OF_THE_PROTOCOL)
def test_what_is_in_memory_is_changed_with_a_token_only(admin, service, path):
    off = service.client.post(path)
    got_in = admin.client.post(path.replace("viper-lunar", "nobody"))
    del admin.client.headers["Authorization"]
    without = admin.client.post(path)

    assert (off.status_code, without.status_code, got_in.status_code) == (403, 401, 404)
    assert list(without.json()) == ["error"]
    assert without.headers["www-authenticate"].startswith("Bearer")


def test_a_wrong_token_is_told_from_a_missing_one_by_the_challenge(serve):
    client = serve(admin_token=TOKEN, start_worker=False).client  # where nobody has sent wrong ones yet

    missing = client.get("/v1/admin/datasets")
    wrong = client.get("/v1/admin/datasets", headers=WRONG["another"])

    assert "error=" not in missing.headers["www-authenticate"]
    assert 'error="invalid_token"' in wrong.headers["www-authenticate"]


@pytest.mark.parametrize("scheme", ["Bearer", "bearer", "BEARER"])
def test_the_right_token_gets_in(admin, scheme):
    answer = admin.client.get(
        "/v1/admin/datasets", headers={"Authorization": f"{scheme} a token of tests, long enough"}
    )

    assert answer.status_code == 200


@pytest.mark.slow
def test_a_token_may_have_any_characters(serve):
    service = serve(admin_token="schl\u00fcssel mit umlauten", start_worker=False)
    bearer = "Bearer schl\u00fcssel mit umlauten".encode()

    assert service.client.get("/v1/admin/datasets", headers={"Authorization": bearer}).status_code == 200
    assert service.client.get("/v1/admin/datasets").status_code == 401


def test_with_the_token_an_address_that_does_not_exist_is_a_404(admin):
    assert admin.client.get("/v1/admin/no-such-thing").status_code == 404


def test_the_token_is_asked_for_before_a_byte_of_the_body_is_read(admin):
    for path in ("POST /v1/admin/datasets", "PUT /v1/models/viper-lunar/aliases/champion"):
        head = f"{path} HTTP/1.1\r\nHost: x\r\nContent-Type: application/json\r\nContent-Length: 1000\r\n"

        answer = exchange(admin, f"{head}Connection: close\r\n\r\n".encode())  # the body never comes

        assert answer.startswith(b"HTTP/1.1 401"), answer


def test_a_body_that_is_nonsense_changes_nothing_of_that(admin):
    del admin.client.headers["Authorization"]

    answer = admin.client.put(
        "/v1/models/viper-lunar/aliases/champion", content=b"{", headers={"Content-Type": "application/json"}
    )

    assert answer.status_code == 401


@pytest.mark.slow
@pytest.mark.parametrize("path", ["/v1/models", "/health/live", "/docs", "/openapi.json"])
def test_the_public_side_needs_no_token(admin, path):
    del admin.client.headers["Authorization"]

    assert admin.client.get(path).status_code == 200


def test_nobody_names_himself(admin, publish):
    publish(admin.store)

    answer = admin.client.put(
        "/v1/models/viper-lunar/aliases/champion", json={"version": 1, "reason": "first"}, headers={"X-Actor": "jane"}
    )

    assert answer.status_code == 422
    assert answer.json()["errors"][0]["field"] == "X-Actor"
    assert "name of the token" in answer.json()["detail"]
    assert admin.store.aliases("viper-lunar") == {}


@pytest.mark.slow
def test_the_contract_says_where_the_token_is_needed():
    from service.app import openapi_document

    document = openapi_document()
    secured = {
        (method.upper(), path)
        for path, operations in document["paths"].items()
        for method, operation in operations.items()
        if operation.get("security") == [{"admin": []}]
    }

    assert document["components"]["securitySchemes"]["admin"]["scheme"] == "bearer"
    assert {path for _, path in secured} >= {path for path in document["paths"] if path.startswith("/v1/admin")}
    assert ("PUT", "/v1/models/{name}/aliases/{alias}") in secured
    assert ("POST", "/v1/models/{name}/aliases/{alias}/rollback") in secured
    assert ("POST", "/v2/repository/models/{name}/unload") in secured
    assert ("GET", "/v1/models/{name}/aliases/{alias}") not in secured
