"""A service that operators' scripts may change."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.api.conftest import TOKEN, Running, move_alias, publish_version, serving


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    """Two versions; champion is the first."""
    with serving(tmp_path_factory.mktemp("store"), admin_token=TOKEN, start_worker=False) as running:
        move_alias(running.store, publish_version(running.store))
        publish_version(running.store)
        yield running
