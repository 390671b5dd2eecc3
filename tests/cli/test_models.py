"""`models`: looking, verifying, moving aliases and taking moves back."""

from __future__ import annotations

import shutil

import pytest

from model_store import Lineage, ManifestDraft, ModelStore
from service.cli.failures import ExitCode
from tests.cli.conftest import call


def _publish_again(store):
    """A second version with the first one's content."""
    opened = ModelStore.open(store)
    first = opened.manifest("rover", 1)
    files = {path: opened.read_file(first, path) for path in first.files}
    draft = ManifestDraft(
        created_by="tests",
        description="second",
        checkpoint=first.checkpoint,
        domain=first.domain,
        metrics=first.metrics,
        lineage=first.lineage,
    )
    return opened.publish("rover", files, draft).version


def test_list(store):
    listed = call("models", "list", "--json", "--store", store).json
    retired = {"archived": [], "deleted": []}
    assert listed == {"models": [{"name": "rover", "versions": [1], **retired, "aliases": {"champion": 1}}]}
    assert "champion=1" in call("models", "list", "--store", store).out


@pytest.mark.parametrize("reference", ["rover", "rover@1", "rover@champion"])
def test_show_has_domain_errors_and_lineage(small_store, reference):
    shown = call("models", "show", reference, "--json", "--store", small_store).json
    assert shown["name"] == "rover"
    assert shown["lineage"]["command"].startswith("rover-twin train ")
    text = call("models", "show", reference, "--store", small_store).out
    for word in ("slope_deg", "final position", "prior alone", shown["lineage"]["datasets"][0]):
        assert word in text


def test_show_prints_the_lineage(store):
    opened = ModelStore.open(store)
    first = opened.manifest("rover", 1)
    lineage = first.lineage.model_copy(update={"job": "job-7"})
    draft = {name: getattr(first, name) for name in ManifestDraft.model_fields} | {"lineage": lineage}
    opened.publish("rover", {"weights.safetensors": b"w"}, ManifestDraft(**draft), once_key="job-7")
    text = call("models", "show", "rover@2", "--store", store).out
    expected = ["job-7", "(small)", lineage.datasets[0], "epochs 2", "seed", lineage.code_version]
    expected += ["3 to train on, 1 to test on", "architecture paper_network", "rover-twin train --like rover@2"]
    expected += [f"{name} {version}" for name, version in lineage.libraries.items()]
    for word in expected:
        assert word in text
    assert {"scipy", "dbos", "torch", "python"} <= lineage.libraries.keys()
    assert call("models", "show", "rover@2", "--json", "--store", store).json["lineage"]["job"] == "job-7"


def test_show_says_which_datasets_are_gone(store):
    shutil.rmtree(store / "datasets")
    text = call("models", "show", "rover", "--store", store).out
    assert "(no longer in the store)" in text
    assert "none: not trained by a job" in text


def _publish_with_errors(store, error_m, **more):
    """A version with these errors (m) on eight left-out runs."""
    opened = ModelStore.open(store)
    run = {"slope_deg": 20.0, "mass_kg": 430.0, "torque_nm": 60.0, "horizon_s": 4.0, "final_x_m": 1.0}
    errors = dict.fromkeys(("rmse_m", "final_m", "maximum_m"), error_m)
    left_out = {"by_run": [{"run": f"r{number}", **run, "model": errors} for number in range(8)]}
    draft = ManifestDraft(
        created_by="tests", checkpoint={}, domain={}, metrics={"left_out": left_out}, lineage=Lineage(**more)
    )
    return opened.publish("rover", {"weights.safetensors": b"w"}, draft).version


def test_compare_says_which_is_better_and_why(store):
    worse, better = _publish_with_errors(store, 0.1), _publish_with_errors(store, 0.05)
    told = call("models", "compare", f"rover@{better}", f"rover@{worse}", "--store", store)
    assert told.code == 0
    assert told.out.startswith(f"rover@{better} is better than rover@{worse}: over 8 runs")
    assert "0.500" in told.out
    answer = call("models", "compare", f"rover@{worse}", f"rover@{better}", "--json", "--store", store).json
    assert (answer["verdict"], answer["ratio"], answer["promote"]) == ("not_better", pytest.approx(2), False)
    strict = call(
        "models", "compare", f"rover@{better}", f"rover@{worse}", "--margin", "0.5", "--json", "--store", store
    )
    assert strict.json["margin"] == 0.5


def test_compare_takes_the_champion_where_nothing_else_is_named(store):
    better = _publish_with_errors(store, 0.05)
    against_champion = call("models", "compare", f"rover@{better}", "--json", "--store", store).json
    assert (against_champion["against"], against_champion["verdict"]) == ("rover@1", "not_comparable")
    for record in (store / "models/rover/aliases/champion").iterdir():
        record.unlink()
    assert call("models", "compare", f"rover@{better}", "--json", "--store", store).json["verdict"] == "first"


def test_show_without_a_champion_is_the_newest_version(store):
    for record in (store / "models/rover/aliases/champion").iterdir():
        record.unlink()
    assert _publish_again(store) == 2
    assert call("models", "show", "rover", "--json", "--store", store).json["version"] == 2
    assert call("models", "show", "rover@champion", "--store", store).code == ExitCode.NOT_FOUND


def test_alias_history_and_rollback(store):
    assert _publish_again(store) == 2
    moved = call("models", "alias", "rover", "champion", "2", "--reason", "better", "--actor", "me", "--store", store)
    assert moved.code == 0
    assert moved.out == "rover@champion now means version 2\n"
    back = call("models", "rollback", "rover", "champion", "--reason", "worse", "--json", "--store", store).json
    assert back["version"] == 1
    history = call("models", "history", "rover", "champion", "--json", "--store", store).json["history"]
    assert [(each["version"], each["reason"]) for each in history[:2]] == [(1, "worse"), (2, "better")]
    assert history[1]["actor"] == "me"
    nothing_left = call("models", "rollback", "rover", "champion", "--reason", "again", "--store", store)
    assert nothing_left.code == ExitCode.FAILED


def test_a_move_that_says_where_the_alias_must_be_overwrites_nobody(store):
    move = ("models", "alias", "rover", "champion", "1", "--reason", "again", "--store", store)
    assert call(*move, "--if-at", "1").code == ExitCode.DONE
    late = call(*move, "--if-at", "1")
    assert (late.code, "2" in late.error) == (ExitCode.REFUSED, True)
    back = call("models", "rollback", "rover", "champion", "--reason", "x", "--if-at", "1", "--store", store)
    assert back.code == ExitCode.REFUSED
    assert call("models", "alias", "rover", "new", "1", "--reason", "x", "--if-at", "0", "--store", store).code == 0
    history = call("models", "history", "rover", "champion", "--json", "--store", store).json["history"]
    assert [move["seq"] for move in history] == [2, 1]


def test_an_alias_does_not_move_to_a_damaged_version(store):
    assert _publish_again(store) == 2
    (store / "models/rover/versions/2/weights.safetensors").write_bytes(b"")
    answer = call("models", "alias", "rover", "champion", "2", "--reason", "better", "--store", store)
    assert answer.code == ExitCode.FAILED
    assert call("models", "list", "--json", "--store", store).json["models"][0]["aliases"] == {"champion": 1}


def test_verify_checks_everything_and_names_the_damage(store):
    assert call("models", "verify", "--store", store).out == "rover@1 whole\n"
    assert _publish_again(store) == 2
    (store / "models/rover/versions/1/report/test.json").write_bytes(b"{}")
    answer = call("models", "verify", "--json", "--store", store)
    assert answer.code == ExitCode.FAILED
    assert "report/test.json" in answer.error
    damage = {each["version"]: each["damage"] for each in answer.json["versions"]}
    assert damage["rover@2"] is None
    assert "test.json" in damage["rover@1"]
    assert call("models", "verify", "rover@2", "--store", store).code == 0


def test_list_shows_what_is_readable_and_fails_for_the_rest(store):
    (record,) = (store / "models/rover/aliases/champion").iterdir()
    record.write_text("{")
    answer = call("models", "list", "--store", store)
    assert answer.code == ExitCode.FAILED
    assert "rover" in answer.error


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (("show", "absent"), ExitCode.NOT_FOUND),
        (("show", "rover@7"), ExitCode.NOT_FOUND),
        (("show", "rover@0"), ExitCode.USAGE),
        (("verify", "absent"), ExitCode.NOT_FOUND),
        (("alias", "rover", "champion", "7", "--reason", "x"), ExitCode.NOT_FOUND),
        (("alias", "rover", "7", "1", "--reason", "x"), ExitCode.USAGE),
        (("alias", "rover", "Best", "1", "--reason", "x"), ExitCode.USAGE),
        (("history", "rover", "candidate"), ExitCode.NOT_FOUND),
        (("compare", "rover@7", "rover@1"), ExitCode.NOT_FOUND),
        (("compare", "rover@1", "absent"), ExitCode.NOT_FOUND),
        (("compare", "rover@1", "rover@1", "--margin", "0.6"), ExitCode.USAGE),
        (("rollback", "absent", "champion", "--reason", "x"), ExitCode.NOT_FOUND),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_errors(small_store, words, code):
    answer = call("models", *words, "--store", small_store)
    assert answer.code == code
    assert answer.error
    assert answer.out == ""


def test_versions_are_archived_restored_and_deleted(store):
    _publish_again(store)
    said = ("--reason", "for a test", "--actor", "ada", "--store", store)
    archived = call("models", "archive", "rover", "2", "--json", *said).json
    assert (archived["state"], archived["actor"], archived["reason"]) == ("archived", "ada", "for a test")
    refused = call("models", "alias", "rover", "champion", "2", "--reason", "x", "--store", store)
    assert (refused.code, "is archived" in refused.err) == (ExitCode.REFUSED, True)
    assert call("models", "restore", "rover", "2", *said).out == "rover@2 is published\n"
    assert call("models", "delete", "rover", "1", *said).code == ExitCode.REFUSED
    assert call("models", "delete", "rover", "2", *said).out == "rover@2 is deleted\n"
    assert call("models", "restore", "rover", "2", *said).code == ExitCode.REFUSED
    listed = call("models", "list", "--json", "--store", store).json["models"][0]
    assert (listed["versions"], listed["archived"], listed["deleted"]) == ([1], [], [2])
    shown = call("models", "show", "rover@2", "--store", store)
    assert ("rover@2" in shown.out, "deleted by ada: for a test" in shown.err) == (True, True)
    assert call("models", "verify", "--store", store).out == "rover@1 whole\n"
    assert call("models", "archive", "rover", "3", *said).code == ExitCode.NOT_FOUND


def test_the_default_model_of_the_settings_is_kept(store, monkeypatch):
    _publish_again(store)
    monkeypatch.setenv("ROVER_TWIN_DEFAULT_MODEL", "rover@2")
    refused = call("models", "delete", "rover", "2", "--reason", "x", "--store", store)
    assert (refused.code, "default model" in refused.err) == (ExitCode.REFUSED, True)


@pytest.mark.parametrize(("form", "begin"), [("svg", "<?xml"), ("html", "<!DOCTYPE html>"), ("json", "{")])
def test_a_card_and_a_comparison_are_written_in_the_forms_of_the_server(small_store, tmp_path, form, begin):
    for words in (("card", "rover"), ("compare", "rover@1", "rover@1")):
        file = tmp_path / f"{words[0]}.{form}"
        done = call("models", *words, "--format", form, "--output", file, "--store", small_store)
        assert (done.code, done.out) == (0, ""), done.err
        assert file.read_text().startswith(begin)


def test_a_picture_and_json_are_two_answers(small_store):
    done = call("models", "compare", "rover@1", "rover@1", "--json", "--format", "svg", "--store", small_store)

    assert done.code == ExitCode.USAGE
    assert "two answers" in done.error
