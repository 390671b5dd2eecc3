"""One service for the tests of a file."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

import model_store
from tests.api.conftest import Running, serving


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    folder = tmp_path_factory.mktemp("shipped")
    shutil.copytree(Path(model_store.__file__).parent / "models", folder / "models")
    with serving(folder) as running:
        running.wait_ready()
        yield running
