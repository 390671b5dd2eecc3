"""What to simulate next, judged by what the manifest of a version says of its training runs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from model_store import Manifest
from service.errors import CheckpointError, InvalidValueError
from service.learning.domain import Domain
from service.learning.suggest import SuggestedRun, suggest_runs
from service.physics.priors import restore_prior


def suggestions(manifest: Manifest, count: int) -> tuple[SuggestedRun, ...]:
    """What to simulate to make the next version better than this one.

    Raises InvalidValueError for a version that does not list its runs, and what `suggest_runs` raises; CheckpointError
    for a manifest that does not fit.
    """
    version = f"{manifest.name}@{manifest.version}"
    checkpoint: Mapping[str, Any] = manifest.checkpoint
    try:
        prior = restore_prior(checkpoint["prior"])
        domain = Domain.restore(manifest.domain, prior.rover, prior.regolith)
    except (KeyError, IndexError, TypeError, ValueError) as error:
        raise CheckpointError(f"{version}: the manifest does not fit: {error}") from error
    if domain.neighbourhood is None:
        raise InvalidValueError(
            "version", version, "a version whose manifest lists its training runs (domain.runs); train a new one"
        )
    return suggest_runs(domain.neighbourhood, domain.spans, count)
