"""Drives and live steps with both clients, against the real service with its shipped model; servers die underway."""

from __future__ import annotations

import asyncio
import os
import signal
import socket
import socketserver
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from rover_twin_client import (
    AsyncRoverTwin,
    ConnectionFailedError,
    Drive,
    FailedDrive,
    InvalidInputError,
    Moment,
    NotFoundError,
    OutsideDomainError,
    RoverStep,
    RoverTwin,
    UnexpectedAnswerError,
)
from service.local import load
from tests.clients.served import wait_until_ready
from tests.digits import HALF

pytestmark = pytest.mark.processes

REPOSITORY = Path(__file__).parents[2]
TRACK = {"distance_m": [0, 2, 2.3], "slope_deg": [10, 10, 20]}
CONTROLS = {"time_s": [0, 6, 8], "torque_nm": [100, 0, 110], "brake": [False, True, False]}


@contextmanager
def serving(folder: Path, port: int) -> Iterator[subprocess.Popen[bytes]]:
    log = folder / "log.txt"
    command = [sys.executable, "-m", "service", "serve", "--host", "127.0.0.1", "--port", str(port)]
    environment = {k: v for k, v in os.environ.items() if not k.startswith("ROVER_TWIN_")}
    with (
        log.open("a") as sink,
        subprocess.Popen(command, cwd=REPOSITORY, env=environment, stdout=sink, stderr=sink) as process,
    ):
        try:
            wait_until_ready(f"http://127.0.0.1:{port}", process, log)
            yield process
        finally:
            process.kill()


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        return int(listener.getsockname()[1])


@contextmanager
def relay(port: int, target: int | None) -> Iterator[None]:
    """Passes every connection to `port` on to a `target` that listens already."""

    def passed(source: socket.socket, sink: socket.socket) -> None:
        with suppress(OSError):
            while content := source.recv(65536):
                sink.sendall(content)
            sink.shutdown(socket.SHUT_WR)

    class Handler(socketserver.BaseRequestHandler):
        def handle(self) -> None:
            with socket.create_connection(("127.0.0.1", target or 0)) as there, ThreadPoolExecutor(2) as pool:
                pool.submit(passed, self.request, there)
                pool.submit(passed, there, self.request)

    class Server(socketserver.ThreadingTCPServer):
        allow_reuse_address, daemon_threads, block_on_close = True, True, False

    with Server(("127.0.0.1", port), Handler) as server:
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        yield
        server.shutdown()
        thread.join(10)


@pytest.fixture(scope="module")
def url(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    port = free_port()
    with serving(tmp_path_factory.mktemp("service"), port):
        yield f"http://127.0.0.1:{port}"


def test_a_drive_is_that_of_the_twin_itself(url: str, ask: Any) -> None:
    found = ask(url, "drive", 430, TRACK, CONTROLS, until_distance_m=4, include=["band", "wheel_speed"])
    own = load().drive(430, TRACK, CONTROLS, until_distance_m=4, include=["band", "wheel_speed"])

    assert isinstance(found, Drive)
    np.testing.assert_allclose(found.x_m, own.trajectory["x_m"], rtol=0, atol=HALF)
    np.testing.assert_allclose(found.slip_ratio, own.trajectory["slip_ratio"], rtol=0, atol=HALF)
    assert found.brake.tolist() == own.trajectory["brake"].tolist()
    assert [each.event for each in found.events] == [each.event for each in own.events]
    assert found.summary.arrival_time_s == pytest.approx(own.summary.arrival_time_s)
    assert found.summary.probabilities is not None
    assert sum(found.summary.probabilities.values()) == pytest.approx(1)
    assert found.band is not None
    assert (found.band.x_lower_m <= found.x_m).all()
    assert found.rear_wheel_speed_rad_s is not None


def test_arrays_will_do(url: str, ask: Any) -> None:
    track = {name: np.array(values) for name, values in TRACK.items()}

    assert ask(url, "drive", 430, track, np.float32(100), times_s=np.array([1.0, 5.0])).time_s.tolist() == [1.0, 5.0]


def test_an_elevation_in_the_world_frame(url: str, ask: Any) -> None:
    found = ask(url, "drive", 430, {"horizontal_m": [0, 10], "elevation_m": [0, 2]}, 100, frame="world")

    assert found.y_m is None
    assert found.z_m is not None
    rise = (found.z_m[-1] - found.z_m[100]) / (found.x_m[-1] - found.x_m[100])
    assert rise == pytest.approx(0.2, abs=0.01)


def test_a_batch_says_what_is_wrong_with_one(url: str, ask: Any) -> None:
    drives = [
        {"mass_kg": 430, "track": TRACK, "controls": 100},
        {"mass_kg": -1, "track": TRACK, "controls": 100},
        {"mass_kg": 600, "track": TRACK, "controls": CONTROLS, "horizon_s": 5},
    ]
    first, second, third = ask(url, "drive_batch", drives, dt_s=0.5)

    assert isinstance(first, Drive)
    assert isinstance(third, Drive)
    assert third.time_s[-1] == 5
    assert isinstance(second, FailedDrive)
    assert second.index == 1
    assert second.faults[0].field == "mass_kg"


def test_drives_of_a_batch_share_a_track(url: str, ask: Any) -> None:
    drives = [{"mass_kg": 430}, {"mass_kg": 600, "controls": 60}]
    both = ask(url, "drive_batch", drives, track=TRACK, controls=100, horizon_s=5, dt_s=0.5)

    for mass_kg, torque_nm, drive in zip((430, 600), (100, 60), both, strict=True):
        alone = ask(url, "drive", mass_kg, TRACK, torque_nm, horizon_s=5, dt_s=0.5)
        np.testing.assert_allclose(drive.x_m, alone.x_m, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("arguments", "field"),
    [
        ((430, {"distance_m": [0, 2, 1], "slope_deg": [1, 1, 1]}, 100), "track.distance_m"),
        ((430, {"distance_m": [0, float("nan")], "slope_deg": [1, 1]}, 100), "track.distance_m"),
        ((430, TRACK, {"time_s": [-1], "torque_nm": [1]}), "controls.time_s"),
        ((430, TRACK, "much"), "controls"),
        (("heavy", TRACK, 100), "mass_kg"),
        ((430, "steep", 100), "track"),
        ((0, TRACK, 100), "mass_kg"),
    ],
)
def test_what_is_refused_is_named(url: str, ask: Any, arguments: tuple[Any, ...], field: str) -> None:
    with pytest.raises(InvalidInputError) as refused:
        ask(url, "drive", *arguments)
    assert refused.value.faults[0].field.startswith(field)


def test_strict_refuses_what_nobody_knows(url: str, ask: Any) -> None:
    with pytest.raises(OutsideDomainError):
        ask(url, "drive", 5000, TRACK, 100, strict=True)


@pytest.mark.parametrize("transport", ["websocket", "http"])
def test_live_steps_are_those_of_the_twin_itself(url: str, transport: Any) -> None:
    own = load().live()
    own.start("rover", mass_kg=430, slope_deg=10)
    with RoverTwin(url) as twin, twin.live(transport=transport) as live:
        live.start("rover", mass_kg=430)
        for at in range(40):
            slope, torque = 10 + 0.2 * at, 90.0 + at
            moment = live.step("rover", slope, torque, 0.07, brake=at == 20)
            expected = own.step("rover", slope_deg=slope, torque_nm=torque, dt_s=0.07, brake=at == 20)
            assert moment.x_m == pytest.approx(expected.x_m[0], abs=1e-9)
            assert moment.speed_m_s == pytest.approx(expected.speed_m_s[0], abs=1e-9)


def test_many_rovers_in_one_message(url: str) -> None:
    with RoverTwin(url) as twin, twin.live() as live:
        names = [f"rover-{at}" for at in range(50)]
        for at, name in enumerate(names):
            live.start(name, mass_kg=400 + at)
        for _ in range(3):
            moments = live.step_many(RoverStep(name, 10, 100, dt_s=0.1) for name in names)
    assert [each.id for each in moments] == names
    assert len({each.x_m for each in moments}) == len(names)


def test_a_refused_step_leaves_the_rover_where_it_was(url: str) -> None:
    with RoverTwin(url) as twin, twin.live() as live:
        live.start("rover", mass_kg=430)
        before = live.step("rover", 10, 100, 1.0)
        with pytest.raises(InvalidInputError, match="slope_deg is 80"):
            live.step("rover", 80, 100, 1.0)
        after = live.step("rover", 10, 100, 1.0)
        with pytest.raises(InvalidInputError, match="started or resumed"):
            live.step("stranger", 10, 100)
    assert after.time_s == pytest.approx(before.time_s + 1.0)


def test_another_client_goes_on(url: str) -> None:
    with RoverTwin(url) as twin, twin.live() as live, twin.live(transport="http") as other:
        live.start("rover", mass_kg=430)
        for _ in range(10):
            live.step("rover", 12, 100, 0.1)
        other.resume(live.states)
        assert other.step("rover", 12, 100, 0.1).x_m == live.step("rover", 12, 100, 0.1).x_m


@pytest.mark.kills
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM])
def test_a_killed_server_loses_no_step(tmp_path: Path, how: signal.Signals) -> None:
    """The next server at the same address goes on where the last answer was."""
    port = free_port()
    own = load().live()
    own.start("rover", mass_kg=430, slope_deg=15)
    with RoverTwin(f"http://127.0.0.1:{port}") as twin, twin.live() as live:
        live.start("rover", mass_kg=430)
        for _ in range(2):
            with serving(tmp_path, port) as process:
                for _ in range(10):
                    moment = live.step("rover", 15, 100, 0.05)
                    expected = own.step("rover", slope_deg=15, torque_nm=100, dt_s=0.05)
                process.send_signal(how)
                process.wait(timeout=60)
        assert moment.x_m == pytest.approx(expected.x_m[0], abs=1e-9)
        began = time.monotonic()
        with pytest.raises(ConnectionFailedError):
            live.step("rover", 15, 100, 0.05)
        assert 5 <= time.monotonic() - began < 10
        assert set(live.states) == {"rover"}


@pytest.mark.parametrize("transport", ["websocket", "http"])
def test_a_step_waits_for_a_server_that_restarts(url: str, transport: Any) -> None:
    port = free_port()
    with RoverTwin(f"http://127.0.0.1:{port}") as twin, twin.live(transport=transport) as live:
        live.start("rover", mass_kg=430)
        with ThreadPoolExecutor(1) as pool:
            waiting = pool.submit(live.step, "rover", 15, 100, 0.05)
            time.sleep(2)
            assert not waiting.done()
            with relay(port, httpx.URL(url).port):
                assert waiting.result(30).time_s == pytest.approx(0.05)


@pytest.mark.parametrize("transport", ["websocket", "http"])
def test_a_client_without_retries_tries_once(transport: Any) -> None:
    with RoverTwin(f"http://127.0.0.1:{free_port()}", retries=0) as twin, twin.live(transport=transport) as live:
        live.start("rover", mass_kg=430)
        began = time.monotonic()
        with pytest.raises(ConnectionFailedError):
            live.step("rover", 15, 100)
        assert time.monotonic() - began < 3


def test_an_address_that_is_no_service_is_not_tried_again(url: str) -> None:
    with RoverTwin(f"{url}/elsewhere") as twin, twin.live() as live:
        live.start("rover", mass_kg=430)
        began = time.monotonic()
        with pytest.raises(UnexpectedAnswerError):
            live.step("rover", 15, 100)
        assert time.monotonic() - began < 3


@pytest.mark.parametrize("transport", ["websocket", "http"])
def test_threads_take_turns(url: str, transport: Any) -> None:
    with RoverTwin(url) as twin, twin.live(transport=transport) as live, ThreadPoolExecutor(8) as pool:
        names = [f"rover-{at}" for at in range(8)]
        for at, name in enumerate(names):
            live.start(name, mass_kg=400 + at)
        moments = list(pool.map(lambda at: live.step(names[at % 8], 10, 100, 0.1), range(80)))
        assert [each.id for each in moments] == names * 10
        assert {name: live.step(name, 10, 100, 0.1).time_s for name in names} == pytest.approx(
            dict.fromkeys(names, 1.1)
        )


def test_tasks_take_turns_and_a_cancelled_one_takes_no_answer_along(url: str) -> None:
    async def drive() -> list[Moment]:
        async with AsyncRoverTwin(url) as twin, twin.live() as live:
            for name in "abcd":
                live.start(name, mass_kg=430)
            moments = await asyncio.gather(*(live.step(name, 10, 100, 0.1) for name in "abcd" * 5))
            given_up = asyncio.create_task(live.step("a", 10, 100, 0.1))
            await asyncio.sleep(0)
            await asyncio.sleep(0)
            given_up.cancel()
            return [*moments, await live.step("b", 10, 100, 0.1)]

    *moments, last = asyncio.run(drive())
    assert [each.id for each in moments] == list("abcd" * 5)
    assert (last.id, last.time_s) == ("b", pytest.approx(0.6))


@pytest.mark.parametrize("transport", ["websocket", "http"])
def test_a_closed_live_does_not_come_back(url: str, transport: Any) -> None:
    with RoverTwin(url) as twin:
        with twin.live(transport=transport) as live:
            live.start("rover", mass_kg=430)
            live.step("rover", 10, 100)
        with pytest.raises(RuntimeError, match="closed"):
            live.step("rover", 10, 100)
        assert set(live.states) == {"rover"}


def test_the_asynchronous_client_steps_too(url: str) -> None:
    async def drive() -> Moment:
        async with AsyncRoverTwin(url) as twin, twin.live() as live:
            live.start("rover", mass_kg=430)
            for _ in range(20):
                moment = await live.step("rover", 10, 100, 0.1)
            return moment

    assert asyncio.run(drive()).time_s == pytest.approx(2.0)


def test_a_message_that_is_refused_whole_says_why(url: str) -> None:
    with RoverTwin(url) as twin, twin.live(model="nobody") as live:
        live.start("rover", mass_kg=430)
        with pytest.raises(NotFoundError, match="no model 'nobody'"):
            live.step("rover", 10, 100)
