"""Services with tokens by name, and what is said of their requests."""

from __future__ import annotations

import logging
import time

import pytest

from service.access import tokens as tokens_module
from service.access.token_file import StoredToken, add
from service.access.tokens import digest_of, new_token
from service.log import REQUESTS
from tests.api.v1.test_aliases import CHAMPION

AUDIT = "/v1/admin/audit"
HEALTH = ("/health/live", "/health/ready", "/v2/health/live", "/v2/health/ready")
READABLE = ("/v1/admin/datasets", "/v1/admin/training-jobs")
CHANGES = [
    ("POST", "/v1/admin/datasets"),
    ("DELETE", "/v1/admin/datasets/abcdef"),
    ("POST", "/v1/admin/training-jobs"),
    ("POST", "/v1/admin/training-jobs/0f0e3b5c-6b43-4d0f-a5a5-3a7d3f0b8a10/cancel"),
    ("PUT", CHAMPION),
    ("POST", f"{CHAMPION}/rollback"),
    ("POST", "/v2/repository/models/viper-lunar/load"),
    ("POST", "/v2/repository/models/viper-lunar/unload"),
]


def bearer(token):
    return {"Authorization": f"Bearer {token}"}


@pytest.fixture
def file(tmp_path, monkeypatch):
    """An empty file of tokens, which the service looks at all the time."""
    monkeypatch.setattr(tokens_module, "_LOOK_S", 0.02)
    (tmp_path / "tokens").touch()
    return tmp_path / "tokens"


class Give:
    """Makes a token. Where there is a `service`, it is in force then."""

    def __init__(self, file):
        self.file = file
        self.service = None

    def __call__(self, name, scope):
        token = new_token()
        add(self.file, StoredToken(name, scope, digest_of(token.encode())))
        if self.service is not None:
            taken_up(self.service)
        return bearer(token)


def taken_up(service, headers=None):
    """Wait until the service has looked at its file of tokens once more; at those that it has read for sure."""
    changed = time.monotonic()
    while time.monotonic() < changed + 20:
        age_s = scraped(service.client, "tokens_file_confirmed_age_seconds", headers=headers or {})
        if time.monotonic() - age_s > changed + 0.1:  # what was under way while it changed
            return
        time.sleep(0.02)
    raise AssertionError("the service does not look at its tokens")


@pytest.fixture
def give(file):
    return Give(file)


@pytest.fixture
def named(serve, file, store, publish, give):
    """A service with a file of tokens, and three versions to move an alias to."""
    for coefficient in (0.1, 0.2, 0.3):
        publish(store, coefficient=coefficient)
    give.service = serve(tokens_file=file, start_worker=False)
    return give.service


@pytest.fixture
def lines():
    """What is said of requests while the test runs."""
    found = []
    handler = logging.Handler(logging.DEBUG)
    handler.emit = lambda record: found.append(record.msg)
    logger = logging.getLogger(REQUESTS)
    level = logger.level
    logger.addHandler(handler)
    logger.setLevel(logging.DEBUG)
    yield found
    logger.removeHandler(handler)
    logger.setLevel(level)


def scraped(client, name, **labels):
    text = client.get("/metrics", headers=labels.pop("headers", {})).text
    wanted = ",".join(f'{key}="{value}"' for key, value in labels.items())
    place = f"rover_twin_{name}" + (f"{{{wanted}}}" if wanted else "")
    return next((float(line.split()[1]) for line in text.splitlines() if line.split()[0] == place), 0.0)
