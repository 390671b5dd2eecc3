"""What serving costs before the first answer: which libraries it imports, and how long until it is ready."""

from __future__ import annotations

import json
import subprocess
import sys

import psutil
import pytest

from model_store import ModelStore
from service.settings import Settings
from tests.api.conftest import QUESTION, process_serving

pytestmark = pytest.mark.processes

LARGE = {"torch", "scipy", "matplotlib", "pyarrow", "dbos", "sqlalchemy", "pandas", "PIL"}
SERVE_AND_TELL = """
import json, socket, sys, threading, time
import httpx
from service.api.services import Lifecycle
from service.api.http.instruments import Instruments
from service.app import create_app
from service.server import make_server
from service.settings import Settings

MAP = {"mass_kg": 430, "torque_min_nm": 30, "torque_max_nm": 120, "torque_steps": 2, "slope_min_deg": 10,
    "slope_max_deg": 30, "slope_steps": 3, "horizon_s": 4}
BATCH = {"scenarios": [{"slope_deg": 20, "mass_kg": 430, "torque_nm": 60}]}
settings = Settings(port=0, drain_s=0, threads=1, log_level="error")
lifecycle = Lifecycle()
counting = Instruments()
server = make_server(create_app(settings, lifecycle, counting), settings, lifecycle, counting)
listener = socket.create_server(("127.0.0.1", 0))
thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]})
thread.start()
told = []
with httpx.Client(base_url=f"http://127.0.0.1:{listener.getsockname()[1]}", timeout=60, trust_env=False) as client:
    while not server.started or client.get("/health/ready").status_code != 200:
        time.sleep(0.01)
    for model in json.loads(sys.argv[1]):
        scenario = {"slope_deg": 20, "mass_kg": 430, "torque_nm": 60, "include": "prior,band", "model": model}
        answers = [
            client.get("/v1/predictions", params=scenario),
            client.post("/v1/predictions/batch", json=BATCH | {"model": model}),
            client.post("/v2/repository/index"),
            client.get("/v1/models"),
            client.get("/v1/mobility", params=MAP),
            client.get("/metrics"),
        ]
        told.append({"statuses": [each.status_code for each in answers], "modules": sorted(sys.modules)})
    from threadpoolctl import threadpool_info
    told.append([each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"])
server.should_exit = True
thread.join()
print(json.dumps(told))
"""


def told_by(*models: str):
    run = [sys.executable, "-c", SERVE_AND_TELL, json.dumps(models)]
    done = subprocess.run(run, capture_output=True, text=True, timeout=120, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def test_serving_imports_none_of_the_large_libraries_for_a_network_either():
    champion, network, blas_threads = told_by("viper-lunar", "viper-lunar-paper")

    assert champion["statuses"] == [200] * 6
    assert LARGE.isdisjoint(champion["modules"])
    assert network["statuses"] == [422, 200, 200, 200, 200, 200]  # it has no band
    assert LARGE.isdisjoint(network["modules"])
    assert set(blas_threads) <= {1}


START = """
import gc, json, sys
from service.cli.main import get_command, program
from service.cli.commands.serve import imported_server
from service.memory import uncollected
get_command(program(("serve",)))
imported_server()
with uncollected():
    from pydantic import BaseModel
    from service.app import create_app
    from service.settings import Settings
    app = create_app(Settings(port=0, log_level="error"))

def kinds(of):
    return {below for each in of.__subclasses__() for below in (each, *kinds(each))}

models = [each for each in kinds(BaseModel) if each.__module__.startswith(("service", "model_store"))]
late = [each for each in app.router.routes if hasattr(type(each), "made")]
print(json.dumps({
    "modules": sorted(sys.modules),
    "models": len(models),
    "complete": sum(each.__pydantic_complete__ for each in models),
    "late": len(late),
    "made": [each.path for each in late if "made" in vars(each)],
}))
"""


@pytest.fixture(scope="module")
def at_start():
    """What a process has that is about to listen."""
    done = subprocess.run([sys.executable, "-c", START], capture_output=True, text=True, timeout=120, check=True)
    return json.loads(done.stdout)


def test_a_start_imports_one_command_and_nothing_large(at_start):
    commands = {each for each in at_start["modules"] if each.startswith("service.cli.commands.")}
    assert commands == {"service.cli.commands.serve"}
    assert (LARGE | {"rich", "service.cli.views", "service.training.train", "service.api.v1.live_document"}).isdisjoint(
        at_start["modules"]
    )


def test_a_start_makes_neither_routes_nor_validators_that_nobody_asked_for(at_start):
    assert at_start["late"] > 50
    assert at_start["made"] == []
    assert at_start["models"] > 150
    assert at_start["complete"] < at_start["models"] / 5


@pytest.fixture(scope="module")
def used_s():
    """Processor time of one core, so that what else runs on the machine does not count: to be ready, and to answer."""
    with process_serving(ModelStore.open(Settings().store_url), threads=1) as (client, process):

        def used():
            times = psutil.Process(process.pid).cpu_times()
            return times.user + times.system

        ready = used()
        assert client.get("/v1/predictions", params=QUESTION).status_code == 200
        yield ready, used() - ready


def test_the_shipped_service_is_ready_after_two_seconds_of_processor_time(used_s):
    assert used_s[0] <= 2.0  # half of it where nothing else runs


def test_the_first_request_finds_everything_prepared(used_s):
    assert used_s[1] <= 0.06  # FastAPI would put its routers together while it waits, for a tenth of a second
