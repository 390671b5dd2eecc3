"""Image tests take minutes, so they run only when asked for by name: `pytest -m image`."""

from __future__ import annotations

import pytest


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if "image" in config.option.markexpr:
        return
    minutes = [item for item in items if item.get_closest_marker("image")]
    config.hook.pytest_deselected(items=minutes)
    items[:] = [item for item in items if item not in minutes]
