"""The paper's protocol on our runs: `python -m tests.benchmarks.paper_protocol [seeds]`.

Train on slopes 20..32 deg without 28 (every fourth sample validates), test on 28 deg. The paper's network sees time and
slope, over each prior; medians and ranges over seeds. Takes about half a minute a row and seed on one core.
"""

from __future__ import annotations

import statistics
import sys

import torch

from model_store import ModelStore
from service.jobs.train import train_model
from service.jobs.training_config import TrainingConfig
from service.learning.evaluate import RunEvaluation
from service.learning.fit_config import FitConfig
from service.physics.priors import PRIOR_NAMES
from service.settings import load_settings

PAPER_CM = {"prior alone": 190.0, "with residual": 6.1}


def held_out(store: ModelStore, prior: str, seed: int) -> RunEvaluation:
    """The evaluation of the run at 28 deg, which took no part in the training."""
    config = TrainingConfig(
        model="paper",
        datasets=["paper"],
        prior=prior,
        inputs=["time_s", "slope_deg"],
        x_form="position",
        test_slopes_deg=[28],
        fit=FitConfig(seed=seed, epochs=100, rows_per_epoch=20_000),
    )
    (evaluation,) = train_model(store, config).test_evaluations
    return evaluation


def spread(values_m: list[float]) -> str:
    """Median and range in cm."""
    low, middle, high = (100 * f(values_m) for f in (min, statistics.median, max))
    return f"{middle:.1f}" if high - low < 0.005 else f"{middle:.1f} ({low:.1f} to {high:.1f})"


def main(seeds: int) -> None:
    """Print a Markdown table."""
    torch.set_num_threads(1)
    store = ModelStore.open(load_settings().store_url)
    columns = ("final error, cm", "maximum, cm", "rms x, cm", "rms y, cm")
    print(f"| 28 deg left out, {seeds} seeds | {' | '.join(columns)} |\n|---|---|---|---|---|")
    for prior in PRIOR_NAMES:
        runs = [held_out(store, prior, seed) for seed in range(1, seeds + 1)]
        for name, side in (("alone", "prior"), ("with the paper's network", "model")):
            errors = [getattr(run, side) for run in runs]
            cells = [
                spread([getattr(e, field) for e in errors])
                for field in ("final_m", "maximum_m", "rmse_x_m", "rmse_y_m")
            ]
            print(f"| `{prior}` {name} | {' | '.join(cells)} |", flush=True)
    print(f"| the paper, prior alone | {PAPER_CM['prior alone']:.0f} | | | |")
    print(f"| the paper, with its network | {PAPER_CM['with residual']} | | | |")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 5)
