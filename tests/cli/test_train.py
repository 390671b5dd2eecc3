"""`train`: reproducible, resumable, and honest about what it publishes."""

from __future__ import annotations

import shlex
import signal
import time
from dataclasses import asdict

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.main import get_command

from service.cli.actions.command_line import command_line
from service.cli.failures import ExitCode
from service.cli.main import program
from service.learning.network.fit_config import FitConfig
from service.training.config import TrainingConfig
from tests.cli.conftest import TRAIN, call, start

_BASE = ("train", "--dataset", "small", "--model", "rover")


def _digest(store, *more):
    answer = call(*_BASE, *TRAIN, *more, "--no-publish", "--json", "--store", store)
    assert answer.code == 0, answer.err
    return answer.json["weights_sha256"]


def test_publishes_a_version_and_says_how_good_it_is(store):
    answer = call(*_BASE, *TRAIN, "--test-slope-deg", "24", "--actor", "me", "--store", store)
    assert answer.code == 0
    assert "published rover@2" in answer.out
    assert "test runs, never seen in training (1)" in answer.out
    assert "prior alone" in answer.out
    assert "epoch 2/2" in answer.err
    manifest = call("models", "show", "rover@2", "--json", "--store", store).json
    assert manifest["created_by"] == "me"
    assert manifest["lineage"]["split"]["test"] == ["s24"]
    assert call("models", "list", "--json", "--store", store).json["models"][0]["aliases"] == {"champion": 1}


def test_json_says_what_was_published_and_promoted(store):
    answer = call(*_BASE, *TRAIN, "--promote", "candidate", "--json", "--store", store).json
    assert answer["published"] == {"name": "rover", "version": 2}
    assert answer["promoted"] == "rover@candidate"
    assert answer["test"] == {"runs": 0}
    assert answer["train"]["model"]["final_m"]["median"] >= 0


@pytest.mark.slow
def test_the_seed_decides_the_weights(small_store):
    assert _digest(small_store, "--seed", "3") == _digest(small_store, "--seed", "3")
    assert _digest(small_store, "--seed", "3") != _digest(small_store, "--seed", "4")


def test_the_published_weights_are_those_reported(store):
    answer = call(*_BASE, *TRAIN, "--json", "--store", store).json
    manifest = call("models", "show", "rover@2", "--json", "--store", store).json
    assert manifest["files"]["weights.safetensors"]["sha256"] == answer["weights_sha256"]


def test_the_recorded_command_trains_the_same_weights_again(store):
    first = call("models", "show", "rover@1", "--json", "--store", store).json
    words = shlex.split(first["lineage"]["command"])
    assert words[0] == "rover-twin"
    again = call(*words[1:], "--threads", "1", "--json", "--store", store).json
    assert again["weights_sha256"] == first["files"]["weights.safetensors"]["sha256"]


_CONFIGS = st.builds(
    TrainingConfig,
    model=st.sampled_from(["rover", "r-2"]),
    datasets=st.lists(st.sampled_from(["small", "ab12cd", "it's"]), min_size=1, max_size=2),
    prior=st.sampled_from(["rigid_slope", "motor_slope"]),
    architecture=st.sampled_from(["paper_network", "zero"]),
    inputs=st.sampled_from([["time_s"], ["time_s", "slope_deg"], ["time_s", "mass_kg", "torque_ratio"]]),
    x_form=st.sampled_from(["position", "mean_speed"]),
    test_slopes_deg=st.lists(st.floats(-45, 45), max_size=2),
    test_fraction=st.floats(0, 0.9),
    description=st.sampled_from(["", "a rover's twin", '--json "x" $HOME']),
    fit=st.builds(FitConfig, seed=st.integers(0, 99), epochs=st.integers(1, 99), learning_rate=st.floats(1e-8, 1)),
)


_COMMANDS = get_command(program())


@pytest.mark.slow
@settings(max_examples=60)
@given(config=_CONFIGS)
def test_the_command_line_of_a_config_has_the_options_of_that_config(config):
    program, *words = shlex.split(command_line(config))
    name, command, rest = _COMMANDS.resolve_command(None, words)
    options = command.make_context(name, rest).params
    expected = config.model_dump(exclude={"fit"}) | asdict(config.fit)
    given_options = {field: options[field] for field in expected} | {
        "test_slopes_deg": options["test_slopes_deg"] or []
    }
    assert program == "rover-twin"
    assert given_options == expected


_LONG = (
    "--epochs",
    "150",
    "--rows-per-epoch",
    "64",
    "--batch-rows",
    "64",
    "--threads",
    "1",
    "--patience-epochs",
    "150",
)


@pytest.fixture(scope="module")
def undisturbed(small_store):
    """The digest of the weights of the long training."""
    return call(*_BASE, *_LONG, "--no-publish", "--json", "--store", small_store).json["weights_sha256"]


@pytest.mark.kills
@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGINT])
def test_killed_and_resumed_is_the_same_as_undisturbed(store, undisturbed, tmp_path, end):
    """The process is ended from outside while it fits; the same command then goes on from the saved state."""
    state = tmp_path / "fit.state"
    words = [*_BASE, *_LONG, "--store", str(store)]
    process = start(*words, "--state", state)
    deadline = time.monotonic() + 60
    while not state.exists() and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.02)
    process.send_signal(end)
    out, err = process.communicate(timeout=30)
    assert "published" not in out
    assert call("models", "list", "--json", "--store", store).json["models"][0]["versions"] == [1]
    if end == signal.SIGINT:
        assert process.returncode == ExitCode.INTERRUPTED, err
        assert "Traceback" not in err
        assert "the same command goes on" in err
    resumed = call(*words, "--state", state, "--json")
    assert "going on after epoch" in resumed.err
    assert not state.exists()
    assert resumed.json["weights_sha256"] == undisturbed


def test_a_finished_state_publishes_without_training_again(store, tmp_path):
    state = ("--state", tmp_path / "fit.state")
    digest = _digest(store, *state)
    published = call(*_BASE, *TRAIN, *state, "--json", "--store", store)
    assert "going on after epoch 2 of 2" in published.err
    assert published.json["weights_sha256"] == digest


def test_a_state_of_another_training_is_refused(store, tmp_path):
    state = tmp_path / "fit.state"
    _digest(store, "--state", state)
    before = state.read_bytes()
    other = call(*_BASE, *TRAIN, "--seed", "9", "--state", state, "--store", store)
    assert other.code == ExitCode.USAGE
    assert "seed is 1 there, 9 here" in other.error
    assert state.read_bytes() == before


@pytest.mark.slow
@pytest.mark.parametrize(
    ("damage", "code"),
    [
        (lambda _: b"hello", ExitCode.USAGE),
        (lambda content: content[:-5], ExitCode.FAILED),
        (lambda content: content[:40], ExitCode.FAILED),
    ],
    ids=["no state", "truncated weights", "truncated header"],
)
def test_a_damaged_state_is_refused(store, tmp_path, damage, code):
    state = tmp_path / "fit.state"
    _digest(store, "--state", state)
    state.write_bytes(damage(state.read_bytes()))
    answer = call(*_BASE, *TRAIN, "--state", state, "--store", store)
    assert answer.code == code
    assert "state" in answer.error


@pytest.mark.parametrize(
    ("more", "code", "says"),
    [
        (("--epochs", "0"), ExitCode.USAGE, "epochs is 0, allowed is 1 to 100000"),
        (("--test-fraction", "2"), ExitCode.USAGE, "test_fraction"),
        (("--input", "slope_deg"), ExitCode.USAGE, "time_s first"),
        (("--input", "time_s", "--input", "colour"), ExitCode.USAGE, "colour"),
        (("--prior", "guess"), ExitCode.USAGE, "--prior"),
        (("--threads", "0"), ExitCode.USAGE, "threads is 0"),
        (("--model", "Not A Name"), ExitCode.USAGE, "Not A Name"),
        (("--promote", "7"), ExitCode.USAGE, "7"),
        (("--promote", "champion", "--no-publish"), ExitCode.USAGE, "--no-publish"),
        (("--dataset", "absent"), ExitCode.NOT_FOUND, "absent"),
        (("--test-slope-deg", "77"), ExitCode.FAILED, "77"),
        (("--dataset", "small"), ExitCode.FAILED, "more than one"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_errors_come_before_anything_is_published(store, more, code, says):
    answer = call(*_BASE, *TRAIN, *more, "--store", store)
    assert answer.code == code
    assert says in answer.error
    assert call("models", "list", "--json", "--store", store).json["models"][0]["versions"] == [1]
