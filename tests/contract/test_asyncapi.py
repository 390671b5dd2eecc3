"""`docs/asyncapi.yaml` is what the wire models say: `python -m tests.contract.test_asyncapi` writes it."""

from __future__ import annotations

import json
import re
from contextlib import ExitStack
from pathlib import Path

import jsonschema_rs
import pytest
import yaml
from websockets.sync.client import connect

from service.api.v1.live_document import asyncapi_document
from tests.api.v1.stepping import begin, go_on, stepping

PAGE = Path(__file__).parents[2] / "docs" / "asyncapi.yaml"
HEAD = "# Generated from the wire models: python -m tests.contract.test_asyncapi\n"


class Dumper(yaml.SafeDumper):
    """Text of several lines stays so."""


def _represent(dumper: Dumper, said: str) -> yaml.Node:
    style = "|" if "\n" in said else None
    return dumper.represent_scalar("tag:yaml.org,2002:str", said, style=style)


Dumper.add_representer(str, _represent)


def text() -> str:
    return HEAD + yaml.dump(asyncapi_document(), Dumper=Dumper, sort_keys=False, allow_unicode=True, width=120)


def test_the_file_is_what_the_models_say():
    assert PAGE.read_text(encoding="utf-8") == text(), "run python -m tests.contract.test_asyncapi"


def test_every_reference_leads_somewhere():
    document = yaml.safe_load(PAGE.read_text(encoding="utf-8"))
    references = re.findall(r"\$ref: '?(#/[^\s']+)", PAGE.read_text(encoding="utf-8"))
    assert references
    for reference in set(references):
        node = document
        for part in reference.removeprefix("#/").split("/"):
            node = node[part]


@pytest.fixture(scope="module")
def validators():
    document = yaml.safe_load(PAGE.read_text(encoding="utf-8"))
    schemas = document["components"]["schemas"]

    def of(message: str):
        root = {"components": {"schemas": schemas}, **document["components"]["messages"][message]["payload"]}
        return jsonschema_rs.validator_for(root)

    return {name: of(name) for name in document["components"]["messages"]}


MESSAGES = [
    ({"rovers": [begin("a"), begin("b", brake=True)]}, "moved"),
    ({"rovers": [go_on("a"), go_on("nobody")], "include": ["state"]}, "moved"),
    ({"remove": ["b"], "rovers": [go_on("a")]}, "moved"),
    ({"remove": ["a"]}, "moved"),
    ({}, "moved"),
    ({"rovers": 5}, "refused"),
    ({"rovers": [go_on("a")], "bogus": 1}, "refused"),
]


def test_what_is_said_over_a_connection_is_what_the_document_says(tmp_path, validators):
    with ExitStack() as stack:
        running = stack.enter_context(stepping(tmp_path / "store", live_idle_s=1.0))
        address = running.url.replace("http", "ws", 1) + "/v1/live"
        client = stack.enter_context(connect(address, proxy=None))
        for message, answer in MESSAGES:
            assert validators["step"].is_valid(message) == (answer == "moved"), message
            client.send(json.dumps(message))
            validators[answer].validate(json.loads(client.recv(timeout=20)))
        validators["parting"].validate(json.loads(client.recv(timeout=20)))


if __name__ == "__main__":
    PAGE.write_text(text(), encoding="utf-8")
