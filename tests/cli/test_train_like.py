"""`train --like`: the same weights again from nothing but a manifest, and what is said when they differ."""

from __future__ import annotations

import json

import pytest

from model_store import Lineage, ManifestDraft, ModelStore
from service.cli.actions.retraining import config_like, likeness
from service.cli.failures import ExitCode, UsageError
from tests.cli.conftest import call

AGAIN = ("--no-publish", "--threads", "1")


@pytest.mark.slow
def test_a_version_made_again_has_the_same_weights(small_store):
    original = ModelStore.open(small_store).manifest("rover", 1)
    for reference in ("rover", "rover@1", "rover@champion"):
        answer = call("train", "--like", reference, *AGAIN, "--json", "--store", small_store).json
        assert answer["like"] == {
            "version": "rover@1",
            "weights_sha256": original.files["weights.safetensors"].sha256,
            "same_weights": True,
            "changes": [],
        }
        assert answer["weights_sha256"] == original.files["weights.safetensors"].sha256
        assert answer["test"]["runs"] == 1
    told = call("train", "--like", "rover@1", *AGAIN, "--store", small_store)
    assert "the same weights as rover@1" in told.out


def test_what_is_published_again_has_the_same_bytes_and_can_be_made_again(store):
    answer = call("train", "--like", "rover@1", "--model", "other", "--threads", "1", "--json", "--store", store).json
    assert answer["published"] == {"name": "other", "version": 1}
    opened = ModelStore.open(store)
    weights = [opened.read_file(opened.manifest(name, 1), "weights.safetensors") for name in ("rover", "other")]
    assert weights[0] == weights[1]
    again = call("train", "--like", "other@1", *AGAIN, "--json", "--store", store).json
    assert again["like"]["same_weights"]


def test_the_very_datasets_are_taken_whatever_their_names_mean_now(store):
    opened = ModelStore.open(store)
    (identity,) = opened.manifest("rover", 1).lineage.datasets
    record = store / "datasets" / identity / "dataset.json"
    record.write_text(json.dumps(json.loads(record.read_text()) | {"name": "renamed"}))
    assert call("train", "--like", "rover@1", *AGAIN, "--json", "--store", store).json["like"]["same_weights"]


@pytest.mark.slow
def test_options_take_precedence_and_explain_other_weights(small_store):
    told = call("train", "--like", "rover@1", "--seed", "9", "--prior", "rigid_slope", *AGAIN, "--store", small_store)
    assert told.code == 0, told.err
    assert "other weights than rover@1" in told.out
    assert "seed was 1, is 9" in told.out
    assert "prior was motor_slope, is rigid_slope" in told.out
    # an option that repeats its own default is still an option that was given
    longer = call("train", "--like", "rover@1", "--rows-per-epoch", "301", *AGAIN, "--json", "--store", small_store)
    assert longer.json["like"]["changes"] == ["rows_per_epoch was 300, is 301"]
    default = call("train", "--like", "rover@1", "--batch-rows", "512", *AGAIN, "--json", "--store", small_store).json
    assert default["like"]["changes"] == ["batch_rows was 64, is 512"]


@pytest.mark.parametrize(("done", "best", "cut"), [(7, 5, True), (9, 4, False), (10, 9, False), (0, 0, False)])
def test_a_fit_whose_time_was_up_is_named_as_the_reason(small_store, done, best, cut):
    first = ModelStore.open(small_store).manifest("rover", 1)
    fit = first.lineage.config["fit"] | {"epochs": 10, "patience_epochs": 5}
    lineage = first.lineage.model_copy(update={"config": first.lineage.config | {"fit": fit}})
    metrics = first.metrics | {"fit": {"epochs": done, "best_epoch": best}}
    manifest = first.model_copy(update={"lineage": lineage, "metrics": metrics})
    told = likeness(manifest, config_like(manifest, {}), "00").changes
    assert told == (("its time was up after epoch 7 of 10",) if cut else ())


def _publish(store, lineage):
    draft = ManifestDraft(created_by="tests", checkpoint={}, domain={}, metrics={}, lineage=lineage)
    ModelStore.open(store).publish("odd", {"weights.safetensors": b"w"}, draft)


@pytest.mark.parametrize(
    ("lineage", "code", "says"),
    [
        (Lineage(), ExitCode.USAGE, "--like odd@1: its manifest keeps no config"),
        (Lineage(config={"model": "odd"}), ExitCode.USAGE, "--like odd@1: datasets"),
        (Lineage(config={"model": "odd", "from": "later"}, datasets=["ab" * 32]), ExitCode.USAGE, "--like odd@1: from"),
        (Lineage(config={"model": "odd"}, datasets=["ab" * 32]), ExitCode.NOT_FOUND, "abab"),
    ],
)
def test_a_manifest_that_does_not_say_how_is_refused(store, lineage, code, says):
    _publish(store, lineage)
    answer = call("train", "--like", "odd", *AGAIN, "--store", store)
    assert answer.code == code
    assert says in answer.error


@pytest.mark.parametrize(
    ("words", "code", "says"),
    [
        (("--like", "absent"), ExitCode.NOT_FOUND, "absent"),
        (("--like", "rover@7"), ExitCode.NOT_FOUND, "7"),
        (("--like", "rover@1", "--epochs", "0"), ExitCode.USAGE, "epochs is 0"),
        (("--like", "rover@1", "--input", "slope_deg"), ExitCode.USAGE, "time_s first"),
        (("--model", "rover"), ExitCode.USAGE, "--dataset is missing"),
        (("--dataset", "small"), ExitCode.USAGE, "--model is missing"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_errors(small_store, words, code, says):
    answer = call("train", *words, *AGAIN, "--store", small_store)
    assert answer.code == code
    assert says in answer.error


def test_a_version_of_a_former_architecture_names_it_among_the_changes(small_store):
    original = ModelStore.open(small_store).manifest("rover", 1)
    config = {**original.lineage.config, "architecture": "resistance_process"}
    manifest = original.model_copy(update={"lineage": original.lineage.model_copy(update={"config": config})})
    with pytest.raises(UsageError, match="architecture: Input should be 'drive_model'"):
        config_like(manifest, {})
    told = likeness(manifest, config_like(manifest, {"architecture": "zero"}), "00").changes
    assert "architecture was resistance_process, is zero" in told
