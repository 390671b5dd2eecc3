"""`rover-twin train --like`: the config of a published version, taken again, and whether the same weights came out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import torch
from pydantic import ValidationError

from model_store import WEIGHTS, Manifest
from service.cli.failures import UsageError
from service.training.config import TrainingConfig
from service.training.provenance import code_version, library_versions


@dataclass(frozen=True, slots=True)
class Likeness:
    """Whether a training gave the weights of `original` ("name@version"); `changes` is what may explain it if not."""

    original: str
    original_sha256: str
    same_weights: bool
    changes: tuple[str, ...]

    def sentence(self) -> str:
        """The answer for people."""
        if self.same_weights:
            return f"the same weights as {self.original}"
        why = "; ".join(self.changes) or "same config, code and libraries: another machine or processor?"
        return f"other weights than {self.original} (sha256 {self.original_sha256}): {why}"

    def as_json(self) -> dict[str, Any]:
        """Plain JSON content."""
        return {
            "version": self.original,
            "weights_sha256": self.original_sha256,
            "same_weights": self.same_weights,
            "changes": list(self.changes),
        }


def config_like(manifest: Manifest, changed: Mapping[str, Any]) -> TrainingConfig:
    """The config that a version was trained with, on exactly its datasets; `changed` options take precedence.

    Raises UsageError when the manifest has no config, or one that this release cannot read.
    """
    lineage = manifest.lineage
    where = f"--like {manifest.name}@{manifest.version}"
    if not lineage.config:
        raise UsageError(f"{where}: its manifest keeps no config; give the options instead")
    content: dict[str, Any] = dict(lineage.config)
    if lineage.datasets:
        content["datasets"] = list(lineage.datasets)  # ids: a name may have come to mean another dataset
    fit = content.get("fit")
    content["fit"] = (fit if isinstance(fit, dict) else {}) | changed.get("fit", {})
    try:
        return TrainingConfig.model_validate(content | {name: changed[name] for name in changed if name != "fit"})
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        field = ".".join(map(str, first["loc"]))
        raise UsageError(f"{where}: {field}: {first['msg']}") from error


def likeness(manifest: Manifest, config: TrainingConfig, weights_sha256: str) -> Likeness:
    """Compare what a config gave with the version it was taken from."""
    original = manifest.files[WEIGHTS].sha256
    same = weights_sha256 == original
    changes = (
        () if same else (*_cut_short(manifest, config), *_config_changes(manifest, config), *_code_changes(manifest))
    )
    return Likeness(f"{manifest.name}@{manifest.version}", original, same, changes)


def _cut_short(manifest: Manifest, config: TrainingConfig) -> list[str]:
    """A job whose time was up stopped where its config does not say: no retraining ends at that epoch."""
    fit = manifest.metrics.get("fit")
    done, best = (fit.get("epochs"), fit.get("best_epoch")) if isinstance(fit, dict) else (None, None)
    asked = _original(manifest, config).fit
    if not (isinstance(done, int) and isinstance(best, int)) or not 0 < done < asked.epochs:
        return []
    return [f"its time was up after epoch {done} of {asked.epochs}"] if done - best < asked.patience_epochs else []


def _original(manifest: Manifest, config: TrainingConfig) -> TrainingConfig:
    """The version's config but for its architecture, which this release may know no more."""
    return config_like(manifest, {"architecture": config.architecture})


def _config_changes(manifest: Manifest, config: TrainingConfig) -> list[str]:
    before, after = (_flat(each) for each in (_original(manifest, config), config))
    before |= {"architecture": manifest.lineage.config.get("architecture", before["architecture"])}
    return [f"{name} was {before[name]}, is {after[name]}" for name in before if before[name] != after[name]]


def _flat(config: TrainingConfig) -> dict[str, Any]:
    # name and description of a model do not reach its weights
    content = config.model_dump(mode="json", exclude={"model", "description"})
    fit: dict[str, Any] = content.pop("fit")
    return content | fit


def _code_changes(manifest: Manifest) -> list[str]:
    lineage = manifest.lineage
    then: dict[str, object] = {"code": lineage.code_version, "threads": lineage.threads, **lineage.libraries}
    now: dict[str, object] = {"code": code_version(), "threads": torch.get_num_threads(), **library_versions()}
    return [f"{name} was {then[name]}, is {now[name]}" for name in then if name in now and then[name] != now[name]]
