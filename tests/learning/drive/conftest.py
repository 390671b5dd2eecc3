"""One law for all tests. `--drive-engine` tries another engine."""

from __future__ import annotations

from pathlib import Path

import pytest

from service.learning.drive import law as law_module
from service.learning.drive import library as library_module
from service.learning.drive.engine import Engine
from service.learning.drive.law import Law
from service.learning.drive.library import vector_bits
from tests.learning.drive.laws import law_like_the_shipped_one


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--drive-engine", help="another engine than the installed one, see `make sanitize`")


def pytest_configure(config: pytest.Config) -> None:
    if engine := config.getoption("--drive-engine", None):
        library_module.PATH = Path(engine)


@pytest.fixture(scope="session")
def law() -> Law:
    return law_like_the_shipped_one()


@pytest.fixture(scope="session")
def engine(law: Law) -> Engine:
    return Engine(law)


@pytest.fixture(scope="session")
def engines(law: Law) -> list[Engine]:
    """One for each width that this machine has."""
    found = []
    for bits in (each for each in (128, 256, 512) if each <= vector_bits()):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(law_module, "vector_bits", lambda bits=bits: bits)
            found.append(Engine(law))
    return found
