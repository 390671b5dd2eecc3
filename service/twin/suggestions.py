"""What to simulate next, judged by what a version knows of its training runs and of its errors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from model_store import Manifest, ModelStore
from service.errors import CheckpointError, InvalidValueError
from service.learning.domain import Domain
from service.learning.doubt.stored import METHOD
from service.learning.drive.model import DriveModel
from service.learning.suggest import SuggestedRun, suggest_runs
from service.learning.suggest_drives import SuggestedDrive, suggest_drives
from service.physics.priors import restore_prior
from service.physics.scenario import Array, Scenarios
from service.physics.similarity import motors_outweigh_slope
from service.twin.load import load_twin


def suggestions(store: ModelStore, manifest: Manifest, count: int) -> tuple[SuggestedRun, ...]:
    """What to simulate to make the next version better than this one.

    The model itself is asked only where the version knows the errors of its force balance. Then there are no scenarios
    in which the slope outweighs the motors: they are sure to roll back or to coast, and only how fast is open.

    Raises InvalidValueError for a version that does not list its runs, and what `suggest_runs` raises; CheckpointError
    for a manifest that does not fit, and what `load_twin` raises.
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
    if (manifest.band or {}).get("method") != METHOD:
        return suggest_runs(domain.neighbourhood, domain.spans, count)
    twin = load_twin(store, manifest.name, manifest.version)
    doubt = twin.doubt
    assert doubt is not None  # of that method
    horizon = doubt.settled_s  # long enough for the shortest of its constant runs, and for outcomes to show

    def unsure(scenarios: Scenarios) -> Array:
        slope, mass, torque = scenarios.slope_angle_rad, scenarios.mass_kg, scenarios.torque_nm
        driven = motors_outweigh_slope(prior.rover, prior.regolith, slope, mass, torque)
        return np.where(driven, doubt.unsure(twin.offset_model, scenarios, horizon), 0.0)

    return suggest_runs(domain.neighbourhood, {**domain.spans, "horizon_s": (0.0, horizon)}, count, unsure)


def drive_suggestions(store: ModelStore, manifest: Manifest, count: int) -> tuple[SuggestedDrive, ...]:
    """Which drives to simulate to make the next version better than this one.

    Raises InvalidValueError for a version that knows no drives, or not the errors of its force balance, and what
    `suggest_drives` and `load_twin` raise.
    """
    if (manifest.band or {}).get("method") == METHOD:
        twin = load_twin(store, manifest.name, manifest.version)
        if isinstance(twin.model, DriveModel) and twin.doubt is not None:
            return suggest_drives(twin.model, twin.doubt, twin.domain.spans, count)
    version = f"{manifest.name}@{manifest.version}"
    raise InvalidValueError("version", version, "a version of the architecture drive_model, with a band")
