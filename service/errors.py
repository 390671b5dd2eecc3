"""Every error that our own code raises on purpose. No status codes here: `api/errors.py` maps them.

    RoverTwinError
    ├── InvalidValueError     a value outside its allowed range (also ValueError); names field, value, allowed
    ├── DatasetError          a dataset or one of its files cannot be used
    ├── CheckpointError       a stored version cannot become a twin
    └── TrainingError         a training run could not start or finish

The store keeps its own tree (`model_store/errors.py`), since it imports nothing of ours.
"""

from __future__ import annotations


class RoverTwinError(Exception):
    """Root of the errors that our own code raises on purpose."""


class InvalidValueError(RoverTwinError, ValueError):
    """A value is outside what is allowed. `field`, `value` and `allowed` say which, what and why."""

    def __init__(self, field: str, value: object, allowed: str) -> None:
        self.field, self.value, self.allowed = field, value, allowed
        super().__init__(f"{field} is {value!r}, allowed is {allowed}")


class DatasetError(RoverTwinError):
    """A dataset, or a file of it, cannot be used as it is."""


class CheckpointError(RoverTwinError):
    """A stored version cannot be turned into a twin: the message says what does not fit."""


class TrainingError(RoverTwinError):
    """A training run could not start or finish."""
