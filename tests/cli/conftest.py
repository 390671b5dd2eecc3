"""The real command line on a small store: one imported dataset and a model trained on it for two epochs."""

from __future__ import annotations

import contextlib
import csv
import functools
import gzip
import io
import json
import os
import shutil
import socket
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import httpx
import numpy as np
import pytest
from typer.main import get_command

from service.cli.main import main

PASSPORT = {
    "format": "rover-twin-passport/1",
    "title": "synthetic",
    "gravity_m_s2": 1.62,
    "frame": "slope frame: x along the slope, y normal to it",
    "reference_body": "centre of the rear left wheel",
    "rover": {"wheel_radius_m": 0.25, "wheelbase_m": 1.2836},
    "drive": {"law": "DC motor", "no_load_speed_rad_s": 3.14159},
}
SLOPES = (20.0, 22.0, 24.0, 26.0)
TRAIN = ("--epochs", "2", "--rows-per-epoch", "300", "--batch-rows", "64", "--threads", "1")
SCENARIO = ("--slope-deg", "22", "--mass-kg", "430", "--torque-nm", "60")


@dataclass(frozen=True)
class Answer:
    """What one command said and how it ended."""

    code: int
    out: str
    err: str

    @property
    def json(self):
        return json.loads(self.out)

    @property
    def error(self):
        """The one line of a failure."""
        lines = self.err.splitlines()
        assert lines, "no error on stderr"
        assert lines[-1].startswith("error: ")
        assert not any(line.startswith("Traceback") for line in lines)
        return lines[-1].removeprefix("error: ")


@pytest.fixture(scope="session", autouse=True)
def commands_made_once():
    """Typer puts all commands together anew whenever the program runs, which it does hundreds of times here."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("service.cli.main.get_command", functools.cache(get_command))
        yield


def call(*words):
    """Run one command in this process."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main([str(word) for word in words])
    return Answer(code, out.getvalue(), err.getvalue())


def write_runs(folder, *, slopes=SLOPES, passport=PASSPORT, spoil=None):
    """A folder as a Chrono program leaves it: one gzipped CSV per slope. `spoil` names a slope whose file has a nan."""
    (folder / "runs").mkdir(parents=True)
    (folder / "passport.json").write_text(json.dumps(passport))
    with (folder / "runs.csv").open("w", newline="") as table:
        rows = csv.writer(table)
        rows.writerow(["file", "set", "slope_deg", "mass_kg", "torque_nm", "horizon_s"])
        for slope in slopes:
            file = f"runs/s{slope:g}.csv.gz"
            rows.writerow([file, "steep" if slope >= 24 else "gentle", slope, 430, 60, 4])
            (folder / file).write_bytes(gzip.compress(_run(slope, spoilt=slope == spoil), mtime=0))
    return folder


def _run(slope, spoilt):
    time = np.linspace(0.0, 4.0, 201)
    x = (0.4 - 0.01 * slope) * (time - 0.2 * (1.0 - np.exp(-time)))
    y = 0.24 - 0.001 * time
    if spoilt:
        y[7] = np.nan
    lines = [f"{a:.9g},{b:.9g},{c:.9g}," for a, b, c in zip(time, x, y, strict=True)]
    return ("time_s,rear_x_m,rear_y_m,\n" + "\n".join(lines) + "\n").encode()


@pytest.fixture(scope="session")
def small_store(tmp_path_factory):
    """A store that no test changes: dataset `small`, model `rover` version 1, alias champion."""
    root = tmp_path_factory.mktemp("cli")
    folder, store = write_runs(root / "runs"), root / "store"
    imported = call("datasets", "import", folder, "--name", "small", "--store", store)
    assert imported.code == 0, imported.err
    trained = call(
        *("train", "--dataset", "small", "--model", "rover", "--test-slope-deg", "22", *TRAIN),
        *("--promote", "champion", "--actor", "tests", "--store", store),
    )
    assert trained.code == 0, trained.err
    return store


@pytest.fixture
def store(small_store, tmp_path) -> Path:
    """A copy of it, to change."""
    return Path(shutil.copytree(small_store, tmp_path / "store"))


@dataclass(frozen=True)
class Serving:
    """A running `rover-twin serve`."""

    process: subprocess.Popen
    address: str
    store: Path


def start(*words):
    """One command in a process of its own, without settings from this one's environment."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("ROVER_TWIN_")}
    return subprocess.Popen(
        [sys.executable, "-m", "service", *map(str, words)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
    )


def serve(store):
    """Start a server of the store and wait until it is ready."""
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        port = found.getsockname()[1]
    process = start("serve", "--port", port, "--model", "rover", "--log-level", "warning", "--store", store)
    serving = Serving(process, f"http://127.0.0.1:{port}", store)
    deadline = time.monotonic() + 90
    while not _ready(serving):
        if process.poll() is not None or time.monotonic() > deadline:
            process.kill()
            pytest.fail(f"the server is not ready: {process.communicate()[1]}")
        time.sleep(0.1)
    return serving


def _ready(serving):
    try:
        return httpx.get(f"{serving.address}/health/ready", timeout=5).status_code == 200
    except httpx.TransportError:
        return False


@pytest.fixture(scope="session")
def serving(small_store, processes):
    """One server for tests that only ask."""
    serving = serve(small_store)
    yield serving
    serving.process.kill()
    serving.process.communicate()
