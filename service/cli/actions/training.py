"""What `rover-twin train` does, once its options are read: resume, train, publish, promote."""

from __future__ import annotations

import hashlib
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from model_store import Manifest, ModelStore
from service.cli.actions.command_line import command_line
from service.cli.actions.fit_state_file import FitStateFile
from service.cli.output import note
from service.cli.views.training_progress import make_progress
from service.learning.checkpoint import weights_bytes
from service.learning.evaluate import summarise
from service.learning.network.fit_state import FitState
from service.training.architectures import begin_fit
from service.training.config import TrainingConfig
from service.training.train import Trained, evaluate_fitted, prepare, publish_trained

# A state is a few megabytes and an epoch about a second: five epochs are little to lose and cheap to keep.
_SAVE_EVERY_EPOCHS = 5


@dataclass(frozen=True, slots=True)
class Publication:
    """Who publishes, and the alias to point to the new version, if any."""

    actor: str
    promote: str | None


@dataclass(frozen=True, slots=True)
class TrainingResult:
    """What came out; `manifest` is None when nothing was to be published, `promoted` ("name@alias") likewise."""

    trained: Trained
    weights_sha256: str
    manifest: Manifest | None
    promoted: str | None

    def judged_by(self) -> tuple[str, dict[str, Any]]:
        """What was measured on, and its summary: the test runs, or without any, the training runs."""
        test, train = self.trained.test_evaluations, self.trained.train_evaluations
        if test:
            return f"test runs, never seen in training ({len(test)})", summarise(test)
        return f"runs it was trained on, since there are no test runs ({len(train)})", summarise(train)

    def as_json(self) -> dict[str, Any]:
        """Plain JSON content; errors in metres."""
        published = self.manifest
        return {
            "published": {"name": published.name, "version": published.version} if published else None,
            "promoted": self.promoted,
            "weights_sha256": self.weights_sha256,
            "fit": asdict(self.trained.outcome),
            "test": summarise(self.trained.test_evaluations),
            "train": summarise(self.trained.train_evaluations),
        }


def run_training(
    store: ModelStore, config: TrainingConfig, publication: Publication | None, state_path: Path | None
) -> TrainingResult:
    """Train, from the saved state where there is one, then publish and promote as asked.

    A state file outlives an interruption and a training that publishes nothing; publishing removes it.
    """
    state_file = _state_file(store, config, state_path)
    resume = state_file.load() if state_file else None
    if resume:
        note(f"going on after epoch {resume.epoch} of {config.fit.epochs}, saved in {state_path}")
    try:
        trained = _train(store, config, resume, state_file)
    except KeyboardInterrupt:
        if state_path is not None and state_path.exists():
            note(f"nothing is published; the same command goes on from {state_path}")
        raise
    digest = hashlib.sha256(weights_bytes(trained.model)).hexdigest()
    if publication is None:
        return TrainingResult(trained, digest, None, None)
    manifest = publish_trained(store, config, trained, created_by=publication.actor, command=command_line(config))
    if state_file:
        state_file.remove()
    return TrainingResult(trained, digest, manifest, _promote(store, manifest, publication))


def _state_file(store: ModelStore, config: TrainingConfig, path: Path | None) -> FitStateFile | None:
    if path is None:
        return None
    return FitStateFile(path, config, [store.dataset(reference).id for reference in config.datasets])


def _train(
    store: ModelStore, config: TrainingConfig, resume: FitState | None, state_file: FitStateFile | None
) -> Trained:
    with make_progress() as progress:
        prepared = prepare(store, config, progress.phase)
        fitting = begin_fit(prepared, resume, announce=progress.phase)
        for reached in fitting.epochs():
            due = reached.epoch % _SAVE_EVERY_EPOCHS == 0 or reached.epoch == reached.epochs
            if state_file and fitting.network and due:
                state_file.save(fitting.network.state())
            progress.epoch(reached)
        return evaluate_fitted(prepared, fitting.finish(), progress.phase)


def _promote(store: ModelStore, manifest: Manifest, publication: Publication) -> str | None:
    if publication.promote is None:
        return None
    store.move_alias(
        manifest.name,
        publication.promote,
        manifest.version,
        actor=publication.actor,
        reason="promoted by rover-twin train",
    )
    return f"{manifest.name}@{publication.promote}"
