"""What HTTP asks of every address alike."""

from __future__ import annotations

from typing import Any

import httpx
import pytest

from tests.api.http.test_connections import answer_of, connect

PREDICTION = "/v1/predictions?slope_deg=20&mass_kg=430&torque_nm=60"


@pytest.mark.parametrize("path", ["/health/live", "/health/ready", PREDICTION, "/v1/models", "/docs", "/metrics"])
def test_head_is_get_without_its_body(service: Any, path: str) -> None:
    got, head = service.client.get(path), service.client.head(path)

    assert head.status_code == got.status_code == 200
    assert head.content == b""
    assert head.headers["content-type"] == got.headers["content-type"]
    assert head.headers.get("etag") == got.headers.get("etag")


def test_head_of_nothing_is_404(service: Any) -> None:
    assert service.client.head("/nowhere").status_code == 404


def test_a_connection_goes_on_after_a_head(service: Any) -> None:
    with connect(service.url) as connection:
        for _ in range(3):
            connection.sendall(b"HEAD /v1/models HTTP/1.1\r\nHost: a\r\n\r\n")
            assert connection.recv(65536).startswith(b"HTTP/1.1 200 ")
        connection.sendall(b"GET /health/live HTTP/1.1\r\nHost: a\r\nConnection: close\r\n\r\n")
        assert b'"alive"' in answer_of(connection)


def test_a_request_without_host_is_refused(service: Any) -> None:
    with connect(service.url) as connection:
        connection.sendall(b"GET /health/live HTTP/1.1\r\n\r\n")
        assert answer_of(connection).startswith(b"HTTP/1.1 400 ")


def test_http_1_0_needs_no_host(service: Any) -> None:
    with connect(service.url) as connection:
        connection.sendall(b"GET /health/live HTTP/1.0\r\n\r\n")
        assert answer_of(connection).startswith(b"HTTP/1.1 200 ")


def test_a_body_in_an_unknown_coding_is_415(service: Any) -> None:
    headers = {"Content-Encoding": "br", "Content-Type": "application/json"}
    answer = service.client.post("/v1/predictions", content=b"{}", headers=headers)

    assert answer.status_code == 415
    assert "br" in answer.json()["detail"]


def test_any_version_will_do_is_304(service: Any) -> None:
    assert service.client.get(PREDICTION, headers={"If-None-Match": "*"}).status_code == 304


def test_browsers_are_told_to_be_careful(service: Any) -> None:
    for path in ("/docs", PREDICTION, "/nowhere"):
        assert service.client.get(path).headers["x-content-type-options"] == "nosniff"
    assert "default-src 'none'" in service.client.get("/docs").headers["content-security-policy"]


def test_no_page_elsewhere_may_call_unless_allowed(service: Any, serve: Any) -> None:
    asked = {"Origin": "https://planner.example"}
    assert "access-control-allow-origin" not in service.client.get("/health/live", headers=asked).headers

    allowing = serve(cors_origins=("https://planner.example",))
    answer = allowing.client.get("/health/live", headers=asked)
    assert answer.headers["access-control-allow-origin"] == "https://planner.example"
    other = allowing.client.get("/health/live", headers={"Origin": "https://other.example"})
    assert "access-control-allow-origin" not in other.headers


def test_a_prefix_of_a_proxy(serve: Any) -> None:
    running = serve(root_path="/twin")
    with httpx.Client(base_url=running.url, trust_env=False) as client:
        assert client.get("/health/live").status_code == 200
        assert "/twin/openapi.json" in client.get("/docs").text
