"""docs/clients.md: the examples whose libraries the tests have run here; `make other-clients` runs all of them."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from service.settings import Settings
from tests.api.conftest import serving
from tests.other_clients.__main__ import REQUIREMENTS
from tests.other_clients.page import ADDRESS, PAGE, examples

HERE = ("tables", "tritonclient")


@pytest.fixture(scope="module")
def address():
    with serving(Path(Settings(_env_file=None).store_url)) as running:
        running.wait_ready(60)
        yield running.url.removeprefix("http://")


def test_every_example_has_an_environment_and_every_environment_an_example():
    assert {each.environment for each in examples()} == {file.stem for file in REQUIREMENTS.iterdir()}
    assert PAGE.read_text().count("```text\n") == len(examples())
    assert all(len(each.text.splitlines()) <= 16 for each in examples())


@pytest.mark.processes
@pytest.mark.parametrize(
    "example", [each for each in examples() if each.environment in HERE], ids=lambda each: each.environment
)
def test_an_example_prints_what_the_page_shows(address, tmp_path, example):
    assert example.prints(address, Path(sys.executable).parent, tmp_path).replace(address, ADDRESS) == example.shown


@pytest.mark.processes
def test_a_broken_example_is_noticed(address, tmp_path):
    example = next(each for each in examples() if each.environment == "tables")
    broken = type(example)(example.language, example.environment, example.text + "\nprint(1 / 0)\n", example.shown)

    assert "ZeroDivisionError" in broken.prints(address, Path(sys.executable).parent, tmp_path)
