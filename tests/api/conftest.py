"""A real server on a free port, over a store with small published models made here."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import httpx
import numpy as np
import pytest
import requests
import torch
import uvicorn

import model_store
from model_store import WEIGHTS, Lineage, ManifestDraft, ModelStore
from service.api.http.instruments import Instruments
from service.api.services import Lifecycle
from service.app import create_app
from service.learning.checkpoint import describe_model, weights_bytes
from service.learning.domain import Domain
from service.learning.network.inputs import InputSignature
from service.learning.network.model import PhysicsInformedModel
from service.learning.network.residuals import make_residual
from service.physics.parameters import LUNAR_REGOLITH, VIPER
from service.physics.priors import make_prior
from service.physics.scenario import Scenarios
from service.server import make_server
from service.settings import Settings
from tests.twin.published import publish_banded

DOMAIN = {
    "slope_deg": (10.0, 32.0),
    "mass_kg": (300.0, 600.0),
    "torque_nm": (30.0, 90.0),
    "torque_ratio": (0.05, 2.0),
    "horizon_s": (0.0, 600.0),
}
TOKEN = "a token of tests, long enough"
ADMIN = {"Authorization": f"Bearer {TOKEN}"}
PLAIN = {"trust_env": False, "verify": False}  # no proxies, and no certificates to load: it is HTTP
QUESTION = {"slope_deg": 28, "mass_kg": 430, "torque_nm": 60}


def publish_version(
    store: ModelStore,
    name: str = "viper-lunar",
    *,
    coefficient: float = 0.1,
    architecture: str = "zero",
    scale: float = 1.0,
) -> int:
    """A version that answers the prior with this coefficient; `paper_network` adds random weights times `scale`."""
    prior = make_prior("motor_slope", coefficient)
    scenarios = Scenarios(np.radians([10.0, 32.0]), np.array([300.0, 600.0]), np.array([30.0, 90.0]))
    signature = InputSignature.fitted(["time_s", "slope_deg"], scenarios, 10.0, VIPER, LUNAR_REGOLITH)
    torch.manual_seed(0)
    arguments = {"input_count": 2}
    if architecture == "paper_network":
        arguments |= {"output_scale_m": [0.01, 0.01], "x_form": "position"}
    residual = make_residual(architecture, arguments)
    with torch.no_grad():
        for weights in residual.parameters():
            weights *= scale
    model = PhysicsInformedModel(prior, signature, residual.correction())
    draft = ManifestDraft(
        created_by="tests",
        description=f"a small model with coefficient {coefficient}",
        checkpoint=describe_model(model) | {"wheel_motion_resistance": 0.1},
        domain=Domain(DOMAIN, VIPER, LUNAR_REGOLITH).describe(),
        metrics={},
        lineage=Lineage(),
    )
    return store.publish(name, {WEIGHTS: weights_bytes(model)}, draft).version


def move_alias(store: ModelStore, version: int, alias: str = "champion", name: str = "viper-lunar") -> None:
    store.move_alias(name, alias, version, actor="tests", reason="for a test")


@dataclass
class Running:
    """A server that listens, and the store it reads."""

    url: str
    store: ModelStore
    folder: Path
    client: httpx.Client
    lifecycle: Lifecycle
    server: uvicorn.Server

    def get(self, path: str, **query: object) -> httpx.Response:
        return self.client.get(path, params=query)

    def predict(self, **query: object) -> httpx.Response:
        return self.get("/v1/predictions", **(QUESTION | query))

    def wait_ready(self, timeout_s: float = 30.0) -> httpx.Response:
        deadline = time.monotonic() + timeout_s
        while (answer := self.get("/health/ready")).status_code != 200 and time.monotonic() < deadline:
            time.sleep(0.05)
        assert answer.status_code == 200, answer.text
        return answer


@contextmanager
def serving(folder: Path, **settings: object) -> Iterator[Running]:
    """Run the service over the store in `folder` until the block ends."""
    store = ModelStore.open(str(folder), create=True)
    # a small limit of bodies, which tests can exceed quickly
    chosen = Settings(store_url=str(folder), port=0, **({"max_body_bytes": 64 * 1024, "drain_s": 0} | settings))
    lifecycle = Lifecycle()
    counting = Instruments()
    server = make_server(create_app(chosen, lifecycle, counting), chosen, lifecycle, counting)
    with socket.create_server(("127.0.0.1", 0)) as listener:
        url = f"http://127.0.0.1:{listener.getsockname()[1]}"
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]}, name="uvicorn")
        thread.start()
        try:
            deadline = time.monotonic() + 20
            while not server.started and time.monotonic() < deadline:
                time.sleep(0.01)
            assert server.started
            with httpx.Client(base_url=url, timeout=30, **PLAIN) as client:
                yield Running(url, store, folder, client, lifecycle, server)
        finally:
            server.should_exit = True
            thread.join(timeout=40)
            assert not thread.is_alive()


@pytest.fixture(scope="session")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    """A ready service with one model, two versions, champion on the first. Tests that change the store use `serve`."""
    folder = tmp_path_factory.mktemp("store")
    store = ModelStore.open(str(folder), create=True)
    move_alias(store, publish_version(store))
    publish_version(store, coefficient=0.2)
    with serving(folder) as running:
        running.wait_ready()
        yield running


@pytest.fixture(scope="session")
def banded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    """A ready service whose champion has a band and knows its training runs; version 2 has no band."""
    folder = tmp_path_factory.mktemp("store")
    store = ModelStore.open(str(folder), create=True)
    move_alias(store, publish_banded(store, "viper-lunar").version)
    publish_version(store)
    with serving(folder) as running:
        running.wait_ready()
        yield running


@pytest.fixture(scope="session")
def shipped(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    """A service over the models that ship; its bodies may have 64 KiB, drives have more."""
    folder = tmp_path_factory.mktemp("shipped")
    shutil.copytree(Path(model_store.__file__).parent / "models", folder / "models")
    with serving(folder) as running:
        running.wait_ready()
        yield running


Serve = Callable[..., Running]


@pytest.fixture
def serve(tmp_path: Path) -> Iterator[Serve]:
    """Starts a service of the test's own over `tmp_path`; ended with the test."""
    with ExitStack() as stack:
        yield lambda **settings: stack.enter_context(serving(tmp_path / "store", **settings))


@pytest.fixture(scope="module")
def service_with_token(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    """A service for a whole module whose admin endpoints are on; its client sends the token. Its store is empty."""
    with serving(tmp_path_factory.mktemp("store"), admin_token=TOKEN, start_worker=False) as running:
        running.client.headers.update(ADMIN)
        yield running


@pytest.fixture
def admin(serve: Serve) -> Running:
    """A service over `store` whose admin endpoints are on; its client sends the token."""
    running = serve(admin_token=TOKEN, start_worker=False)
    running.client.headers.update(ADMIN)
    return running


@pytest.fixture
def store(tmp_path: Path) -> ModelStore:
    """The store that `serve` serves."""
    return ModelStore.open(str(tmp_path / "store"), create=True)


@contextmanager
def process_serving(store: ModelStore, **settings: object) -> Iterator[tuple[httpx.Client, subprocess.Popen[str]]]:
    """Run the service in a process of its own, as an operator does; it is ready when the block begins."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    chosen = {"store_url": store.location, "port": port, "log_format": "json", "log_level": "warning"} | settings
    environment = os.environ | {f"ROVER_TWIN_{name.upper()}": str(value) for name, value in chosen.items()}
    with (
        subprocess.Popen([sys.executable, "-c", RUN], env=environment, stderr=subprocess.PIPE, text=True) as process,
        httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=60, **PLAIN) as client,
    ):
        try:
            wait_until(lambda: client.get("/health/ready").status_code == 200, process)
            yield client, process
        finally:
            process.kill()


RUN = "from service.server import run_server; from service.settings import load_settings; run_server(load_settings())"


def wait_until(condition: Callable[[], bool], process: subprocess.Popen[str], timeout_s: float = 60.0) -> None:
    deadline = time.monotonic() + timeout_s
    while time.monotonic() < deadline:
        assert process.poll() is None, process.stderr.read() if process.stderr else ""
        try:
            if condition():
                return
        except httpx.TransportError:
            pass
        time.sleep(0.02)
    raise AssertionError("it did not happen in time")


@pytest.fixture
def own_process(
    store: ModelStore, processes: None
) -> Iterator[Callable[..., tuple[httpx.Client, subprocess.Popen[str]]]]:
    """Starts a process over `store`; gives its client and the process."""
    with ExitStack() as stack:
        yield lambda **settings: stack.enter_context(process_serving(store, **settings))


@pytest.fixture
def session() -> Iterator[requests.Session]:
    """Keeps its connections, and looks for no proxies."""
    with requests.Session() as session:
        session.trust_env = False
        yield session


@pytest.fixture
def publish() -> Callable[..., int]:
    return publish_version


@pytest.fixture
def move() -> Callable[..., None]:
    return move_alias


@pytest.fixture
def question() -> dict[str, float]:
    """A scenario inside the domain."""
    return dict(QUESTION)
