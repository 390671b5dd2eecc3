"""Help, version, exit codes and one-line errors, whatever the command."""

from __future__ import annotations

import subprocess
import sys

import pytest
from typer.main import get_command

import service
from service.cli.failures import ExitCode
from service.cli.main import program
from tests.cli.conftest import SCENARIO, call


def _commands(command=None, words=()):
    command = command or get_command(program())
    yield words
    for name, below in getattr(command, "commands", {}).items():
        yield from _commands(below, (*words, name))


@pytest.mark.slow
@pytest.mark.parametrize("words", list(_commands()), ids=" ".join)
def test_every_command_has_help_with_examples(words):
    answer = call(*words, "--help")
    assert answer.code == 0
    assert "Usage: rover-twin" in answer.out
    is_group = len(words) == 0 or words in (("models",), ("datasets",), ("jobs",), ("tokens",))
    assert is_group or "Example" in answer.out


def test_help_documents_every_exit_code():
    text = " ".join(call("--help").out.split())
    for code in ExitCode:
        assert f"{code.value} " in text.partition("Exit codes:")[2]


@pytest.mark.processes
def test_help_needs_neither_torch_nor_the_web_nor_arrow():
    program = (
        "import sys; from service.cli.main import main; code = main(['train', '--help']); "
        "heavy = {'torch', 'fastapi', 'pyarrow', 'numpy', 'obstore'} & set(sys.modules); "
        "sys.exit(str(heavy) if heavy or code else 0)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr


def test_version():
    assert call("--version").out == f"rover-twin {service.__version__}\n"


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("fly",), "fly"),
        (("predict",), "--slope-deg"),
        (("predict", *SCENARIO, "--gravity", "2"), "--gravity"),
        (("predict", "--slope-deg", "steep", "--mass-kg", "1", "--torque-nm", "1"), "--slope-deg"),
        (("models", "alias", "rover", "champion", "newest", "--reason", "x"), "VERSION"),
        (("serve", "--port", "70000"), "0 to 65535"),
    ],
)
def test_wrong_usage_is_one_line_and_code_2(words, says):
    answer = call(*words)
    assert answer.code == ExitCode.USAGE
    assert says in answer.error
    assert len(answer.err.splitlines()) == 1
    assert answer.out == ""


def test_no_command_shows_the_help_and_fails():
    answer = call()
    assert answer.code == ExitCode.USAGE
    assert "datasets" in answer.out


@pytest.mark.parametrize(
    "words",
    [
        ("predict", *SCENARIO),
        ("models", "list"),
        ("models", "show", "rover"),
        ("models", "history", "rover", "champion"),
        ("models", "rollback", "rover", "champion", "--reason", "x"),
        ("datasets", "list"),
        ("datasets", "show", "small"),
        ("jobs", "list"),
        ("jobs", "show", "0f0e3b5c-6b43-4d0f-a5a5-3a7d3f0b8a10"),
        ("evaluate", "rover", "--dataset", "small"),
        ("serve",),
    ],
    ids=" ".join,
)
def test_commands_that_only_read_make_no_store(words, tmp_path):
    answer = call(*words, "--store", tmp_path / "absent")
    assert answer.code == ExitCode.FAILED
    assert "absent" in answer.error
    assert not (tmp_path / "absent").exists()


def test_debug_adds_the_traceback(tmp_path):
    answer = call("--debug", "models", "list", "--store", tmp_path / "absent")
    assert answer.code == ExitCode.FAILED
    assert "Traceback" in answer.err
    assert answer.err.splitlines()[-1].startswith("error: ")


def test_the_store_can_come_from_the_environment(small_store, monkeypatch):
    monkeypatch.setenv("ROVER_TWIN_STORE_URL", str(small_store))
    assert call("models", "list", "--json").json["models"][0]["name"] == "rover"


@pytest.mark.slow
def test_openapi_prints_the_document():
    document = call("openapi").json
    assert document["openapi"].startswith("3.")
    assert "/v1/predictions" in document["paths"]
