"""What one would write in an afternoon: the paper's network in eager torch, in a FastAPI route that returns lists.

`python -m tests.benchmarks.eager PORT`. Weights, scaling and prior are those of the shipped `viper-lunar-paper`, and so
are the numbers; there is no domain, no summary and no check. One thread, `inference_mode`, else untuned.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import torch
import uvicorn
from fastapi import FastAPI
from safetensors.torch import load

from model_store import WEIGHTS, ModelStore
from service.settings import load_settings
from service.twin import Scenario, sample_times
from service.twin.load import load_twin

WIDTHS = (30, 120, 500, 50, 2)
NAME = "viper-lunar-paper"


def network(weights: dict[str, torch.Tensor], inputs: int) -> torch.nn.Sequential:
    """The paper's layers with stored weights."""
    layers: list[torch.nn.Module] = []
    for before, after in zip((inputs, *WIDTHS[:-1]), WIDTHS, strict=True):
        layers += [torch.nn.Linear(before, after), torch.nn.ReLU()]
    made = torch.nn.Sequential(*layers[:-1])
    made.load_state_dict({name.removeprefix("layers."): tensor for name, tensor in weights.items()})
    return made.eval()


def predictor(store: ModelStore) -> Callable[[float, float, float, float, float], dict[str, Any]]:
    """Trajectories as lists."""
    version = store.resolve(NAME).version
    twin = load_twin(store, NAME, version)
    model, manifest = twin.model, twin.manifest
    signature = model.signature
    layers = network(load(store.read_file(manifest, WEIGHTS)), len(signature.inputs))
    scale = torch.tensor(manifest.checkpoint["architecture"]["arguments"]["output_scale_m"])

    def predict(slope_deg: float, mass_kg: float, torque_nm: float, horizon_s: float, dt_s: float) -> dict[str, Any]:
        times = sample_times(horizon_s, dt_s)
        scenario = Scenario(slope_deg, mass_kg, torque_nm, horizon_s).as_physics()
        prior = model.prior.positions(scenario, times)
        scaled = signature.time_column(times).astype(np.float32)
        columns = signature.scenario_columns(scenario).astype(np.float32)
        constant = np.broadcast_to(columns, (len(times), len(signature.inputs) - 1))
        with torch.inference_mode():
            correction = (layers(torch.from_numpy(np.column_stack([scaled, constant]))) * scale).numpy()
        x = prior.x_m[0] + correction[:, 0] * (1.0 + scaled) / 2.0
        y = prior.y_m[0] + correction[:, 1]
        return {"time_s": times.tolist(), "x_m": x.tolist(), "y_m": y.tolist()}

    return predict


def main() -> None:
    """Serve until killed."""
    torch.set_num_threads(1)
    predict = predictor(ModelStore.open(load_settings().store_url))
    application = FastAPI()

    @application.get("/ready")
    def ready():
        return {"ready": True}

    @application.get("/predictions")
    def prediction(slope_deg: float, mass_kg: float, torque_nm: float, horizon_s: float, dt_s: float):
        return predict(slope_deg, mass_kg, torque_nm, horizon_s, dt_s)

    uvicorn.run(
        application, port=int(sys.argv[1]), loop="uvloop", http="httptools", access_log=False, log_level="warning"
    )


if __name__ == "__main__":
    main()
