"""`models`: looking, verifying, moving aliases and taking moves back."""

from __future__ import annotations

import pytest

from model_store import ModelStore
from service.cli.failures import ExitCode
from tests.cli.conftest import call


def _publish_again(store):
    """A second version with the first one's content."""
    opened = ModelStore.open(store)
    first = opened.manifest("rover", 1)
    files = {path: opened.read_file("rover", 1, path) for path in first.files}
    from model_store import ManifestDraft

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
    assert listed == {"models": [{"name": "rover", "versions": [1], "aliases": {"champion": 1}}]}
    assert "champion=1" in call("models", "list", "--store", store).out


@pytest.mark.parametrize("reference", ["rover", "rover@1", "rover@champion"])
def test_show_has_domain_errors_and_lineage(small_store, reference):
    shown = call("models", "show", reference, "--json", "--store", small_store).json
    assert shown["name"] == "rover"
    assert shown["lineage"]["command"].startswith("rover-twin train ")
    text = call("models", "show", reference, "--store", small_store).out
    for word in ("slope_deg", "final position", "prior alone", shown["lineage"]["datasets"][0]):
        assert word in text


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
        (("rollback", "absent", "champion", "--reason", "x"), ExitCode.NOT_FOUND),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_errors(small_store, words, code):
    answer = call("models", *words, "--store", small_store)
    assert answer.code == code
    assert answer.error
    assert answer.out == ""
