from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError

from model_store import DatasetNotFoundError, ModelStore
from service.errors import TrainingError
from service.learning.network.fit_config import FitConfig
from service.learning.network.fit_state import FitState
from service.physics.priors import DEFAULT_COEFFICIENTS
from service.physics.scenario import Scenarios
from service.training.architectures import begin_fit
from service.training.config import TrainingConfig
from service.training.data import load_training_data
from service.training.evidence import read_evidence
from service.training.train import prepare, publish_trained
from service.twin.load import load_twin
from tests.training.stored import put_dataset, stored_runs, train_model, varying_runs

QUICK = FitConfig(seed=2, epochs=3, batch_rows=128, rows_per_epoch=512)
WHOLE = {"test_slopes_deg": [], "test_fraction": 0.0}
DRIVES = [run for run in varying_runs() if run.varies]
CONFIG = TrainingConfig(model="unit", datasets=["unit"], test_slopes_deg=[20], test_fraction=0.2, fit=QUICK)


def published(store, config: TrainingConfig = CONFIG):
    return publish_trained(store, config, train_model(store, config), created_by="a test", command="train it")


def test_what_is_published_answers_like_what_was_trained(store):
    trained = train_model(store, CONFIG)
    manifest = publish_trained(store, CONFIG, trained, created_by="a test", command="train it")
    one, times = Scenarios.of(12, 430, 60), np.linspace(0, 4, 20)
    twin = load_twin(store, "unit", manifest.version)
    np.testing.assert_array_equal(twin.model.positions(one, times).x_m, trained.model.positions(one, times).x_m)


class StoppedError(Exception):
    pass


def stop():
    raise StoppedError


def test_who_is_stopped_before_anything_is_written_leaves_nothing(store):
    trained = train_model(store, CONFIG)
    with pytest.raises(StoppedError):
        publish_trained(store, CONFIG, trained, created_by="a test", command="train it", check=stop)
    assert store.model_names() == []


def test_the_manifest_tells_the_whole_lineage(store):
    manifest = published(store)
    lineage = manifest.lineage
    assert lineage.datasets == [store.dataset("unit").id]
    assert TrainingConfig.model_validate(lineage.config) == CONFIG
    assert (lineage.seed, lineage.command) == (2, "train it")
    assert lineage.libraries["torch"].startswith("2.")
    assert set(lineage.split["train"]).isdisjoint(lineage.split["test"])
    assert len(lineage.split["train"] + lineage.split["test"]) == len(stored_runs())
    assert manifest.metrics["test"]["summary"]["runs"] == len(lineage.split["test"])
    assert {"model", "prior"} <= manifest.metrics["test"]["summary"].keys()


def test_test_runs_leave_no_trace_in_the_model(store):
    # calibration, scaling, domain and weights must be those of a store that never held the test runs
    trained = train_model(store, CONFIG)
    kept = {run.name for run in trained.split.train}
    put_dataset(store, "fewer", [run for run in stored_runs() if run.name in kept])
    alone = CONFIG.model_copy(update={"datasets": ["fewer"], "test_slopes_deg": [], "test_fraction": 0.0})
    again = train_model(store, alone)
    assert [run.name for run in again.split.train] == [run.name for run in trained.split.train]
    assert again.model.prior == trained.model.prior
    assert again.model.signature == trained.model.signature
    for name, tensor in again.model.correction.tensors.items():
        np.testing.assert_array_equal(tensor, trained.model.correction.tensors[name], err_msg=name)


@pytest.mark.slow
def test_the_same_config_gives_the_same_weights_and_a_resumed_one_too(store):
    digests = [published(store).files["weights.safetensors"].sha256 for _ in range(2)]
    left = begin_fit(prepare(store, CONFIG, lambda _phase: None))
    next(left.epochs())
    resumed = train_model(store, CONFIG, FitState.from_bytes(left.network.state().to_bytes()))
    manifest = publish_trained(store, CONFIG, resumed, created_by="a test", command="")
    assert {*digests, manifest.files["weights.safetensors"].sha256} == {digests[0]}


def test_reports_are_json_with_every_run(store):
    manifest = published(store)
    for part in ("train", "test"):
        report = json.loads(store.read_file(manifest, f"report/{part}.json"))
        assert [each["run"] for each in report["by_run"]] == manifest.lineage.split[part]


@pytest.fixture(scope="module")
def driven(tmp_path_factory, slow):
    """A store with a drive model of a dozen constant runs and two that vary, and its manifest."""
    store = ModelStore.open(tmp_path_factory.mktemp("driven") / "store", create=True)
    changed = [replace(run, name=f"{run.name}_varies", columns=_further(run.columns)) for run in DRIVES]
    put_dataset(store, "drives", [*stored_runs(), *changed])
    everything = {"datasets": ["drives"], "architecture": "drive_model", **WHOLE}
    return store, published(store, CONFIG.model_copy(update=everything))


def test_slopes_left_out_of_their_series_are_in_the_manifest_and_the_report(driven):
    store, manifest = driven
    rows = manifest.metrics["left_out_slopes"]["by_run"]
    assert sorted(row["slope_deg"] for row in rows) == [0, 5, 10, 15, 20]
    assert {(row["mass_kg"], row["torque_nm"]) for row in rows} == {(430, 60)}
    left_out = {row["run"]: row["model"] for row in manifest.metrics["left_out"]["by_run"]}
    assert all(row["model"] != left_out[row["run"]] for row in rows)
    page = store.read_file(manifest, "report/left_out.md").decode()
    assert "## One slope left out of its series" in page


def test_networks_leave_no_slopes_out(store):
    assert published(store).metrics["left_out_slopes"] == {"summary": {"runs": 0}, "by_run": []}


def test_the_zero_architecture_is_the_calibrated_prior(store):
    trained = train_model(store, CONFIG.model_copy(update={"architecture": "zero", "fit": FitConfig(epochs=1)}))
    for evaluation in trained.train_evaluations:
        assert evaluation.model == evaluation.prior


def test_datasets_of_different_rovers_do_not_mix(store):
    other = stored_runs()[0]
    put_dataset(store, "bigger", [type(other)("other", *_rest(other))], wheel_radius_m=0.3)
    with pytest.raises(TrainingError, match="disagree on the rover"):
        train_model(store, CONFIG.model_copy(update={"datasets": ["unit", "bigger"]}))


def test_a_run_is_not_taken_twice(store):
    put_dataset(store, "again", stored_runs()[:2])
    with pytest.raises(TrainingError, match="more than one of the datasets: s0_m430_t60, s5_m430_t60"):
        train_model(store, CONFIG.model_copy(update={"datasets": ["unit", "again"]}))


def test_a_dataset_that_is_not_there_is_named(store):
    with pytest.raises(DatasetNotFoundError, match="nobody"):
        train_model(store, CONFIG.model_copy(update={"datasets": ["nobody"]}))


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("datasets", []),
        ("prior", "dune"),
        ("architecture", "pickle"),
        ("inputs", ["colour"]),
        ("test_fraction", 1.0),
        ("test_fraction", float("nan")),
        ("unknown", 1),
    ],
)
def test_a_config_that_cannot_be_names_the_field(field, value):
    with pytest.raises(ValidationError, match=field):
        TrainingConfig.model_validate(CONFIG.model_dump() | {field: value})


def _further(columns):
    return {**columns, "rear_x_m": 1.01 * columns["rear_x_m"]}


def _rest(run):
    return run.set_name, run.slope_deg, run.mass_kg, run.torque_nm, run.horizon_s, run.columns


def test_runs_that_vary_are_trained_on_left_out_and_told_apart(driven):
    store, manifest = driven
    report = json.loads(store.read_file(manifest, "report/train.json"))
    for rows in (manifest.metrics["left_out"]["by_run"], report["by_run"]):
        assert len(rows) == 14
        assert {row["run"] for row in rows if row["varies"]} == {"s5_m430_t60_varies", "s10_m430_t60_varies"}
        assert all((row["prior"] is None) is row["varies"] for row in rows)
    page = store.read_file(manifest, "report/left_out.md").decode()
    assert "| unit | drives | 2 |" in page
    assert manifest.domain["torque_nm"][0] == 0.0  # what the drive goes down to
    assert len(manifest.domain["runs"]) == 12
    evidence = read_evidence(store, manifest)
    assert len(evidence.errors) == 14


def test_the_prior_is_calibrated_on_the_constant_runs_alone(driven):
    store, manifest = driven
    put_dataset(store, "steady", stored_runs())
    alone = prepare(store, CONFIG.model_copy(update={"datasets": ["steady"], **WHOLE}), lambda _phase: None).prior
    assert manifest.checkpoint["prior"]["motion_resistance_coefficient"] == alone.coefficient
    put_dataset(store, "varying", DRIVES)
    config = CONFIG.model_copy(update={"datasets": ["varying"], "architecture": "drive_model", **WHOLE})
    prior = prepare(store, config, lambda _phase: None).prior
    assert prior.coefficient == DEFAULT_COEFFICIENTS[prior.name]


@pytest.mark.slow
def test_a_drive_model_of_drives_alone_has_a_band_and_no_neighbours(store):
    put_dataset(store, "varying", [replace(run, name=f"{run.name}_{at}") for at in (1, 2) for run in DRIVES])
    config = CONFIG.model_copy(update={"datasets": ["varying"], "architecture": "drive_model", **WHOLE})
    manifest = published(store, config)
    assert manifest.band is not None
    assert "runs" not in manifest.domain
    twin = load_twin(store, "unit", manifest.version)
    assert np.isfinite(twin.model.positions(Scenarios.of(5, 430, 60), np.linspace(0, 4, 9)).x_m).all()


@pytest.mark.parametrize("architecture", ["paper_network", "zero"])
def test_a_run_that_varies_is_never_taken_for_a_constant_one(store, architecture):
    put_dataset(store, "drives", varying_runs())
    names = [run.name for run in varying_runs() if run.varies]
    config = CONFIG.model_copy(update={"datasets": ["drives"], "architecture": architecture})
    with pytest.raises(TrainingError, match=f"change within {names[0]}, {names[1]}: this model takes only"):
        published(store, config)


def test_what_changes_in_a_run_comes_to_learning_row_by_row(store):
    put_dataset(store, "drives", varying_runs())
    steady, braked, driven = load_training_data(store, ["drives"]).runs[:3]
    stored = varying_runs()[2]
    assert (steady.varies, braked.varies, driven.varies) == (False, True, True)
    assert steady.controls.slope_angle_rad is steady.controls.torque_nm is steady.controls.brake is None
    np.testing.assert_array_equal(braked.brakes, braked.time_s > 2)
    np.testing.assert_allclose(np.degrees(driven.slope_angle_rad), stored.columns["slope_deg"], atol=1e-7)
    np.testing.assert_array_equal(driven.torques_nm, stored.columns["torque_nm"])
    np.testing.assert_array_equal(steady.torques_nm, np.full(81, steady.torque_nm))
    half = driven.samples(slice(None, None, 2))
    np.testing.assert_array_equal(half.torques_nm, driven.torques_nm[::2])
    assert (driven.slope_deg, driven.torque_nm) == (stored.slope_deg, stored.torque_nm)
