"""Training one version, top to bottom: datasets -> prior -> fit -> evaluation -> publish -> alias."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import safetensors.numpy

from model_store import Lineage, Manifest, ManifestDraft, ModelStore
from service.jobs.architectures import Callbacks, fit_architecture
from service.jobs.held_out_report import error_curves, held_out_report
from service.jobs.provenance import code_version, library_versions
from service.jobs.training_config import TrainingConfig
from service.jobs.training_data import TrainingData, load_training_data
from service.learning.band import BAND_FILE, Band
from service.learning.calibration import calibrate_prior, calibrate_wheel_resistance
from service.learning.checkpoint import WEIGHTS_FILE, describe_model, weights_bytes
from service.learning.domain import Domain
from service.learning.evaluate import RunEvaluation, describe_evaluation, evaluate, evaluate_positions, summarise
from service.learning.fit import EpochCallback, FitOutcome
from service.learning.fit_state import FitState
from service.learning.model import TrajectoryModel
from service.learning.split import Split, split_runs
from service.physics.priors import make_prior
from service.physics.scenario import Positions

Announce = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Trained:
    """A model before it is published, with what it was made from and how well it does.

    `left_out` has, by run, positions from a model that has not seen that run, and `left_out_evaluations` their errors;
    both are empty where the architecture does not offer that.
    """

    model: TrajectoryModel
    data: TrainingData
    split: Split
    outcome: FitOutcome
    domain: Domain
    band: Band | None
    train_evaluations: list[RunEvaluation]
    test_evaluations: list[RunEvaluation]
    left_out: Mapping[str, Positions]
    left_out_evaluations: list[RunEvaluation]


def train_model(
    store: ModelStore,
    config: TrainingConfig,
    *,
    announce: Announce = lambda _phase: None,
    on_epoch: EpochCallback | None = None,
    resume: FitState | None = None,
) -> Trained:
    """Train without publishing. Raises TrainingError and what the store and the datasets raise."""
    announce("loading datasets")
    data = load_training_data(store, config.datasets)
    split = split_runs(
        data.runs, test_slopes_deg=config.test_slopes_deg, test_fraction=config.test_fraction, seed=config.fit.seed
    )
    announce(f"fitting on {len(split.train)} runs")
    prior = calibrate_prior(make_prior(config.prior, 0.0, data.rover, data.regolith), split.train)
    fitted = fit_architecture(config, split.train, data, prior, Callbacks(announce, on_epoch, resume))
    announce("evaluating")
    left_out = evaluate_positions(prior, split.train, fitted.left_out) if fitted.left_out else []
    errors = {each.run: each.model.final_m for each in left_out}
    domain = Domain.of_runs(split.train, data.rover, data.regolith, errors)
    return Trained(
        model=fitted.model,
        data=data,
        split=split,
        outcome=fitted.outcome,
        domain=domain,
        band=Band.calibrate(split.train, fitted.left_out, domain) if fitted.left_out else None,
        train_evaluations=evaluate(fitted.model, split.train),
        test_evaluations=evaluate(fitted.model, split.test),
        left_out=fitted.left_out,
        left_out_evaluations=left_out,
    )


def publish_trained(
    store: ModelStore, config: TrainingConfig, trained: Trained, *, created_by: str, command: str
) -> Manifest:
    """Publish the trained model as the next version of `config.model`; no alias moves."""
    draft = ManifestDraft(
        created_by=created_by,
        description=config.description,
        checkpoint=_checkpoint(trained),
        domain=trained.domain.describe(),
        band=trained.band.describe() if trained.band else None,
        metrics=_metrics(trained),
        lineage=_lineage(config, trained, command),
    )
    files = {
        WEIGHTS_FILE: weights_bytes(trained.model),
        "report/train.json": _report(trained.train_evaluations),
        "report/test.json": _report(trained.test_evaluations),
    }
    if trained.band:
        files[BAND_FILE] = safetensors.numpy.save(trained.band.tensors())
    if trained.left_out_evaluations:
        curves = error_curves(trained.split.train, trained.left_out)
        files |= held_out_report(trained.left_out_evaluations, curves, trained.data.rover, trained.data.regolith)
    return store.publish(config.model, files, draft)


def _lineage(config: TrainingConfig, trained: Trained, command: str) -> Lineage:
    return Lineage(
        datasets=[record.id for record in trained.data.records],
        split={
            "train": [run.name for run in trained.split.train],
            "test": [run.name for run in trained.split.test],
            "validation": "leave one run out"
            if trained.left_out_evaluations
            else "every fourth sample of each training run",
        },
        seed=config.fit.seed,
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


def _metrics(trained: Trained) -> dict[str, Any]:
    return {
        "test": describe_evaluation(trained.test_evaluations),
        "left_out": describe_evaluation(trained.left_out_evaluations),
        "train": summarise(trained.train_evaluations),
        "fit": asdict(trained.outcome),
    }


def _report(evaluations: list[RunEvaluation]) -> bytes:
    return json.dumps(describe_evaluation(evaluations), indent=1, allow_nan=False).encode()
