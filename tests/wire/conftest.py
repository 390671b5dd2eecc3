"""`--digits-library` tries another library of numbers."""

from __future__ import annotations

from pathlib import Path

import pytest

from service.wire import digits


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--digits-library", help="another one than the installed, see `make sanitize`")


def pytest_configure(config: pytest.Config) -> None:
    if library := config.getoption("--digits-library", None):
        digits.PATH = Path(library)
