"""A small dataset in a real store: synthetic runs, only for tests."""

from __future__ import annotations

from dataclasses import replace

from model_store import DatasetDraft, ModelStore
from service.datasets import Dataset, Run, dataset_id, parse_passport, to_parquet
from service.datasets.passport import PASSPORT_FILE
from service.datasets.summary import summarise
from service.learning.network.fit_state import FitState
from service.training.architectures import begin_fit
from service.training.config import TrainingConfig
from service.training.stored_dataset import RUNS_FILE
from service.training.train import Trained, evaluate_fitted, prepare
from tests.learning.synthetic import HORIZON_S, synthetic_runs

PASSPORT = b"""{"format": "rover-twin-passport/1", "gravity_m_s2": 1.62, "frame": "slope frame",
"reference_body": "rear left wheel", "rover": {"wheel_radius_m": %s}}"""


def put_dataset(
    store: ModelStore, name: str, runs: list[Run], wheel_radius_m: float = 0.25, description: str = ""
) -> str:
    dataset = Dataset(name, parse_passport(PASSPORT % str(wheel_radius_m).encode()), tuple(runs))
    identity = dataset_id(dataset)
    files = {RUNS_FILE: to_parquet(dataset), PASSPORT_FILE: dataset.passport.canonical_json().encode()}
    summary = summarise(dataset).as_json()
    draft = DatasetDraft(name=name, created_by="a test", summary=summary, description=description)
    return store.put_dataset(identity, files, draft).id


def stored_runs() -> list[Run]:
    return [
        Run(
            name=run.name,
            set_name="unit",
            slope_deg=run.slope_deg,
            mass_kg=run.mass_kg,
            torque_nm=run.torque_nm,
            horizon_s=HORIZON_S,
            columns={"time_s": run.time_s, "rear_x_m": run.x_m, "rear_y_m": run.y_m},
        )
        for run in synthetic_runs()
    ]


def train_model(store: ModelStore, config: TrainingConfig, resume: FitState | None = None) -> Trained:
    """An undisturbed training, all epochs in one go."""
    prepared = prepare(store, config, announce=_silent)
    fitting = begin_fit(prepared, resume)
    for _ in fitting.epochs():
        pass
    return evaluate_fitted(prepared, fitting.finish(), announce=_silent)


def _silent(_phase: str) -> None:
    pass


def varying_runs() -> list[Run]:
    """The same, with one that brakes and one whose slope and torque change."""
    runs = stored_runs()
    time_s = runs[0].time_s
    later = (time_s > time_s[-1] / 2).astype(float)
    runs[1] = replace(runs[1], columns={**runs[1].columns, "brake": later})
    inputs = {"slope_deg": runs[2].slope_deg + later, "torque_nm": runs[2].torque_nm * (1 - later)}
    runs[2] = replace(runs[2], columns={**runs[2].columns, **inputs})
    return runs
