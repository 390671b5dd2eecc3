"""A client that costs next to nothing: one kept connection, one buffer.

The time a client itself takes is in every number, and would flatter every ratio to a floor: with httpx it is more
than the floor.
"""

from __future__ import annotations

import itertools
import json
import socket
import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from urllib.parse import urlencode

_GOLDEN = 0.6180339887498949  # its multiples fill 0 to 1 evenly
_PLACES = itertools.count()
_LONGEST_HEAD = 65_536
_LAST_CHUNK = b"\r\n0\r\n\r\n"


@dataclass(frozen=True, slots=True)
class Question:
    """One HTTP request."""

    method: str
    path: str
    headers: Mapping[str, str] = field(default_factory=dict)
    body: bytes = b""

    def raw(self, host: str) -> bytes:
        """Its bytes on the wire."""
        headers = {"Host": host, **self.headers} | ({"Content-Length": str(len(self.body))} if self.body else {})
        lines = [f"{self.method} {self.path} HTTP/1.1", *(f"{name}: {value}" for name, value in headers.items())]
        return "\r\n".join([*lines, "", ""]).encode() + self.body


@dataclass(frozen=True, slots=True)
class Answer:
    """One HTTP response."""

    status: int
    headers: Mapping[str, str]
    body: bytes


class Connection:
    """Asks one question after the other; for servers that send a Content-Length or chunks."""

    def __init__(self, host: str, port: int, timeout_s: float = 120.0) -> None:
        self.host = f"{host}:{port}"
        self._socket = socket.create_connection((host, port), timeout_s)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._buffer = memoryview(bytearray(1 << 21))

    def __enter__(self) -> Connection:
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    def exchange(self, raw: bytes) -> tuple[int, int, int]:
        """Send a request, receive all of the answer into the buffer: status, length of the head, length of it all."""
        self._socket.sendall(raw)
        end, at = 0, -1
        while at < 0:
            end += self._more(end)
            at = bytes(self._buffer[: min(end, _LONGEST_HEAD)]).find(b"\r\n\r\n")
        head, start = bytes(self._buffer[:at]).lower(), at + 4
        status = int(head[9:12])
        found = head.find(b"\r\ncontent-length:")
        if found >= 0:
            length = int(head[found + 17 :].split(b"\r\n", 1)[0])
            while end < start + length:
                end += self._more(end)
        elif b"transfer-encoding: chunked" in head:
            while bytes(self._buffer[max(start, end - 7) : end])[-7:] not in (_LAST_CHUNK, _LAST_CHUNK[2:]):
                end += self._more(end)
        return status, start, end

    def ask(self, question: Question, *expected: int) -> Answer:
        """The answer in parts. Chunks are left as they came. Raises RuntimeError for a status not `expected` (200)."""
        status, start, end = self.exchange(question.raw(self.host))
        _, *lines = bytes(self._buffer[: start - 4]).decode("latin-1").split("\r\n")
        answer = Answer(status, dict(line.split(": ", 1) for line in lines), bytes(self._buffer[start:end]))
        if status not in (expected or (200,)):
            raise RuntimeError(f"{question.method} {question.path} was answered with {answer}"[:1000])
        return answer

    def _more(self, end: int) -> int:
        if end == len(self._buffer):  # a longer answer than ever before
            self._buffer = memoryview(bytearray(self._buffer) + bytearray(len(self._buffer)))
        received = self._socket.recv_into(self._buffer[end:])
        if not received:
            raise ConnectionError("the server closed the connection")
        return received


def scenarios(count: int) -> list[dict[str, float]]:
    """The next ones of a fixed sequence inside the domain. None comes twice: nothing can be answered from memory."""
    places = [next(_PLACES) * _GOLDEN % 1.0 for _ in range(count)]
    return [{"slope_deg": 2.0 + 28.0 * place, "mass_kg": 430.0, "torque_nm": 60.0} for place in places]


def single(form: str, dt_s: float, scenario: Mapping[str, float]) -> Question:
    """One prediction as a GET."""
    query = {**scenario, "horizon_s": 10, "dt_s": dt_s, "format": form}
    return Question("GET", "/v1/predictions?" + urlencode(query))


def batch(form: str, dt_s: float, asked: list[dict[str, float]]) -> Question:
    """Many predictions in one request."""
    body = json.dumps({"scenarios": asked, "dt_s": dt_s}).encode()
    return Question("POST", f"/v1/predictions/batch?format={form}", {"Content-Type": "application/json"}, body)


def inference(dt_s: float, asked: list[dict[str, float]], *, binary: bool) -> Question:
    """The same by the Open Inference Protocol; `binary` both ways, as tritonclient asks by default."""
    count, inputs, tail = len(asked), [], b""
    for name in asked[0]:
        values = [scenario[name] for scenario in asked]
        tensor: dict[str, object] = {"name": name, "shape": [count], "datatype": "FP64"}
        if binary:
            tail += struct.pack(f"<{count}d", *values)
            tensor["parameters"] = {"binary_data_size": 8 * count}
        else:
            tensor["data"] = values
        inputs.append(tensor)
    parameters = {"dt_s": dt_s} | ({"binary_data_output": True} if binary else {})
    head = json.dumps({"parameters": parameters, "inputs": inputs}).encode()
    headers = {"Content-Type": "application/octet-stream" if binary else "application/json"}
    if binary:
        headers["Inference-Header-Content-Length"] = str(len(head))
    return Question("POST", "/v2/models/viper-lunar/infer", headers, head + tail)
