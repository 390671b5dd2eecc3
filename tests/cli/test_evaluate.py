"""`evaluate`: errors that tell training runs from others."""

from __future__ import annotations

import pytest

from service.cli.failures import ExitCode
from tests.cli.conftest import call, write_runs


def test_each_run_is_marked_and_groups_do_not_mix(small_store):
    answer = call("evaluate", "rover", "--dataset", "small", "--json", "--store", small_store).json
    assert {run["run"]: run["seen_in"] for run in answer["runs"]} == {
        "s20": "train",
        "s22": "test",
        "s24": "train",
        "s26": "train",
    }
    assert {role: summary["runs"] for role, summary in answer["summary"].items()} == {"train": 3, "test": 1}
    (test,) = (run for run in answer["runs"] if run["seen_in"] == "test")
    assert answer["summary"]["test"]["model"]["final_m"]["maximum"] == test["model"]["final_m"]
    assert answer["summary"]["test"]["prior"]["rmse_m"]["median"] == test["prior"]["rmse_m"]


def test_the_errors_are_those_of_the_manifest(small_store):
    manifest = call("models", "show", "rover", "--json", "--store", small_store).json
    answer = call("evaluate", "rover", "--dataset", "small", "--slope-deg", "22", "--json", "--store", small_store)
    (run,) = answer.json["runs"]
    (known,) = manifest["metrics"]["test"]["by_run"]
    assert run["model"] == pytest.approx(known["model"], rel=1e-4, abs=1e-6)
    assert run["prior"] == pytest.approx(known["prior"], rel=1e-9)


def test_runs_that_the_version_never_heard_of_are_new_and_judged_by_its_domain(store, tmp_path):
    folder = write_runs(tmp_path / "more", slopes=(21.0, 35.0))
    assert call("datasets", "import", folder, "--name", "more", "--store", store).code == 0
    answer = call("evaluate", "rover@1", "--dataset", "more", "--json", "--store", store).json
    assert [(run["seen_in"], run["inside_domain"]) for run in answer["runs"]] == [("new", True), ("new", False)]


def test_another_world_is_warned_about(store, tmp_path):
    from tests.cli.conftest import PASSPORT

    folder = write_runs(tmp_path / "mars", passport=PASSPORT | {"gravity_m_s2": 3.71})
    assert call("datasets", "import", folder, "--name", "mars", "--store", store).code == 0
    answer = call("evaluate", "rover", "--dataset", "mars", "--store", store)
    assert answer.code == 0
    assert "another regolith" in answer.err


def test_the_text_says_which_runs_are_which(small_store):
    text = call("evaluate", "rover", "--dataset", "small", "--store", small_store).out
    assert "runs it was trained on (3)" in text
    assert "test runs, kept apart from its training (1)" in text


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (("absent", "--dataset", "small"), ExitCode.NOT_FOUND),
        (("rover", "--dataset", "absent"), ExitCode.NOT_FOUND),
        (("rover", "--dataset", "small", "--slope-deg", "77"), ExitCode.USAGE),
        (("rover",), ExitCode.USAGE),
        (("rover@", "--dataset", "small"), ExitCode.USAGE),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_errors(small_store, words, code):
    answer = call("evaluate", *words, "--store", small_store)
    assert answer.code == code
    assert answer.error
