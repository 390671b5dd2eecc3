"""What comes before a fit (datasets, split, calibrated prior) and after it (evaluation, publication)."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, cast

import safetensors.numpy
import torch

from model_store import WEIGHTS, Lineage, Manifest, ManifestDraft, ModelStore
from service.learning.band import BAND_FILE, Band
from service.learning.band import FEWEST_RUNS as FEWEST_BAND_RUNS
from service.learning.calibration import calibrate_prior, calibrate_wheel_resistance
from service.learning.checkpoint import describe_model, weights_bytes
from service.learning.domain import Domain
from service.learning.doubt.doubt import Doubt
from service.learning.doubt.meeting import OffsetModel
from service.learning.doubt.steeper import measure_steeper
from service.learning.doubt.stored import describe_doubt, doubt_bytes
from service.learning.evaluate import RunEvaluation, describe_evaluation, evaluate, evaluate_positions, summarise
from service.learning.network.fit import FitOutcome
from service.learning.observed import ObservedRun, require_constant
from service.learning.split import Split, split_runs
from service.learning.trajectory_model import TrajectoryModel
from service.physics.prior import Prior
from service.physics.priors import DEFAULT_COEFFICIENTS, make_prior
from service.physics.scenario import Positions
from service.training.architectures import Announce, Fitted, Prepared
from service.training.config import TAKES_VARYING_RUNS, TrainingConfig
from service.training.data import TrainingData, load_training_data
from service.training.doubt_report import doubt_report
from service.training.evidence import TRAIN_REPORT
from service.training.provenance import code_version, library_versions
from service.training.report import error_curves, left_out_report
from service.training.same_weights import version_with


@dataclass(frozen=True, slots=True)
class Trained:
    """A model before it is published, with what it was made from and how well it does.

    `left_out` has, by run, positions from a model that has not seen that run, and `left_out_evaluations` their errors.
    `left_out_slope_evaluations` are errors of runs predicted from the other slopes of their own series alone. All
    three are empty where the architecture does not offer that.
    """

    model: TrajectoryModel
    data: TrainingData
    split: Split
    outcome: FitOutcome
    domain: Domain
    band: Band | Doubt | None
    train_evaluations: list[RunEvaluation]
    test_evaluations: list[RunEvaluation]
    left_out: Mapping[str, Positions]
    left_out_evaluations: list[RunEvaluation]
    left_out_slope_evaluations: list[RunEvaluation]
    steeper: Mapping[str, Any] | None = None


def prepare(store: ModelStore, config: TrainingConfig, announce: Announce) -> Prepared:
    """Load and split the datasets. Deterministic. Raises TrainingError and what the store and the datasets raise."""
    announce("loading datasets")
    data = load_training_data(store, config.datasets)
    if config.architecture not in TAKES_VARYING_RUNS:
        require_constant(data.runs)
    split = split_runs(
        data.runs, test_slopes_deg=config.test_slopes_deg, test_fraction=config.test_fraction, seed=config.fit.seed
    )
    announce(f"fitting on {len(split.train)} runs")
    return Prepared(config, data, split, _prior(config, data, split))


def _prior(config: TrainingConfig, data: TrainingData, split: Split) -> Prior:
    """Calibrated on the training runs that it has an answer for; without any it keeps its default coefficient."""
    prior = make_prior(config.prior, DEFAULT_COEFFICIENTS[config.prior], data.rover, data.regolith)
    constant = [run for run in split.train if not run.varies]
    return calibrate_prior(prior, constant) if constant else prior


def evaluate_fitted(
    prepared: Prepared, fitted: Fitted, announce: Announce, check: Callable[[], None] = lambda: None
) -> Trained:
    """How well the fitted model does, and where it may be trusted. Deterministic.

    `check` is called for each run, and may raise to stop.
    """
    announce("evaluating")
    data, split = prepared.data, prepared.split
    left_out = evaluate_positions(prepared.prior, split.train, fitted.left_out) if fitted.left_out else []
    of_series = [run for run in split.train if run.name in fitted.left_out_slopes]
    errors = {each.run: each.model.final_m for each in left_out}
    domain = Domain.of_runs(split.train, data.rover, data.regolith, errors)
    band = _band(split.train, fitted, domain)
    return Trained(
        model=fitted.model,
        data=data,
        split=split,
        outcome=fitted.outcome,
        domain=domain,
        band=band,
        train_evaluations=_evaluate_each(fitted.model, split.train, check),
        test_evaluations=_evaluate_each(fitted.model, split.test, check),
        left_out=fitted.left_out,
        left_out_evaluations=left_out,
        left_out_slope_evaluations=evaluate_positions(prepared.prior, of_series, fitted.left_out_slopes),
        steeper=_steeper(fitted, band, domain),
    )


def _band(runs: Sequence[ObservedRun], fitted: Fitted, domain: Domain) -> Band | Doubt | None:
    """None where nothing was left out, or too few runs were."""
    if fitted.left_out_models:
        return Doubt.calibrate(runs, fitted.left_out_models) if len(runs) >= FEWEST_BAND_RUNS else None
    constant = [run for run in runs if not run.varies]
    if not fitted.left_out or len(constant) < FEWEST_BAND_RUNS:
        return None
    return Band.calibrate(constant, fitted.left_out, domain)


def _steeper(fitted: Fitted, band: Band | Doubt | None, domain: Domain) -> Mapping[str, Any] | None:
    if not isinstance(band, Doubt):
        return None
    return measure_steeper(cast(OffsetModel, fitted.model), band, domain)  # its kind made the left-out models


def _evaluate_each(
    model: TrajectoryModel, runs: Sequence[ObservedRun], check: Callable[[], None]
) -> list[RunEvaluation]:
    evaluations = []
    for run in runs:
        check()
        evaluations += evaluate(model, [run])
    return evaluations


def publish_trained(
    store: ModelStore,
    config: TrainingConfig,
    trained: Trained,
    *,
    created_by: str,
    command: str,
    job: str | None = None,
    check: Callable[[], None] = lambda: None,
) -> Manifest:
    """Publish the trained model as the next version of `config.model`; no alias moves.

    Weights that another version has are published too, since their lineage may differ; the manifest then says so. For a
    `job` that is done once only: later calls return the manifest of the first one. `check` is called when the
    report is drawn, which takes a second or two, and nothing is written yet; it may raise to leave it at that.
    """
    described_band, files_of_band = _stored_band(trained.band, trained.steeper)
    weights = weights_bytes(trained.model)
    lineage = _lineage(config, trained, command, job)
    same = version_with(store, hashlib.sha256(weights).hexdigest())
    draft = ManifestDraft(
        created_by=created_by,
        description=config.description,
        checkpoint=_checkpoint(trained),
        domain=trained.domain.describe(),
        band=described_band,
        metrics=training_metrics(trained),
        lineage=lineage.model_copy(update={"same_weights_as": same}),
    )
    files = {
        WEIGHTS: weights,
        TRAIN_REPORT: _report(trained.train_evaluations),
        "report/test.json": _report(trained.test_evaluations),
    }
    files |= files_of_band
    if trained.left_out_evaluations:
        curves = error_curves(trained.split.train, trained.left_out)
        files |= left_out_report(
            trained.left_out_evaluations,
            curves,
            trained.data.rover,
            trained.data.regolith,
            trained.left_out_slope_evaluations,
        )
    check()
    return store.publish(config.model, files, draft, once_key=job)


def _stored_band(
    band: Band | Doubt | None, steeper: Mapping[str, Any] | None
) -> tuple[dict[str, Any] | None, dict[str, bytes]]:
    """What the manifest says of a band, and its files."""
    if band is None:
        return None, {}
    if isinstance(band, Doubt):
        return describe_doubt(band), {BAND_FILE: doubt_bytes(band)} | doubt_report(band.measured, steeper)
    return band.describe(), {BAND_FILE: safetensors.numpy.save(band.tensors())}


def _lineage(config: TrainingConfig, trained: Trained, command: str, job: str | None) -> Lineage:
    return Lineage(
        job=job,
        datasets=[record.id for record in trained.data.records],
        split={
            "train": [run.name for run in trained.split.train],
            "test": [run.name for run in trained.split.test],
            "validation": "leave one run out"
            if trained.left_out_evaluations
            else "every fourth sample of each training run",
        },
        seed=config.fit.seed,
        threads=torch.get_num_threads(),
        config=config.model_dump(mode="json"),
        libraries=library_versions(),
        code_version=code_version(),
        command=command,
    )


def _checkpoint(trained: Trained) -> dict[str, Any]:
    data = trained.data
    resistance = calibrate_wheel_resistance(data.rover, data.regolith, trained.split.train)
    return describe_model(trained.model) | {
        "wheel_motion_resistance": resistance,
        "reference_body": data.reference_body,
        "frame": data.frame,
    }


def training_metrics(trained: Trained) -> dict[str, Any]:
    """Errors on test runs, left-out runs and training runs, and how the fit went: plain JSON content.

    Where the version knows the errors of its force balance, how its band and its probabilities did on left-out runs too
    (`doubt`), and how often the model has a steeper slope take the rover further (`steeper`).
    """
    band = trained.band
    return {
        "test": describe_evaluation(trained.test_evaluations),
        "left_out": describe_evaluation(trained.left_out_evaluations),
        "left_out_slopes": describe_evaluation(trained.left_out_slope_evaluations),
        "train": summarise(trained.train_evaluations),
        "fit": asdict(trained.outcome),
    } | ({"doubt": dict(band.measured), "steeper": trained.steeper} if isinstance(band, Doubt) else {})


def _report(evaluations: list[RunEvaluation]) -> bytes:
    return json.dumps(describe_evaluation(evaluations), indent=1, allow_nan=False).encode()
