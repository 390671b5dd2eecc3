from __future__ import annotations

import pytest

from model_store import ModelStore
from service.settings import Settings
from service.twin import Twin
from service.twin.load import load_twin


def shipped(version: int = 5) -> Twin:
    return load_twin(ModelStore.open(Settings().store_url), "viper-lunar", version)


@pytest.fixture(scope="package")
def twin() -> Twin:
    return shipped()


@pytest.fixture(scope="package")
def other_instance() -> Twin:
    """The same version, loaded once more, as another server has it."""
    return shipped()
