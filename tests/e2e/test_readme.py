"""The README, followed word by word on a fresh clone: every command, every answer it shows (`make e2e`)."""

from __future__ import annotations

import json
import math
import os
import re
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from urllib.request import urlopen

import pytest

pytestmark = [pytest.mark.e2e, pytest.mark.timeout(2400)]

ROOT = Path(__file__).parent.parent.parent
SET_UP_S = 900


@dataclass(frozen=True)
class Block:
    language: str
    text: str


def readme_blocks() -> list[Block]:
    fences = re.findall(r"^```(\w+)\n(.*?)^```$", (ROOT / "README.md").read_text(), re.MULTILINE | re.DOTALL)
    return [Block(language, text) for language, text in fences]


def commands() -> list[str]:
    """Every line of every sh block, but for those that go on with the line before."""
    lines = [line for block in readme_blocks() if block.language == "sh" for line in block.text.splitlines()]
    return [line for line in lines if not line.startswith(" ")]


def first_results() -> list[str]:
    """Commands of docs/quickstart.md that draw or fetch something and need nothing but the service of `make run`."""
    lines = re.findall(r"^    (.*)$", (ROOT / "docs/quickstart.md").read_text(), re.MULTILINE)
    return [line for line in lines if line.startswith((".venv/bin/rover-twin mobility", "curl -o", "curl -OJ"))]


def is_finite_command(command: str) -> bool:
    """A command of the program that ends by itself."""
    return command.startswith(".venv/bin/rover-twin ") and " serve " not in command


@pytest.fixture(scope="module")
def clone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What a newcomer gets: the commit that is checked out, nothing else."""
    folder = tmp_path_factory.mktemp("newcomer") / "rover-twin"
    subprocess.run(["git", "clone", "--quiet", str(ROOT), str(folder)], check=True)
    return folder


def newcomer() -> dict[str, str]:
    """The environment without this checkout's virtual environment and settings."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("ROVER_TWIN_", "VIRTUAL_ENV"))}
    kept.pop("PYTHONPATH", None)
    outside = [place for place in kept["PATH"].split(":") if not place.startswith(str(ROOT))]
    return kept | {"PATH": ":".join(outside)}


def run(command: str, clone: Path, timeout_s: float = 300) -> str:
    done = subprocess.run(
        ["sh", "-c", command], cwd=clone, env=newcomer(), capture_output=True, text=True, timeout=timeout_s
    )
    assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"
    return done.stdout


@contextmanager
def serving(command: str, clone: Path, port: int) -> Iterator[None]:
    """The command in the background, until ready; stopped as Ctrl-C does, which must end it well."""
    process = subprocess.Popen(["sh", "-c", command], cwd=clone, env=newcomer(), start_new_session=True)
    try:
        end = time.monotonic() + SET_UP_S
        while not is_ready(port):
            assert process.poll() is None, f"{command} ended with {process.returncode}"
            assert time.monotonic() < end, f"{command} was not ready after {SET_UP_S} s"
            time.sleep(0.5)
        yield
    finally:
        os.killpg(process.pid, signal.SIGINT)
        process.wait(60)


def is_ready(port: int) -> bool:
    try:
        with urlopen(f"http://127.0.0.1:{port}/health/ready", timeout=5) as answer:
            return bool(answer.status == 200)
    except OSError:
        return False


def assert_close(found: object, expected: object, where: str = "answer") -> None:
    """The same JSON, with numbers equal to a tenth of a millimetre: processors differ in the last digits."""
    if isinstance(expected, dict):
        assert isinstance(found, dict)
        assert found.keys() == expected.keys(), where
        for key in expected:
            assert_close(found[key], expected[key], f"{where}.{key}")
    elif isinstance(expected, list):
        assert isinstance(found, list)
        assert len(found) == len(expected), where
        for index, value in enumerate(expected):
            assert_close(found[index], value, f"{where}[{index}]")
    elif isinstance(expected, float | int) and not isinstance(expected, bool):
        assert isinstance(found, float | int)
        assert math.isclose(found, expected, abs_tol=1e-4), f"{where}: {found}, the README says {expected}"
    else:
        assert found == expected, where


def test_the_readme_holds(clone):
    """One test, since a reader goes from top to bottom: what a step makes, a later one uses."""
    blocks = readme_blocks()
    curls = [(block.text.strip(), following) for block, following in pairwise(blocks) if block.text.startswith("curl")]
    assert [following.language for _, following in curls] == ["json", "json", "python", "sh"]
    training = [line for line in commands() if "my-" in line]
    assert len(training) == 5

    with serving("make run", clone, 8000):
        for command, shown in curls:
            answer = json.loads(run(command, clone))
            if shown.language == "json":
                assert_close(answer, json.loads(shown.text))
            elif "/v1/drives" in command:
                assert [each["event"] for each in answer["events"]] == ["passes", "arrives"]
            else:
                assert all(25 < slope < 33 for slope in answer["steepest_climb_slope_deg"])
        assert "<title>" in run("curl --fail --silent http://127.0.0.1:8000/", clone)
        assert len([run(command, clone) for command in first_results()]) == 3
        made = [*clone.glob("map.svg"), *clone.glob("rover.usda"), *clone.glob("*.fmu")]
        assert len([file for file in made if file.stat().st_size > 10_000]) == 3
        run(".venv/bin/pip install --quiet --constraint constraints.txt ./clients/python", clone)
        asked, stepped = [block.text for block in blocks if block.language == "python"]
        (clone / "ask.py").write_text(asked)
        assert run(".venv/bin/python ask.py", clone).startswith("climbs 1.2")
        (clone / "step.py").write_text(stepped)
        assert [line.split()[0] for line in run(".venv/bin/python step.py", clone).splitlines()] == [
            "0.5",
            "1.0",
            "1.5",
            "2.0",
        ]
    printed = {command: run(command, clone, timeout_s=900) for command in commands() if is_finite_command(command)}
    assert set(training[:-1]) <= printed.keys()
    (predicted,) = [text for command, text in printed.items() if " predict " in command]
    (suggested,) = [text for command, text in printed.items() if " suggest-runs " in command]
    assert "climbs" in predicted
    assert (clone / "viper.fmu").stat().st_size > 100_000
    assert len(suggested.splitlines()) >= 9
    with serving(training[-1], clone, 8001), urlopen("http://127.0.0.1:8001/v1/models") as answer:
        models = json.load(answer)["models"]
        assert [(each["name"], each["aliases"]) for each in models] == [("my-rover", {"champion": 1})]
    assert "make test" in commands()
    shutil.rmtree(clone / "my-store")


def test_every_command_of_the_readme_is_run_by_this_file():
    known = ("make run", "make test", "curl ", ".venv/bin/rover-twin ")
    assert all(command.startswith(known) for command in commands()), commands()


def test_set_up_of_make_test_works_on_the_fresh_clone(clone):
    # all tests already ran where this file runs; here the set-up and one quick file prove the verb
    assert "passed" in run("make test ARGS='tests/physics/test_values.py -q'", clone, SET_UP_S)
