"""The files of the page, as HTTP sends them: public, careful, small, and nothing else of the disk."""

from __future__ import annotations

import hashlib
import re
import zlib
from pathlib import Path

import pytest

from service.api.page import PATHS

FOLDER = Path(__file__).parents[2] / "service" / "page"
SENT = sorted(PATHS)
MOST_BYTES = 1_500_000
MOST_LINES = 400


@pytest.mark.parametrize("path", SENT)
def test_every_file_is_sent_with_careful_headers(service, path):
    answer = service.get(path)

    assert answer.status_code == 200
    assert "default-src 'none'" in answer.headers["content-security-policy"]
    assert "unsafe" not in answer.headers["content-security-policy"]
    assert answer.headers["x-content-type-options"] == "nosniff"
    assert answer.headers["cache-control"] == "no-cache"
    again = service.client.get(path, headers={"If-None-Match": answer.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")
    assert "content-security-policy" in again.headers
    head = service.client.head(path)
    assert head.status_code == 200
    assert head.headers["content-type"] == answer.headers["content-type"]


def test_a_coding_is_sent_to_who_accepts_it_and_means_the_same(service):
    for path in SENT:
        plain = service.client.get(path, headers={"Accept-Encoding": "identity"})
        assert "content-encoding" not in plain.headers
        for coding in ("gzip", "zstd"):
            packed = service.client.get(path, headers={"Accept-Encoding": coding})
            assert packed.content == plain.content  # as the client unpacks it
            if len(plain.content) > 2000:
                assert packed.headers["content-encoding"] == coding
            if "content-encoding" in packed.headers:
                assert packed.headers["etag"] != plain.headers["etag"]


def test_all_of_it_weighs_little():
    files = [path for path in FOLDER.rglob("*") if path.suffix in (".html", ".css", ".js", ".svg")]
    assert sum(len(zlib.compress(path.read_bytes(), 1)) for path in files) < MOST_BYTES / 5


@pytest.mark.parametrize(
    "path",
    [
        "/page/",
        "/page/README.md",
        "/page/vendor/README.md",
        "/page/..%2fapp.py",
        "/page/%2e%2e/%2e%2e/pyproject.toml",
        "/page//etc/passwd",
        "/page/views",
        "/page/index.html/",
        "/page/main.js%00",
        "/index.html",
    ],
)
def test_nothing_else_is_sent(service, path):
    assert service.get(path).status_code == 404


def test_the_files_of_others_are_those_that_were_released():
    told = dict(re.findall(r"\| `([\w.]+)` \| `([0-9a-f]{64})` \|", (FOLDER / "vendor" / "README.md").read_text()))
    there = {path.name for path in (FOLDER / "vendor").iterdir()} - {"README.md", "LICENSE.uPlot"}

    assert set(told) == there
    for name, digest in told.items():
        assert hashlib.sha256((FOLDER / "vendor" / name).read_bytes()).hexdigest() == digest


def test_our_files_name_no_other_host_and_are_short():
    for path in FOLDER.rglob("*"):
        if path.suffix in (".js", ".html", ".css") and path.parent.name != "vendor":
            text = path.read_text(encoding="utf-8")
            assert not re.search(r"https?://(?!www\.w3\.org/)", text), path
            assert "innerHTML" not in text, path
            assert text.count("\n") < MOST_LINES, path


def test_the_ranges_are_those_of_the_api(service):
    fields = service.get("/page/fields.json").json()
    document = service.get("/openapi.json").json()

    for name, path in {"prediction": "/v1/predictions", "mobility": "/v1/mobility"}.items():
        for parameter in document["paths"][path]["get"]["parameters"]:
            told = fields[name]["properties"][parameter["name"]]
            for bound in ("minimum", "maximum"):
                assert told.get(bound) == parameter["schema"].get(bound)
    upload = document["paths"]["/v1/admin/datasets"]["post"]["requestBody"]["content"]["multipart/form-data"]["schema"]
    assert fields["upload"]["properties"].keys() == upload["properties"].keys() - {"file", "dry_run"}
    training = document["components"]["schemas"]["TrainingJobRequest"]["properties"]
    assert fields["training"]["properties"].keys() == training.keys()
    assert {name: told.get("enum") for name, told in fields["training"]["properties"].items()} == {
        name: told.get("enum") for name, told in training.items()
    }


def test_behind_a_proxy_with_a_prefix_every_address_is_relative():
    for path in FOLDER.rglob("*.html"):
        assert re.findall(r'(?:href|src)="(?!page/|#|docs|openapi\.json)[^"]*"', path.read_text()) == []
    for path in FOLDER.rglob("*.js"):
        if path.parent.name != "vendor":
            assert re.findall(r"""["'`]/(?:v1|page|health)""", path.read_text()) == [], path
