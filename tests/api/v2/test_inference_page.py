"""The page about the protocol: its examples run, against the shipped models, and print what it says they do."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import pytest

from service.settings import Settings
from tests.api.conftest import serving

PAGE = Path(__file__).parents[3] / "docs/inference-protocol.md"
BLOCKS = re.findall(r"^```(\w+)\n(.*?)^```", PAGE.read_text(), re.MULTILINE | re.DOTALL)


@pytest.fixture(scope="module")
def shipped():
    with serving(Path(Settings(_env_file=None).store_url)) as running:
        running.wait_ready(60)
        yield running


def runs():
    return [
        (language, text, shown) for (language, text), (_, shown) in pairwise(BLOCKS) if language in ("sh", "python")
    ]


def test_the_page_has_examples_for_both():
    assert [language for language, _, _ in runs()] == ["sh", "python"]


@pytest.mark.processes
@pytest.mark.parametrize(("language", "text", "shown"), runs(), ids=lambda value: str(value)[:6])
def test_an_example_prints_what_the_page_shows(shipped, language, text, shown):
    text = text.replace("localhost:8000", shipped.url.removeprefix("http://"))
    command = ["sh", "-c", text] if language == "sh" else [sys.executable, "-c", text]

    done = subprocess.run(command, capture_output=True, text=True, timeout=60)

    assert done.returncode == 0, done.stderr
    if language == "sh":
        found, expected = json.loads(done.stdout), json.loads(shown)
        for one, other in zip(found["outputs"], expected["outputs"], strict=True):
            if one["datatype"] == "FP64":
                assert one.pop("data") == pytest.approx(other.pop("data"), abs=1e-4)
        assert found == expected
    else:
        assert done.stdout == shown


@pytest.mark.slow
def test_the_page_names_all_tensors_and_parameters(shipped):
    metadata = shipped.get("/v2/models/viper-lunar").json()

    names = [each["name"] for each in (*metadata["inputs"], *metadata["outputs"])]
    page = PAGE.read_text()
    assert [name for name in names if f"`{name}`" not in page] == []
