"""`/v1/live`: rovers kept by a connection that is bounded in every way, and that hands them back before it ends."""

from __future__ import annotations

import base64
import json
import signal
import socket
import threading
import time
from contextlib import ExitStack

import pytest
from hypothesis import given
from hypothesis import strategies as st
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.frames import Close, Frame, Opcode
from websockets.streams import StreamReader
from websockets.sync.client import ClientConnection, connect

from model_store import ModelStore
from service.twin.load import load_twin
from service.twin.steps import Live
from service.wire.steps.answer import StepsAnswer
from tests.api.conftest import process_serving
from tests.api.v1.stepping import begin, copy_models, go_on, stepping


@pytest.fixture(scope="module")
def steps(tmp_path_factory):
    with stepping(tmp_path_factory.mktemp("live")) as running:
        yield running


def open_live(url: str, **how) -> ClientConnection:
    address = url.replace("http", "ws", 1) + "/v1/live"
    return connect(address, proxy=None, compression=None, max_size=None, **how)


def ask(client: ClientConnection, *rovers, **shared):
    client.send(json.dumps({"rovers": list(rovers), **shared}))
    document = json.loads(client.recv(timeout=20))
    StepsAnswer.model_validate(document)
    return document


def moved(client: ClientConnection, *rovers, **shared):
    document = ask(client, *rovers, **shared)
    assert not document["errors"], document["errors"]
    return document["rovers"]


LIKELY = st.fixed_dictionaries(
    {},
    optional={
        "slope_deg": st.floats(-40, 40) | st.sampled_from([90.0, None, "1", 10**400]),
        "torque_nm": st.floats(0, 200) | st.sampled_from([None, -1.0]),
        "brake": st.booleans() | st.just(1),
        "dt_s": st.floats(0.001, 0.6) | st.sampled_from([2.5, 0.0]),
        "unknown": st.just(1),
    },
)


def as_frames(text: bytes, kind: Opcode, pieces: int, *, pings: bool) -> bytes:
    """A client's message in so many frames, pings between them."""
    size = -(-len(text) // pieces)
    sent = b""
    for at in range(pieces):
        piece = Frame(kind if at == 0 else Opcode.CONT, text[at * size : (at + 1) * size], fin=at == pieces - 1)
        sent += piece.serialize(mask=True) + (Frame(Opcode.PING, b"!").serialize(mask=True) if pings else b"")
    return sent


def frames_of(raw: socket.socket):
    """What the server sends, frame by frame."""
    reader = StreamReader()
    while True:
        parsing = Frame.parse(reader.read_exact, mask=False)
        while True:
            try:
                next(parsing)
            except StopIteration as stop:
                yield stop.value
                break
            reader.feed_data(raw.recv(1 << 16))


MESSAGES = st.lists(
    st.tuples(st.sampled_from([Opcode.TEXT, Opcode.BINARY]), st.integers(1, 3), st.booleans()), min_size=1, max_size=8
)


@given(MESSAGES, st.lists(st.integers(1, 400), max_size=12))
def test_messages_are_the_same_however_they_are_cut(steps, messages, cuts):
    raw = handshake(steps.url)
    raw.settimeout(20)
    text = json.dumps({"rovers": [go_on("a")]}).encode()
    stream = as_frames(json.dumps({"rovers": [begin("a")]}).encode(), Opcode.TEXT, 1, pings=False)
    stream += b"".join(as_frames(text, kind, pieces, pings=pings) for kind, pieces, pings in messages)
    with raw:
        raw.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        for size in cuts:
            raw.sendall(stream[:size])
            stream = stream[size:]
            time.sleep(0.001)
        raw.sendall(stream)
        sent = (frame for frame in frames_of(raw) if frame.opcode is not Opcode.PONG)
        answers = [next(sent) for _ in range(1 + len(messages))]
        raw.sendall(as_frames(b"\xff{}", Opcode.TEXT, 1, pings=False))  # text that is none
        end = next(sent)
    assert (end.opcode, Close.parse(end.data).code) == (Opcode.CLOSE, 1007)
    assert [each.opcode for each in answers] == [Opcode.TEXT, *(kind for kind, _, _ in messages)]
    times = [json.loads(each.data)["rovers"][0]["time_s"] for each in answers]
    assert times == pytest.approx([0.1 * (n + 1) for n in range(len(times))])


@given(st.lists(LIKELY, min_size=1, max_size=6))
def test_a_message_of_one_rover_is_answered_as_one_of_many(steps, told):
    with open_live(steps.url) as client:
        moved(client, begin("a"), begin("b"))
        for each in told:
            one, other = go_on("a") | each, go_on("b") | each
            client.send(json.dumps({"rovers": [one]}))
            client.send(json.dumps({"rovers": [other], "include": []}))  # no short way for this
            first, second = client.recv(timeout=20), client.recv(timeout=20)
            assert first == second.replace('"id":"b"', '"id":"a"')


def test_a_connection_says_what_steps_say_and_keeps_rovers(steps):
    live = Live(load_twin(ModelStore.open(str(steps.folder)), "viper-lunar", 5))
    live.start("a", mass_kg=430, slope_deg=20)
    with open_live(steps.url) as client:
        for count in range(10):
            told = {"slope_deg": 20 + count, "brake": count == 5}
            (found,) = moved(client, go_on("a", **told) if count else begin("a", **told))
            expected = live.step("a", torque_nm=60, dt_s=0.1, **told)
            assert found["x_m"] == expected.x_m[0]
            assert found["x_half_width_m"] == expected.x_half_width_m[0]
            assert "state" not in found
        (found,) = moved(client, go_on("a"), include=["state"])
        live.step("a", slope_deg=20, torque_nm=60, dt_s=0.1)
        assert base64.b64decode(found["state"]) == live.states()["a"]
        (over_http,) = steps.client.post("/v1/steps", json={"rovers": [go_on("a", found["state"])]}).json()["rovers"]
        assert moved(client, go_on("a"))[0]["x_m"] == over_http["x_m"]


def test_messages_of_bytes_are_answered_with_bytes(steps):
    with open_live(steps.url) as client:
        client.send(json.dumps({"rovers": [begin()]}).encode())
        assert isinstance(client.recv(timeout=20), bytes)


@pytest.mark.parametrize(
    ("message", "kind"),
    [
        ('{"rovers":', "malformed-body"),
        ("", "malformed-body"),
        (b"\xff\x00\x80rubbish", "malformed-body"),
        (b"\x00" * 5000, "malformed-body"),
        ("[" * 5000, "malformed-body"),
        ("[]", "invalid-input"),
        ('{"rovers": 5}', "invalid-input"),
        ('{"rovers": [], "bogus": 1}', "invalid-input"),
        ('{"rovers": [], "rovers": []}', "invalid-input"),
        ('{"rovers": [1], "include": ["band"]}', "invalid-input"),
        ('{"rovers": [1], "include": "state"}', "invalid-input"),
        ('{"remove": [1]}', "invalid-input"),
        ('{"rovers": [1], "model": "nobody"}', None),
        (json.dumps({"rovers": [begin(f"r{n}") for n in range(1001)]}), "invalid-input"),
    ],
)
def test_a_wrong_message_is_answered_with_its_problem_and_the_rovers_stay(steps, message, kind):
    with open_live(steps.url) as client:
        moved(client, begin("kept"))
        client.send(message)
        error = json.loads(client.recv(timeout=20))
        if kind:
            assert error["error"]["type"].endswith(kind)
        assert moved(client, go_on("kept"))[0]["time_s"] == pytest.approx(0.2)


@given(st.binary(max_size=200) | st.text(max_size=200))
def test_any_message_is_answered(steps, message):
    with open_live(steps.url) as client:
        client.send(message)
        json.loads(client.recv(timeout=20))
        moved(client, begin())


def test_errors_of_a_rover_do_not_stop_the_others(steps):
    with open_live(steps.url) as client:
        document = ask(client, begin("a"), go_on("unknown"), begin("b", dt_s=0), go_on("c", "rubbish"))
        assert [each["id"] for each in document["rovers"]] == ["a"]
        assert {each["id"]: each["errors"][0]["field"] for each in document["errors"]} == {
            "unknown": "id",
            "b": "dt_s",
            "c": "state",
        }


def test_rovers_are_bounded_and_forgotten_on_demand(tmp_path):
    with stepping(tmp_path / "store", max_live_rovers=3) as running, open_live(running.url) as client:
        moved(client, *(begin(name) for name in "abc"))
        (error,) = ask(client, go_on("a"), begin("d"))["errors"]
        assert "3" in error["detail"]
        assert moved(client, go_on("a"), remove=["b"])[0]["id"] == "a"
        assert moved(client, begin("d"), go_on("a"), go_on("c"))
        client.send('{"remove": ["a", "c", "d", "never was"]}')
        assert json.loads(client.recv(timeout=20))["rovers"] == []
        assert ask(client, go_on("a"))["errors"]


def test_a_thousand_rovers_over_one_connection(steps):
    with open_live(steps.url) as client:
        states = moved(client, *(begin(f"r{n}") for n in range(1000)), include=["state"])
        assert len(moved(client, *(go_on(each["id"], each["state"]) for each in states))) == 1000


def test_a_message_that_is_too_long_ends_the_connection(steps):
    with open_live(steps.url) as client:
        client.send("x" * (5 << 20))
        began = time.monotonic()
        with pytest.raises(ConnectionClosed) as closed:
            client.recv(timeout=20)
    assert closed.value.rcvd.code == 1009
    assert time.monotonic() - began < 10


def test_connections_are_bounded(tmp_path):
    with stepping(tmp_path / "store", max_live_connections=1) as running:
        with open_live(running.url), pytest.raises(InvalidStatus) as refused:
            open_live(running.url).close()
        assert refused.value.response.status_code == 503
        assert json.loads(refused.value.response.body)["type"].endswith("overloaded")


def test_an_idle_connection_gets_its_rovers_back(tmp_path):
    with stepping(tmp_path / "store", live_idle_s=0.5) as running, open_live(running.url) as client:
        moved(client, begin("a"))
        parting = json.loads(client.recv(timeout=20))
        assert parting["event"] == "idle"
        with pytest.raises(ConnectionClosed) as closed:
            client.recv(timeout=20)
        assert closed.value.rcvd.code == 4408
        assert "idle" in closed.value.rcvd.reason
        with open_live(running.url) as again:
            assert moved(again, go_on("a", parting["rovers"][0]["state"]))[0]["time_s"] == pytest.approx(0.2)


def handshake(url: str) -> socket.socket:
    host, port = url.removeprefix("http://").split(":")
    raw = socket.socket()
    raw.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    raw.connect((host, int(port)))
    key = "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
    raw.sendall(f"GET /v1/live HTTP/1.1\r\nHost: x\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n{key}".encode())
    assert b"101" in raw.recv(4096)
    return raw


def frame(content: bytes) -> bytes:
    """A masked text frame; the mask is zero."""
    length = len(content)
    head = bytes([0x81, 0x80 | 127]) + length.to_bytes(8, "big")
    return head + bytes(4) + content


def test_a_client_that_does_not_read_is_dropped_with_code_and_reason_and_hinders_nobody(tmp_path):
    with stepping(tmp_path / "store", live_slow_s=0.5) as running:
        raw = handshake(running.url)
        message = frame(json.dumps({"rovers": [begin(f"r{n}") for n in range(500)], "include": ["state"]}).encode())

        def send_on() -> None:
            try:
                for _ in range(200):
                    raw.sendall(message)
            except OSError:
                pass

        sending = threading.Thread(target=send_on, daemon=True)
        sending.start()
        with open_live(running.url) as other:
            moved(other, begin("a"))
            deadline = time.monotonic() + 20
            while 'reason="slow"} 1.0' not in running.get("/metrics").text and time.monotonic() < deadline:
                moved(other, go_on("a"))
                time.sleep(0.05)
            assert 'reason="slow"} 1.0' in running.get("/metrics").text
        received = b""
        raw.settimeout(5)
        try:
            while more := raw.recv(1 << 20):
                received += more
        except OSError:
            pass
        assert b"slow reader" in received[-200:]
        assert (1008).to_bytes(2, "big") + b"slow" in received[-200:]
        raw.close()
        sending.join(timeout=10)


def test_a_connection_is_seen_in_the_metrics(tmp_path):
    with stepping(tmp_path / "store") as running:
        with open_live(running.url) as client:
            moved(client, begin("a"), begin("b"))
            text = running.get("/metrics").text
            assert "rover_twin_live_connections 1.0" in text
            assert "rover_twin_live_rovers 2.0" in text
        deadline = time.monotonic() + 10
        while "rover_twin_live_connections 0.0" not in running.get("/metrics").text and time.monotonic() < deadline:
            time.sleep(0.02)
        text = running.get("/metrics").text
        assert "rover_twin_live_connections 0.0" in text
        assert "rover_twin_live_rovers 0.0" in text
        assert 'rover_twin_live_connections_ended_total{reason="closed"} 1.0' in text


def test_a_plain_request_is_told_to_open_a_connection(steps):
    answer = steps.client.get("/v1/live")

    assert (answer.status_code, answer.headers["upgrade"]) == (426, "websocket")
    assert answer.json()["type"] == "urn:rover-twin:problem:upgrade-required"
    assert "open a WebSocket here" in answer.json()["detail"]
    assert steps.client.post("/v1/live", json={}).status_code == 405


def test_another_address_is_no_connection(steps):
    with pytest.raises(InvalidStatus):
        connect(steps.url.replace("http", "ws", 1) + "/v1/admin/live", proxy=None).close()
    with pytest.raises(InvalidStatus):
        connect(steps.url.replace("http", "ws", 1) + "/v1/nothing", proxy=None).close()


def test_the_end_of_a_server_hands_every_rover_back_to_go_on_elsewhere(tmp_path, steps):
    with ExitStack() as server:
        running = server.enter_context(stepping(tmp_path / "store"))
        with open_live(running.url) as client:
            last = moved(client, begin("a"), begin("b"), begin("c", dt_s=0.5))
            server.close()
            parting = json.loads(client.recv(timeout=20))
            assert parting["event"] == "draining"
            with pytest.raises(ConnectionClosed) as closed:
                client.recv(timeout=20)
    assert closed.value.rcvd.code == 1001
    assert "draining" in closed.value.rcvd.reason
    states = {each["id"]: each["state"] for each in parting["rovers"]}
    assert list(states) == ["a", "b", "c"]
    with open_live(steps.url) as again:
        further = moved(again, *(go_on(name, state) for name, state in states.items()))
    assert [each["time_s"] for each in further] == pytest.approx([each["time_s"] + 0.1 for each in last])


@pytest.mark.processes
@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2])
def test_a_server_that_is_told_to_end_drains_all_of_its_connections(tmp_path, workers):
    copy_models(tmp_path / "store")
    store = ModelStore.open(str(tmp_path / "store"), create=True)
    with process_serving(store, workers=workers, drain_s=0.2) as (client, process), ExitStack() as opened:
        url = str(client.base_url).rstrip("/")
        clients = [opened.enter_context(open_live(url)) for _ in range(6)]
        for each in clients:
            moved(each, begin("a"))
        process.send_signal(signal.SIGTERM)
        for each in clients:
            assert json.loads(each.recv(timeout=20))["rovers"][0]["id"] == "a"
            with pytest.raises(ConnectionClosed) as closed:
                each.recv(timeout=20)
            assert closed.value.rcvd.code == 1001
        assert process.wait(timeout=30) in (0, -signal.SIGTERM)


@pytest.mark.processes
@pytest.mark.slow
def test_a_server_that_is_killed_costs_nothing_but_the_step_that_was_not_answered(tmp_path, steps):
    copy_models(tmp_path / "store")
    store = ModelStore.open(str(tmp_path / "store"), create=True)
    with process_serving(store) as (client, process), open_live(str(client.base_url).rstrip("/")) as live:
        (last,) = moved(live, begin("a"), include=["state"])
        process.kill()
        with pytest.raises(ConnectionClosed):
            live.recv(timeout=20)
    with open_live(steps.url) as again:
        assert moved(again, go_on("a", last["state"]))[0]["time_s"] == pytest.approx(0.2)
