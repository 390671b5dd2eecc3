"""An FMU in FMPy, `/v1/live`, `/v1/steps` and this process over one terrain, beside `/v1/drives`: all say the same."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest

from rover_twin_client import RoverTwin
from service.fmu import Fmi, fmu_bytes
from service.local import LocalTwin, load
from tests.clients.test_driving import free_port, serving
from tests.cosimulation.chrono import chrono_drive
from tests.cosimulation.lockstep import FmuPeer, LivePeer, LocalPeer, Peer, Terrain, Told, cells, evenly, ride
from tests.digits import HALF

pytestmark = [pytest.mark.processes, pytest.mark.slow]

TERRAIN = Terrain(np.array([0.0, 1.0, 2.0, 2.6, 4.0, 6.0]), np.array([8.0, 8.0, 20.0, 20.0, 5.0, 12.0]))
CONTROLS = [Told(0, 100, False), Told(5, 0, True), Told(6.3, 110, False), Told(9, 0, False), Told(9.5, 90, False)]
MASS_KG, UNTIL_S = 430.0, 12.0


@pytest.fixture(scope="module")
def url(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    port = free_port()
    with serving(tmp_path_factory.mktemp("service"), port):
        yield f"http://127.0.0.1:{port}"


@pytest.fixture(scope="module")
def twin() -> LocalTwin:
    return load()


def peers(
    url: str, twin: LocalTwin, mass_kg: float, slope_deg: float, folder: Path, stack: ExitStack
) -> dict[str, Peer]:
    file = folder / "viper.fmu"
    file.write_bytes(fmu_bytes(twin.twin, Fmi.THREE))
    return {
        "fmu": FmuPeer(file, mass_kg, folder / "unpacked", stack),
        "live": LivePeer(url, mass_kg, "websocket", stack),
        "steps": LivePeer(url, mass_kg, "http", stack),
        "in-process": LocalPeer(twin, mass_kg, slope_deg),
    }


def test_all_peers_and_the_drive_agree(url: str, twin: LocalTwin, tmp_path: Path) -> None:
    steps = list(cells(CONTROLS, UNTIL_S))
    track = {"distance_m": TERRAIN.distance_m, "slope_deg": TERRAIN.slope_deg}
    controls = {name: [getattr(told, name) for told in CONTROLS] for name in ("time_s", "torque_nm", "brake")}
    times = np.cumsum([step.dt_s for step in steps])
    with ExitStack() as stack:
        client = stack.enter_context(RoverTwin(url))
        drive = twin.drive(MASS_KG, track, controls, times_s=times).trajectory["x_m"]
        over_http = client.drive(MASS_KG, track, controls, times_s=times).x_m
        np.testing.assert_allclose(over_http, drive, rtol=0, atol=HALF)
        for name, peer in peers(url, twin, MASS_KG, TERRAIN.under(0.64), tmp_path, stack).items():
            np.testing.assert_allclose(ride(peer, TERRAIN, steps), drive, rtol=0, atol=1e-9, err_msg=name)
    assert drive[-1] > 5


def test_plain_steps_stay_near_the_drive(twin: LocalTwin) -> None:
    """Of a tenth of a second, with the slope that is looked up half a step ahead."""
    steps = list(evenly(CONTROLS, UNTIL_S, 0.1, 0.05))
    track = {"distance_m": TERRAIN.distance_m, "slope_deg": TERRAIN.slope_deg}
    controls = {name: [getattr(told, name) for told in CONTROLS] for name in ("time_s", "torque_nm", "brake")}
    drive = twin.drive(MASS_KG, track, controls, times_s=0.1 * np.arange(1, len(steps) + 1))
    found = ride(LocalPeer(twin, MASS_KG, TERRAIN.under(0.64)), TERRAIN, steps)

    assert np.abs(found - drive.trajectory["x_m"]).max() < 1e-3


def test_a_drive_of_chrono_is_followed(url: str, twin: LocalTwin, tmp_path: Path) -> None:
    run = chrono_drive("viper_drive01_m690.3_h20")
    steps = list(cells(run.controls, run.until_s))
    at = np.cumsum([step.dt_s for step in steps])
    with ExitStack() as stack:
        found = [
            ride(peer, run.terrain, steps)
            for peer in peers(url, twin, run.mass_kg, run.terrain.under(0.64), tmp_path, stack).values()
        ]
    assert np.ptp(found, axis=0).max() < 1e-9
    assert np.abs(np.interp(at, run.time_s, run.x_m) - found[0]).max() < 0.25  # of 8.7 m, a run of its training
