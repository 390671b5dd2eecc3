"""Builds the image and uses it as an operator would. Minutes: runs only with `pytest -m image`.

Which container tool: docker or podman, whichever has a working engine. Where neither can build by itself,
ROVER_TWIN_IMAGE_BUILD and ROVER_TWIN_IMAGE_RUN name commands that do, called as

    $ROVER_TWIN_IMAGE_BUILD TAG DOCKERFILE CONTEXT [build options]
    $ROVER_TWIN_IMAGE_RUN TAG [run options] --

with the options of `podman build` and `podman run`; the second runs on the host's network. Without any of these
the tests skip and say so.
"""

from __future__ import annotations

import os
import shlex
import shutil
import socket
import subprocess
import time
import uuid
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from rover_twin_client import RoverTwin

REPOSITORY = Path(__file__).parents[2]
TAG = "rover-twin:test"
GRACE_S = 20  # between SIGTERM and SIGKILL
PORT_INSIDE = 8000

pytestmark = [pytest.mark.image, pytest.mark.timeout(1800)]


@dataclass(frozen=True)
class Tool:
    """A container tool: `engine` looks at and stops containers, the other two build and run."""

    engine: str
    build: list[str]
    run: list[str]
    on_host_network: bool

    def __call__(self, *arguments: str, check: bool = True) -> str:
        return call([self.engine, *arguments], check=check)

    def is_healthy(self, name: str) -> bool:
        if self.engine == "docker":  # its engine runs the check by itself
            return self("inspect", "--format", "{{.State.Health.Status}}", name).strip() == "healthy"
        done = subprocess.run([self.engine, "healthcheck", "run", name], capture_output=True, check=False)
        return done.returncode == 0


def call(command: list[str], *, check: bool = True) -> str:
    done = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=False)
    assert not check or done.returncode == 0, f"{shlex.join(command)}\n{done.stdout[-2000:]}\n{done.stderr[-2000:]}"
    return done.stdout


def works(engine: str) -> bool:
    """Whether the tool is there and its engine answers (a docker client without a daemon does not count)."""
    return bool(shutil.which(engine)) and not subprocess.run([engine, "info"], capture_output=True).returncode


@pytest.fixture(scope="module")
def tool() -> Tool:
    """The container tool of this machine, or a skip that says what was looked for."""
    build, run = os.environ.get("ROVER_TWIN_IMAGE_BUILD"), os.environ.get("ROVER_TWIN_IMAGE_RUN")
    if build and run:
        described = [*shlex.split(build), TAG, "docker/Dockerfile", ".", "--format", "docker"]
        return Tool("podman", described, [*shlex.split(run), TAG], on_host_network=True)
    for engine, options in (("docker", []), ("podman", ["--format", "docker"])):
        if works(engine):
            build_here = [engine, "build", *options, "-t", TAG, "-f", "docker/Dockerfile", "."]
            return Tool(engine, build_here, [engine, "run", "--rm"], on_host_network=False)
    pytest.skip("NO IMAGE WAS BUILT OR RUN: no docker or podman engine, and ROVER_TWIN_IMAGE_BUILD/_RUN are not set")


@pytest.fixture(scope="module")
def image(tool: Tool) -> str:
    """The image, built from this working tree."""
    call(tool.build)
    return TAG


@dataclass(frozen=True)
class Container:
    name: str
    url: str


@pytest.fixture
def container(tool: Tool, image: str) -> Iterator[Container]:
    """The service in a container with a read-only file system, waited for until healthy."""
    name = f"rover-twin-test-{uuid.uuid4().hex[:8]}"
    port = free_port()
    options = ["-d", "--name", name, "--read-only", "--tmpfs", "/tmp", "--cap-drop", "ALL"]
    if tool.on_host_network:
        call([*tool.run, *options, "-e", f"ROVER_TWIN_PORT={port}", "--"])
    else:
        call([*tool.run, *options, "-p", f"127.0.0.1:{port}:{PORT_INSIDE}", image])
    try:
        wait_until_healthy(tool, name)
        yield Container(name, f"http://127.0.0.1:{port}")
    finally:
        tool("rm", "-f", name, check=False)


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        return int(listener.getsockname()[1])


def wait_until_healthy(tool: Tool, name: str, limit_s: float = 90.0) -> None:
    deadline = time.monotonic() + limit_s
    while not tool.is_healthy(name):
        if time.monotonic() > deadline:
            pytest.fail(f"not healthy after {limit_s} s; its log:\n{tool('logs', name, check=False)[-3000:]}")
        time.sleep(0.5)


def test_a_healthy_container_predicts_with_the_shipped_model(container: Container) -> None:
    with RoverTwin(container.url) as twin:
        prediction = twin.predict(28, 430, 60, 10)

    assert prediction.model.name == "viper-lunar"
    assert prediction.time_s[-1] == 10.0
    assert prediction.summary.final_x_m == pytest.approx(prediction.x_m[-1])


def test_it_does_not_run_as_root(tool: Tool, container: Container) -> None:
    asked = "import os; print(os.getuid(), os.getgid())"

    assert tool("exec", container.name, "python", "-c", asked).split() == ["10001", "10001"]


def test_sigterm_ends_it_within_the_grace_time(tool: Tool, container: Container) -> None:
    waiting = subprocess.Popen([tool.engine, "wait", container.name], stdout=subprocess.PIPE, text=True)
    began = time.monotonic()

    tool("stop", "-t", str(GRACE_S), container.name)

    took_s = time.monotonic() - began
    code = int(waiting.communicate(timeout=30)[0])
    assert took_s < GRACE_S - 5
    assert code in (0, 143), f"exit {code}; 137 would be SIGKILL"


def test_the_image_carries_no_history_tests_or_development_tools(tool: Tool, container: Container) -> None:
    asked = "import importlib.util as u; print([m for m in ('pytest', 'mypy', 'ruff', 'pip') if u.find_spec(m)])"

    assert tool("exec", container.name, "python", "-c", asked).strip() == "[]"
    assert tool("exec", container.name, "find", "/opt/rover-twin", "-name", ".git").strip() == ""
