"""The command line that makes a training config again: what a manifest keeps as its lineage."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from dataclasses import fields

from service.learning.network.fit_config import FitConfig
from service.training.config import TrainingConfig

# Options that are repeated, and therefore named in the singular.
_SINGULAR = {"datasets": "dataset", "inputs": "input", "test_slopes_deg": "test-slope-deg"}


def command_line(config: TrainingConfig) -> str:
    """`rover-twin train ...` with every option that differs from its default.

    Where it runs (store, state file, threads) and who runs it are left out: they change no weights.
    """
    words = ["rover-twin", "train"]
    for name, field in TrainingConfig.model_fields.items():
        if name != "fit" and getattr(config, name) != field.get_default(call_default_factory=True):
            words += _option(name, getattr(config, name))
    for each in fields(FitConfig):
        if getattr(config.fit, each.name) != each.default:
            words += _option(each.name, getattr(config.fit, each.name))
    return shlex.join(words)


def _option(name: str, value: object) -> Iterator[str]:
    option = "--" + _SINGULAR.get(name, name).replace("_", "-")
    for each in value if isinstance(value, list) else [value]:
        yield from (option, str(each))
