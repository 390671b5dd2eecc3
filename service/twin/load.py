"""From a stored version to a twin."""

from __future__ import annotations

import math

from model_store import WEIGHTS, Manifest, ModelStore
from service.errors import CheckpointError
from service.learning.band import BAND_FILE, Band
from service.learning.checkpoint import restore_model
from service.learning.domain import Domain
from service.learning.doubt.doubt import Doubt
from service.learning.doubt.stored import METHOD, read_doubt
from service.learning.trajectory_model import TrajectoryModel
from service.twin.twin import Twin

MAX_WEIGHTS_BYTES = 256 * 1024 * 1024
MAX_BAND_BYTES = 64 * 1024 * 1024


def load_twin(store: ModelStore, name: str, version: int) -> Twin:
    """Read, verify and build one version.

    Raises CheckpointError when the version is whole but cannot become a twin, and what the store raises.
    """
    store.require_usable(name, version)
    manifest = store.manifest(name, version)
    weights = store.read_file(manifest, WEIGHTS, limit_bytes=MAX_WEIGHTS_BYTES)
    try:
        model = restore_model(manifest.checkpoint, weights)
        domain = Domain.restore(manifest.domain, model.prior.rover, model.prior.regolith)
        band = _band(store, manifest, domain, model)
        resistance = manifest.checkpoint.get("wheel_motion_resistance")
        if resistance is not None and not (isinstance(resistance, float | int) and math.isfinite(resistance)):
            raise ValueError(f"wheel_motion_resistance is {resistance!r}, allowed is a finite number or null")  # noqa: TRY301
    except CheckpointError as error:
        raise CheckpointError(f"{name}@{version}: {error}") from error
    except (KeyError, IndexError, TypeError, ValueError) as error:
        raise CheckpointError(f"{name}@{version}: the manifest does not fit: {error}") from error
    return Twin(manifest, model, domain, None if resistance is None else float(resistance), band)


def _band(store: ModelStore, manifest: Manifest, domain: Domain, model: TrajectoryModel) -> Band | Doubt | None:
    if manifest.band is None:
        return None
    if BAND_FILE not in manifest.files:
        raise CheckpointError(f"the manifest describes a band, but the version has no {BAND_FILE}")
    content = store.read_file(manifest, BAND_FILE, limit_bytes=MAX_BAND_BYTES)
    if manifest.band.get("method") != METHOD:
        return Band.read(manifest.band, content, domain)
    if not hasattr(model, "positions_with"):
        raise CheckpointError("the band is one of force balances, of which the model has none")
    return read_doubt(manifest.band, content, model.prior.rover, model.prior.regolith)
