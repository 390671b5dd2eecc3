"""The clean runs: two of the shipped ones, thinned so that a file is read in a few milliseconds."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from model_store import ModelStore
from service.datasets import read_parquet
from service.training.stored_dataset import RUNS_FILE

NAMES = ("time_s", "rear_x_m", "rear_y_m", "speed_mps")
ROWS = 48
MASS_KG = 1430.0  # four digits, so that thousands can be separated
TORQUE_NM = 60.0
_STORE = Path(__file__).parents[3] / "model_store"


@dataclass(frozen=True)
class Clean:
    """One run: its name, its slope, and its columns (row,) with nine significant digits."""

    name: str
    slope_deg: float
    columns: dict[str, np.ndarray]


@cache
def clean_runs() -> tuple[Clean, Clean]:
    """The run that is written in messy ways, and another one that stands beside it in tables and archives."""
    store = ModelStore.open(_STORE)
    dataset = read_parquet(store.read_dataset_file(store.dataset("paper").id, RUNS_FILE))
    by_slope = {run.slope_deg: run for run in dataset.runs}
    return tuple(_thinned(by_slope[slope], name) for slope, name in ((28.0, "a"), (20.0, "b")))


@cache
def passport() -> dict:
    """What was simulated, as the form's passport."""
    store = ModelStore.open(_STORE)
    dataset = read_parquet(store.read_dataset_file(store.dataset("paper").id, RUNS_FILE), columns=())
    content = json.loads(dataset.passport.canonical_json())
    content.pop("column_map", None)
    content.pop("columns", None)
    return content


def _thinned(run, name):
    rows = np.arange(ROWS) * (len(run) // ROWS)
    columns = {each: np.array([float(f"{value:.9g}") for value in run.columns[each][rows]]) for each in NAMES}
    return Clean(name, run.slope_deg, columns)
