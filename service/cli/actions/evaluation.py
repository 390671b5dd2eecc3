"""What `rover-twin evaluate` does: a stored version against the runs of stored datasets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from model_store import Manifest, ModelStore
from service.cli.failures import UsageError
from service.cli.threads import use_threads
from service.learning.evaluate import RunEvaluation, evaluate, summarise
from service.learning.observed import ObservedRun
from service.learning.split import is_among
from service.training.data import TrainingData, load_training_data
from service.twin import Twin
from service.twin.load import load_twin

ROLES = ("train", "test", "new")


@dataclass(frozen=True, slots=True)
class JudgedRun:
    """The errors on one run, whether the version was trained on it, and whether it lies inside its domain."""

    errors: RunEvaluation
    seen_in: str
    inside_domain: bool


@dataclass(frozen=True, slots=True)
class Evaluation:
    """A version on some runs."""

    name: str
    version: int
    runs: tuple[JudgedRun, ...]
    warnings: tuple[str, ...]

    def summaries(self) -> dict[str, dict[str, Any]]:
        """A summary for each role that has runs; runs that were trained on never mix with others."""
        groups = {role: [run.errors for run in self.runs if run.seen_in == role] for role in ROLES}
        return {role: summarise(errors) for role, errors in groups.items() if errors}

    def as_json(self) -> dict[str, Any]:
        """Plain JSON content; errors in metres."""
        return {
            "model": {"name": self.name, "version": self.version},
            "summary": self.summaries(),
            "runs": [
                asdict(run.errors) | {"seen_in": run.seen_in, "inside_domain": run.inside_domain} for run in self.runs
            ],
            "warnings": list(self.warnings),
        }


def evaluate_version(
    store: ModelStore, reference: str, datasets: Sequence[str], slopes_deg: Sequence[float]
) -> Evaluation:
    """Errors of the version that `reference` means now, on every run, or on those at the given slopes.

    Raises UsageError for a slope that no run has, and what loading a twin and its data raises.
    """
    resolved = store.resolve(reference)
    data = load_training_data(store, datasets)
    runs = _at_slopes(data.runs, slopes_deg)
    use_threads()
    twin = load_twin(store, resolved.name, resolved.version)
    roles = roles_of(twin.manifest)
    judged = tuple(
        JudgedRun(errors, roles.get(errors.run, "new"), twin.domain.holds_run(run))
        for run, errors in zip(runs, evaluate(twin.model, runs), strict=True)
    )
    return Evaluation(resolved.name, resolved.version, judged, _mismatches(twin, data))


def roles_of(manifest: Manifest) -> dict[str, str]:
    """For each run that the manifest's split names: train or test."""
    split = manifest.lineage.split
    named = split if isinstance(split, dict) else {}
    roles: dict[str, str] = {}
    for role in ("test", "train"):
        runs = named.get(role)
        roles |= {str(run): role for run in (runs if isinstance(runs, list) else [])}
    return roles


def _at_slopes(runs: Sequence[ObservedRun], slopes_deg: Sequence[float]) -> list[ObservedRun]:
    for slope in slopes_deg:
        if not is_among(slope, [run.slope_deg for run in runs]):
            there = ", ".join(f"{each:g}" for each in sorted({run.slope_deg for run in runs}))
            raise UsageError(f"--slope-deg {slope:g}: no run is at this slope; there are {there}")
    return [run for run in runs if not slopes_deg or is_among(run.slope_deg, slopes_deg)]


def _mismatches(twin: Twin, data: TrainingData) -> tuple[str, ...]:
    """What differs between the version's world and the datasets' world: errors then compare unlike things."""
    prior = twin.model.prior
    pairs = (("rover", prior.rover, data.rover), ("regolith", prior.regolith, data.regolith))
    return tuple(
        f"the datasets were simulated with another {what} than {twin.name}@{twin.version} was made for"
        for what, ours, theirs in pairs
        if ours != theirs
    )
