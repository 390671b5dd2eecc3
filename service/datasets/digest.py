"""The identity of a dataset: sha256 over what it says, independent of files and of the Parquet writer."""

from __future__ import annotations

import hashlib

import numpy as np
import numpy.typing as npt

from service.datasets.canonical import canonical_json
from service.datasets.columns import BY_NAME, REQUIRED
from service.datasets.run import Dataset, Run

_LAYOUT = b"rover-twin-dataset/1\n"


def stored_integers(run: Run, name: str) -> npt.NDArray[np.int64]:
    """A column in units of its last stored digit, (time,): what is stored, digested and compared."""
    return np.rint(run.columns[name] * BY_NAME[name].scale).astype(np.int64)


def dataset_id(dataset: Dataset) -> str:
    """64 hex digits over the passport and every run with its values rounded as stored.

    The order of runs, the dataset's own name and the layout of files do not count. A dataset has the same
    id before it is written and after it is read back. A slope or torque that changes within a run counts as a column
    like any other.
    """
    digest = hashlib.sha256(_LAYOUT)
    digest.update(dataset.passport.canonical_json().encode() + b"\n")
    for run in sorted(dataset.runs, key=lambda each: each.name):
        digest.update(canonical_json(_run_header(run)).encode() + b"\n")
        for name in run.columns:
            digest.update(stored_integers(run, name).astype("<i8").tobytes())
    return digest.hexdigest()


def content_digest(run: Run) -> str:
    """Of the trajectory alone (time, x, y): equal for a run that is there twice under two names."""
    digest = hashlib.sha256()
    for name in REQUIRED:
        digest.update(stored_integers(run, name).astype("<i8").tobytes())
    return digest.hexdigest()


def _run_header(run: Run) -> dict[str, object]:
    return {
        "name": run.name,
        "set": run.set_name,
        "slope_deg": _at_start(run, "slope_deg"),
        "mass_kg": float(run.mass_kg),
        "torque_nm": _at_start(run, "torque_nm"),
        "horizon_s": float(run.horizon_s),
        "columns": list(run.columns),
        "rows": len(run),
    }


def _at_start(run: Run, name: str) -> float:
    """Of an input that changes: as it is stored."""
    if name not in run.columns:
        return float(getattr(run, name))
    return float(stored_integers(run, name)[0] / BY_NAME[name].scale)
