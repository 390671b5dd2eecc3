"""How to fit: the numbers a user may choose, their bounds, and the learning-rate schedule they imply."""

from __future__ import annotations

import math
from dataclasses import dataclass

from service.errors import InvalidValueError


@dataclass(frozen=True, slots=True)
class FitConfig:
    """How to fit. Raises InvalidValueError for values that make no fit.

    `rows_per_epoch` rows are drawn anew, without replacement, from all training rows each epoch: samples
    0.5 ms apart say almost the same, so passing over all of them each time only costs time.
    """

    seed: int = 1
    epochs: int = 200
    batch_rows: int = 512
    rows_per_epoch: int = 40_000
    learning_rate: float = 2e-3
    final_learning_rate: float = 2e-5
    warm_up_epochs: int = 3
    average_decay: float = 0.995
    patience_epochs: int = 60
    validation_rows: int = 10_000

    def __post_init__(self) -> None:
        bounds: dict[str, tuple[float, float]] = {
            "seed": (0, 2**31 - 1),
            "epochs": (1, 100_000),
            "batch_rows": (1, 1_000_000),
            "rows_per_epoch": (1, 100_000_000),
            "learning_rate": (1e-9, 1.0),
            "final_learning_rate": (0.0, 1.0),
            "warm_up_epochs": (0, 10_000),
            "average_decay": (0.0, 0.999999),
            "patience_epochs": (1, 100_000),
            "validation_rows": (1, 100_000_000),
        }
        for field, (lowest, highest) in bounds.items():
            value = getattr(self, field)
            if not lowest <= value <= highest:
                raise InvalidValueError(field, value, f"{lowest:g} to {highest:g}")


def learning_rate_at(config: FitConfig, epoch: float) -> float:
    """Linear warm-up, then a cosine from `learning_rate` to `final_learning_rate`.

    A pure function of the (fractional) epoch: there is no scheduler state to save, so resuming is exact.
    """
    if epoch < config.warm_up_epochs:
        return config.learning_rate * (epoch + 1) / (config.warm_up_epochs + 1)
    done = (epoch - config.warm_up_epochs) / max(1, config.epochs - config.warm_up_epochs)
    cosine = (1 + math.cos(math.pi * min(1.0, done))) / 2
    return config.final_learning_rate + (config.learning_rate - config.final_learning_rate) * cosine
