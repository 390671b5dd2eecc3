"""The doubt of a version as it is kept: JSON values for the manifest, arrays for a file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import safetensors.numpy

from service.errors import CheckpointError
from service.learning.doubt.doubt import Doubt
from service.learning.doubt.multipliers import GROUPS, LEVELS
from service.learning.doubt.outcomes import OutcomeLaw
from service.learning.doubt.scale import Scale
from service.learning.weights import read_weights
from service.physics.parameters import RegolithParameters, RoverParameters
from service.physics.scenario import Array

METHOD = "errors of the force balance, cross-conformal over left-out runs"


def describe_doubt(doubt: Doubt) -> dict[str, Any]:
    """Everything but the arrays; `measured` is how bands and probabilities did on left-out runs."""
    return {
        "method": METHOD,
        "levels": list(LEVELS),
        "settled_s": doubt.settled_s,
        "outcome_spread": doubt.outcomes.spread,
        "outcome_runs": doubt.outcomes.runs,
        "coverage": dict(doubt.measured),
    }


def doubt_bytes(doubt: Doubt) -> bytes:
    """The arrays as safetensors."""
    arrays = {"places": doubt.scale.places, "sizes": doubt.scale.sizes, "multipliers": doubt.multipliers}
    return safetensors.numpy.save({name: np.ascontiguousarray(array) for name, array in arrays.items()})


def read_doubt(
    description: Mapping[str, Any], content: bytes, rover: RoverParameters, regolith: RegolithParameters
) -> Doubt:
    """Inverse of both. Raises CheckpointError for parts that do not fit or are not finite."""
    arrays = read_weights(safetensors.numpy.load, content, "band")
    try:
        return _restored(description, arrays, rover, regolith)
    except (KeyError, TypeError, ValueError) as error:
        missing = isinstance(error, KeyError) and error.args
        reason = f"{error.args[0]!r} is missing" if missing else str(error)
        raise CheckpointError(f"the band does not fit: {reason}") from error


def _restored(
    description: Mapping[str, Any], arrays: Mapping[str, Array], rover: RoverParameters, regolith: RegolithParameters
) -> Doubt:
    if tuple(description["levels"]) != LEVELS:
        raise ValueError(f"levels are {description['levels']}, allowed is {list(LEVELS)}")
    settled, spread = float(description["settled_s"]), float(description["outcome_spread"])
    runs = int(description["outcome_runs"])
    places, sizes, table = (arrays[name] for name in ("places", "sizes", "multipliers"))
    if not all(each.dtype == np.float64 and np.isfinite(each).all() for each in (places, sizes, table)):
        raise ValueError("places, sizes and multipliers must be finite float64")
    if places.ndim != 2 or places.shape[1] != 4 or sizes.shape != (2, len(places)) or not len(places):
        raise ValueError(f"places {places.shape} and sizes {sizes.shape} do not fit")
    if table.shape != (2, GROUPS, len(LEVELS)) or (np.diff(table) < 0).any() or (table < 0).any():
        raise ValueError(f"multipliers {table.shape} must be {(2, GROUPS, len(LEVELS))}, rising and not negative")
    if not (sizes > 0).all() or not all(0.0 < each < np.inf for each in (settled, spread)) or runs < 1:
        raise ValueError("sizes, settled_s, outcome_spread and outcome_runs must be positive")
    measured = dict(description["coverage"])
    return Doubt(rover, regolith, Scale(places, sizes), settled, table, OutcomeLaw(spread, runs), measured)
