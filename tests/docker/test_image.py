"""Builds both images and uses them as an operator would. Minutes: runs only with `pytest -m image`.

Which container tool: docker or podman, whichever has a working engine. Where neither can build by itself,
ROVER_TWIN_IMAGE_BUILD and ROVER_TWIN_IMAGE_RUN name commands that do, called as

    $ROVER_TWIN_IMAGE_BUILD TAG DOCKERFILE CONTEXT [build options]
    $ROVER_TWIN_IMAGE_RUN TAG [run options] --

with the options of `podman build` and `podman run`; the second runs on the host's network. Without any of these
the tests skip and say so.
"""

from __future__ import annotations

import json
import os
import shlex
import shutil
import socket
import subprocess
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import httpx
import pytest

from rover_twin_client import RoverTwin
from tests.benchmarks import attackers
from tests.benchmarks.processes import Running

REPOSITORY = Path(__file__).parents[2]
BOM = "/opt/rover-twin/sbom.cdx.json"
ABSENT = ("pytest", "mypy", "ruff", "pip", "setuptools", "cyclonedx")
LARGE = ("torch", "scipy", "matplotlib")
MOST_SERVING_BYTES = 450_000_000
GRACE_S = 20  # between SIGTERM and SIGKILL
PORT_INSIDE = 8000

pytestmark = [pytest.mark.image, pytest.mark.timeout(1800)]


@dataclass(frozen=True)
class Tool:
    """A container tool: `engine` looks at and stops containers, the other two build and run."""

    engine: str
    build: tuple[str, ...]
    run: tuple[str, ...]
    on_host_network: bool

    def make(self, target: str, tag: str) -> None:
        """Build one of the Dockerfile's targets."""
        if self.on_host_network:
            call([*self.build, tag, "docker/Dockerfile", ".", "--format", "docker", "--target", target])
        else:
            call([*self.build, "--target", target, "-t", tag, "-f", "docker/Dockerfile", "."])

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
        return Tool("podman", tuple(shlex.split(build)), tuple(shlex.split(run)), on_host_network=True)
    for engine, options in (("docker", ()), ("podman", ("--format", "docker"))):
        if works(engine):
            return Tool(engine, (engine, "build", *options), (engine, "run", "--rm"), on_host_network=False)
    pytest.skip("NO IMAGE WAS BUILT OR RUN: no docker or podman engine, and ROVER_TWIN_IMAGE_BUILD/_RUN are not set")


@dataclass(frozen=True)
class Image:
    """`target` of the Dockerfile, and what it is built as."""

    target: str
    tag: str


@pytest.fixture(scope="module", params=["serving", "whole"])
def image(tool: Tool, request: pytest.FixtureRequest) -> Image:
    """Each image, built from this working tree."""
    image = Image(request.param, f"rover-twin-{request.param}:test")
    tool.make(image.target, image.tag)
    return image


@dataclass(frozen=True)
class Container:
    name: str
    url: str


@contextmanager
def started(tool: Tool, image: Image, *more: str) -> Iterator[Container]:
    """The service in a container with a read-only file system, waited for until healthy; `more` are run options."""
    name = f"rover-twin-test-{uuid.uuid4().hex[:8]}"
    port = free_port()
    options = ["-d", "--name", name, "--read-only", "--tmpfs", "/tmp", "--cap-drop", "ALL"]
    options += ["--security-opt", "no-new-privileges", *more]
    if tool.on_host_network:
        call([*tool.run, image.tag, *options, "-e", f"ROVER_TWIN_PORT={port}", "--"])
    else:
        call([*tool.run, *options, "-p", f"127.0.0.1:{port}:{PORT_INSIDE}", image.tag])
    try:
        wait_until_healthy(tool, name)
        yield Container(name, f"http://127.0.0.1:{port}")
    finally:
        tool("rm", "-f", name, check=False)


@pytest.fixture(scope="module")
def container(tool: Tool, image: Image) -> Iterator[Container]:
    """One for all tests that leave it as it is."""
    with started(tool, image) as container:
        yield container


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


def test_the_page_is_in_the_image(container: Container) -> None:
    for path in ("/", "/page/main.js", "/page/vendor/uPlot.iife.min.js"):
        answer = httpx.get(container.url + path, headers={"Accept": "text/html"}, trust_env=False)
        assert answer.status_code == 200, path


def test_it_is_not_root_and_has_no_rights_to_become_it(tool: Tool, container: Container) -> None:
    status = tool("exec", container.name, "cat", "/proc/1/status")

    found = {name: values.split() for name, _, values in (line.partition(":") for line in status.splitlines())}
    assert found["Uid"] == found["Gid"] == ["10001"] * 4
    assert {int(found[name][0], 16) for name in ("CapPrm", "CapEff", "CapInh", "CapBnd", "CapAmb")} == {0}
    assert found["NoNewPrivs"] == ["1"]
    assert "Read-only file system" in tool("exec", container.name, "sh", "-c", "touch /opt/a 2>&1; true")


def test_largest_batches_fit_a_container_of_one_gib(tool: Tool, image: Image) -> None:
    if image.target != "serving":
        pytest.skip("the whole image answers with the same code")
    with started(tool, image, "--memory", "1g", "--memory-swap", "1g") as container:
        port = int(container.url.rpartition(":")[2])
        found = attackers.answers(Running("", port, 0, 0.0), attackers.large_batch(), 4, 200)

        killed = tool("inspect", "--format", "{{.State.OOMKilled}} {{.State.Running}}", container.name)
    assert {status for status, _ in found} == {200}, found
    assert killed.split() == ["false", "true"]


def test_sigterm_ends_it_within_the_grace_time(tool: Tool, image: Image) -> None:
    with started(tool, image) as container:
        waiting = subprocess.Popen([tool.engine, "wait", container.name], stdout=subprocess.PIPE, text=True)
        began = time.monotonic()

        tool("stop", "-t", str(GRACE_S), container.name)

        took_s = time.monotonic() - began
        code = int(waiting.communicate(timeout=30)[0])
    assert took_s < GRACE_S - 5
    assert code in (0, 143), f"exit {code}; 137 would be SIGKILL"


def test_the_image_carries_no_history_tests_or_development_tools(
    tool: Tool, image: Image, container: Container
) -> None:
    names = (*ABSENT, *LARGE)
    asked = f"import importlib.util as u; print([m for m in {names} if u.find_spec(m)])"

    # PyTorch requires setuptools itself
    found = [] if image.target == "serving" else ["setuptools", *LARGE]
    assert tool("exec", container.name, "python", "-c", asked).strip() == str(found)
    assert tool("exec", container.name, "find", "/opt/rover-twin", "-name", ".git").strip() == ""
    assert tool("exec", container.name, "find", "/usr", "-perm", "/6000", "-type", "f").strip() == ""


def test_its_bill_of_materials_lists_all_that_is_installed(tool: Tool, image: Image, container: Container) -> None:
    bom = json.loads(tool("exec", container.name, "cat", BOM))
    asked = "from importlib.metadata import distributions as d; [print(x.name, x.version) for x in d()]"
    installed = {tuple(line.split()) for line in tool("exec", container.name, "python", "-c", asked).splitlines()}

    assert (bom["bomFormat"], bom["specVersion"]) == ("CycloneDX", "1.6")  # the build has held it against the schema
    listed = {(each["name"], each["version"]) for each in bom["components"]}
    assert installed - listed == set()
    assert all(each["licenses"] for each in bom["components"] if each.get("purl", "pkg:pypi").startswith("pkg:pypi"))
    native = {each["name"]: each["hashes"][0]["content"] for each in bom["components"] if "hashes" in each}
    engine = "service/learning/drive/native/librover.so"
    package = "/opt/rover-twin/lib/python3.11/site-packages"
    assert tool("exec", container.name, "sha256sum", f"{package}/{engine}").split()[0] == native[engine]
    assert {"libc6", "zlib1g"} <= {each["name"] for each in bom["components"]}  # the system beneath


def test_the_serving_image_is_small(tool: Tool, image: Image) -> None:
    if image.target != "serving":
        pytest.skip("a bar of the serving image")
    size = int(tool("image", "inspect", "--format", "{{.Size}}", image.tag))

    assert size <= MOST_SERVING_BYTES, f"{size / 1e6:.0f} MB"


def test_what_the_serving_image_cannot_do_it_says(tool: Tool, image: Image, container: Container) -> None:
    asked = ["rover-twin", "train", "--dataset", "none", "--model", "x"]  # the whole one says that there is no such set
    said = tool("exec", container.name, "sh", "-c", f"{shlex.join(asked)} 2>&1", check=False)

    assert ("PyTorch" in said and "whole image" in said) == (image.target == "serving"), said


def test_both_images_answer_with_a_network(tool: Tool, image: Image, container: Container) -> None:
    asked = ["rover-twin", "predict", "--slope-deg", "28", "--mass-kg", "430", "--torque-nm", "60", "--model"]
    assert "28" in tool("exec", container.name, *asked, "viper-lunar-paper")
