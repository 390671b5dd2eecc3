"""`rover-twin tokens`: a token is shown once, listed by name, and revoked."""

from __future__ import annotations

import json

import pytest

from service.access.tokens import Identity, Scope, Tokens
from service.cli.failures import ExitCode
from tests.cli.conftest import call


@pytest.fixture
def file(tmp_path):
    return tmp_path / "tokens"


def test_a_token_is_printed_once_and_opens(file):
    made = call("tokens", "create", "ada", "--scope", "admin", "--file", file)

    assert made.code == ExitCode.DONE, made.err
    token = made.out.strip()
    assert token not in file.read_text() + made.err
    assert Tokens(path=file).holder(token.encode()) == Identity("ada", Scope.ADMIN)


def test_the_file_may_be_that_of_the_service(file, monkeypatch):
    monkeypatch.setenv("ROVER_TWIN_TOKENS_FILE", str(file))
    monkeypatch.setenv("ROVER_TWIN_REQUIRE_TOKEN", "true")
    made = call("tokens", "create", "ada", "--scope", "read", "--json")

    assert sorted(made.json) == ["name", "scope", "token"]
    assert call("tokens", "list", "--json").json == {"tokens": [{"name": "ada", "scope": "read"}]}
    assert "ada" in call("tokens", "list").out
    assert call("tokens", "revoke", "ada").code == ExitCode.DONE
    assert call("tokens", "list", "--json").json == {"tokens": []}


def test_what_is_wrong_is_one_line(file):
    assert "--file" in call("tokens", "create", "ada", "--scope", "read").error
    assert call("tokens", "revoke", "nobody", "--file", file).code == ExitCode.NOT_FOUND
    assert call("tokens", "create", "a b", "--scope", "read", "--file", file).code == ExitCode.USAGE
    assert call("tokens", "create", "ada", "--scope", "all", "--file", file).code == ExitCode.USAGE
    assert not file.exists()
    file.write_text("nonsense\n")
    for words in (("list",), ("create", "ada", "--scope", "read"), ("revoke", "ada")):
        answer = call("tokens", *words, "--file", file)
        assert answer.code == ExitCode.USAGE
        assert "line 1" in answer.error
    assert file.read_text() == "nonsense\n"


def test_a_service_does_not_start_with_a_broken_file(file, monkeypatch, tmp_path):
    digest = "f" * 64
    file.write_text(f"ada admin sha256:{digest}\njoe all sha256:{digest}\n")
    monkeypatch.setenv("ROVER_TWIN_TOKENS_FILE", str(file))

    for workers in ("1", "2"):
        started = call("serve", "--port", "0", "--workers", workers)
        assert started.code == ExitCode.USAGE
        assert "line 2" in started.error
        assert digest not in json.dumps(started.err)
