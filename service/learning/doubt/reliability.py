"""How well probabilities of outcomes did."""

from __future__ import annotations

from typing import Any

import numpy as np

from service.learning.doubt.outcomes import Class, Classes
from service.physics.scenario import Array

_FIFTHS = 5


def reliability(true: Classes, chances: Array) -> dict[str, Any]:
    """As JSON values, for what runs did (run,) and probabilities (run, 3). Log scores in nats per run, lower is better.

    `fifths` are runs in the order of the largest probability: how large it was, and how often that outcome came true.
    """
    said, likely = chances.argmax(axis=1), chances[np.arange(len(true)), true]
    counts = np.bincount(true, minlength=len(Class))
    order, parts = np.argsort(chances.max(axis=1), kind="stable"), []
    for part in np.array_split(order, min(_FIFTHS, len(true))):
        right = float((said[part] == true[part]).mean())
        parts.append({"runs": len(part), "said": float(chances[part].max(axis=1).mean()), "right": right})
    return {
        "runs": len(true),
        "of_each": {each.name.lower(): int(count) for each, count in zip(Class, counts, strict=True)},
        "right": float((said == true).mean()),
        "log_score": float(-np.log(likely).mean()),
        "log_score_of_base_rates": float(-np.log(counts[true] / len(true)).mean()),
        "fifths": parts,
    }
