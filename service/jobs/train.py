"""Training one version, top to bottom: datasets -> prior -> fit -> evaluation -> publish -> alias."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import torch

from model_store import Lineage, Manifest, ManifestDraft, ModelStore
from service.jobs.provenance import code_version, library_versions
from service.jobs.training_config import TrainingConfig
from service.jobs.training_data import TrainingData, load_training_data
from service.learning.calibration import calibrate_prior, calibrate_wheel_resistance
from service.learning.checkpoint import WEIGHTS_FILE, describe_model, weights_bytes
from service.learning.domain import Domain
from service.learning.evaluate import RunEvaluation, describe_evaluation, evaluate, summarise
from service.learning.fit import EpochCallback, FitOutcome, fit
from service.learning.fit_state import FitState
from service.learning.inputs import InputSignature
from service.learning.model import PhysicsInformedModel
from service.learning.observed import ObservedRun, scenarios_of
from service.learning.residuals import make_residual
from service.learning.rows import Rows, rows_of
from service.learning.split import Split, split_runs, training_samples, validation_samples
from service.physics.prior import Prior
from service.physics.priors import make_prior

Announce = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Trained:
    """A model before it is published, with what it was made from and how well it does."""

    model: PhysicsInformedModel
    data: TrainingData
    split: Split
    outcome: FitOutcome
    train_evaluations: list[RunEvaluation]
    test_evaluations: list[RunEvaluation]


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
    signature = _signature(config, split.train, data)
    train_rows = rows_of([training_samples(run) for run in split.train], prior, signature)
    validation_rows = rows_of([validation_samples(run) for run in split.train], prior, signature)
    model = _fresh_model(config, prior, signature, train_rows)
    outcome = fit(model.residual, train_rows, validation_rows, config.fit, on_epoch=on_epoch, resume=resume)
    announce("evaluating")
    return Trained(model, data, split, outcome, evaluate(model, split.train), evaluate(model, split.test))


def publish_trained(
    store: ModelStore, config: TrainingConfig, trained: Trained, *, created_by: str, command: str
) -> Manifest:
    """Publish the trained model as the next version of `config.model`; no alias moves."""
    draft = ManifestDraft(
        created_by=created_by,
        description=config.description,
        checkpoint=_checkpoint(trained),
        domain=Domain.of_runs(trained.split.train, trained.data.rover, trained.data.regolith).describe(),
        band=None,
        metrics=_metrics(trained),
        lineage=Lineage(
            datasets=[record.id for record in trained.data.records],
            split={
                "train": [run.name for run in trained.split.train],
                "test": [run.name for run in trained.split.test],
                "validation": "every fourth sample of each training run",
            },
            seed=config.fit.seed,
            config=config.model_dump(mode="json"),
            libraries=library_versions(),
            code_version=code_version(),
            command=command,
        ),
    )
    files = {
        WEIGHTS_FILE: weights_bytes(trained.model),
        "report/train.json": _report(trained.train_evaluations),
        "report/test.json": _report(trained.test_evaluations),
    }
    return store.publish(config.model, files, draft)


def _signature(config: TrainingConfig, runs: tuple[ObservedRun, ...], data: TrainingData) -> InputSignature:
    horizon = max(run.horizon_s for run in runs)
    return InputSignature.fitted(config.inputs, scenarios_of(runs), horizon, data.rover, data.regolith)


def _fresh_model(config: TrainingConfig, prior: Prior, signature: InputSignature, rows: Rows) -> PhysicsInformedModel:
    """A model with seeded random weights; its outputs are scaled by the spread of what they must explain."""
    torch.manual_seed(config.fit.seed)
    arguments: dict[str, Any] = {"input_count": len(signature.inputs)}
    if config.architecture == "paper_network":
        spread = rows.targets_m.std(dim=0).clamp(min=1e-4).tolist()
        arguments |= {"output_scale_m": spread, "x_form": config.x_form}
    return PhysicsInformedModel(prior, signature, make_residual(config.architecture, arguments))


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
        "train": summarise(trained.train_evaluations),
        "fit": asdict(trained.outcome),
    }


def _report(evaluations: list[RunEvaluation]) -> bytes:
    return json.dumps(describe_evaluation(evaluations), indent=1, allow_nan=False).encode()
