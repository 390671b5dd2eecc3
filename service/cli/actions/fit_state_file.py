"""The state of a fit in one file: replaced in one step, and refused when it belongs to another training."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from service.cli.failures import UsageError
from service.errors import TrainingError
from service.learning.network.fit_state import FitState
from service.training.config import TrainingConfig

# First line of the file; a second line of JSON says which training it belongs to; safetensors follow.
_FIRST_LINE = b"rover-twin fit state 1\n"
_MAX_BYTES = 4 * 1024**3
_CHANGES_NO_WEIGHTS = {"model", "description", "datasets"}


class FitStateFile:
    """Where one training keeps its state. `dataset_ids` count rather than the names that datasets were asked for by."""

    def __init__(self, path: Path, config: TrainingConfig, dataset_ids: Sequence[str]) -> None:
        self._path = path
        fit = config.model_dump(mode="json", exclude=_CHANGES_NO_WEIGHTS)
        self._training: dict[str, Any] = {"dataset_ids": list(dataset_ids), **fit.pop("fit"), **fit}

    def load(self) -> FitState | None:
        """The state to go on from; None where there is no file yet.

        Raises UsageError when the file belongs to another training, TrainingError when it is damaged.
        """
        try:
            size = self._path.stat().st_size
        except FileNotFoundError:
            return None
        if size > _MAX_BYTES:
            raise UsageError(f"--state {self._path} has {size} bytes, allowed are at most {_MAX_BYTES}")
        content = self._path.read_bytes()
        if not content.startswith(_FIRST_LINE):
            raise UsageError(f"--state {self._path} is no state of a fit; name another file")
        training, _, state = content.removeprefix(_FIRST_LINE).partition(b"\n")
        self._require_same(training)
        return FitState.from_bytes(state)

    def save(self, state: FitState) -> None:
        """Replace the file in one step: a kill leaves the old state or the new one."""
        training = json.dumps(self._training, sort_keys=True).encode()
        self._path.parent.mkdir(parents=True, exist_ok=True)
        beside = self._path.with_name(f".{self._path.name}.{os.getpid()}.partial")
        try:
            with beside.open("wb") as file:
                file.write(_FIRST_LINE + training + b"\n" + state.to_bytes())
                file.flush()
                os.fsync(file.fileno())
            beside.replace(self._path)
        finally:
            beside.unlink(missing_ok=True)

    def remove(self) -> None:
        """Forget the state: the training is finished."""
        self._path.unlink(missing_ok=True)

    def _require_same(self, text: bytes) -> None:
        try:
            there = json.loads(text)
            names = sorted({*there, *self._training})
        except (ValueError, TypeError) as error:
            raise TrainingError(f"the saved state {self._path} cannot be read: {error}") from error
        different = [name for name in names if there.get(name) != self._training.get(name)]
        if different:
            shown = "; ".join(
                f"{name} is {there.get(name)!r} there, {self._training.get(name)!r} here" for name in different[:3]
            )
            raise UsageError(f"--state {self._path} belongs to another training: {shown}; name another file")
