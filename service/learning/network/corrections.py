"""Trained residuals as they answer: in NumPy, without torch. The closed table that a checkpoint picks from by name."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, Protocol, Self

import numpy as np
import numpy.typing as npt

from service.errors import CheckpointError
from service.learning.network.lines import LARGEST, DenseLayers
from service.physics.scenario import Array

WIDTHS = (30, 120, 500, 50, 2)
_MAXIMUM_INPUTS = 16
# So many times cost as much one by one as the corners of the line that they lie on.
_WORTH_A_POLYGON = 200
_MOST_CORNERS = 1_000  # the shipped network has 150, 300 at most; bounds time and memory for one that is made to be bad

Tensors = Mapping[str, npt.NDArray[np.float32]]


class Correction(Protocol):
    """What a residual adds to the prior. Immutable, safe to share by threads; `arguments` are JSON values."""

    @property
    def name(self) -> str:
        """Of its architecture."""
        ...

    @property
    def input_count(self) -> int:
        """The time and the scenario's columns."""
        ...

    @property
    def arguments(self) -> dict[str, Any]:
        """What the architecture is made with."""
        ...

    @property
    def tensors(self) -> Tensors:
        """Its weights as a checkpoint keeps them."""
        ...

    def metres(self, columns: Array, times: Array) -> Array:
        """dx and dy (2, scenario, time) for scaled inputs: columns (scenario, input - 1), times (scenario, time)."""
        ...


@dataclass(frozen=True, slots=True)
class PaperArguments:
    """What the paper's network is made with.

    `output_scale_m` multiplies its two outputs, so that weights of ordinary size give corrections in metres.
    `x_form` says what the first output stands for: "position", the x correction itself (the paper), or
    "mean_speed", the correction divided by the elapsed time, which makes the correction exactly zero at t = 0.
    The elapsed time is (1 + u)/2 of the training horizon for a scaled time u in -1..1. Past the horizon
    (u > 1) the layers are shown the horizon itself, so that the correction stays ("position") or goes on
    at its last mean speed ("mean_speed"), where bare ReLU layers would grow with every second.
    """

    input_count: int
    output_scale_m: tuple[float, float] = (1.0, 1.0)
    x_form: Literal["position", "mean_speed"] = "position"

    def __post_init__(self) -> None:
        if not 1 <= self.input_count <= _MAXIMUM_INPUTS:
            raise ValueError(f"input_count is {self.input_count}, allowed is 1 to {_MAXIMUM_INPUTS}")
        scale = self.output_scale_m
        if len(scale) != 2 or not all(math.isfinite(s) and s > 0 for s in scale):
            raise ValueError(f"output_scale_m is {scale}, allowed is two positive numbers")
        if self.x_form not in ("position", "mean_speed"):
            raise ValueError(f"x_form is {self.x_form!r}, allowed is position or mean_speed")

    def describe(self) -> dict[str, Any]:
        """As JSON values."""
        scale = list(self.output_scale_m)
        return {"input_count": self.input_count, "output_scale_m": scale, "x_form": self.x_form}

    def shapes(self) -> dict[str, tuple[int, ...]]:
        """The tensors' names, as torch counts its layers, and their shapes."""
        found: dict[str, tuple[int, ...]] = {}
        for number, (fan_in, fan_out) in enumerate(zip((self.input_count, *WIDTHS[:-1]), WIDTHS, strict=True)):
            found[f"layers.{2 * number}.weight"] = fan_out, fan_in
            found[f"layers.{2 * number}.bias"] = (fan_out,)
        return found


@dataclass(frozen=True, eq=False)
class PaperCorrection:
    """The paper's trained network (`residuals.PaperNetwork`), with float32 weights and float64 arithmetic."""

    made_with: PaperArguments
    tensors: Tensors
    layers: DenseLayers

    name: ClassVar[str] = "paper_network"

    @classmethod
    def of(cls, arguments: Mapping[str, Any], tensors: Tensors) -> Self:
        """Raises TypeError or ValueError for arguments that are not its own, CheckpointError for such tensors."""
        made_with = PaperArguments(**arguments)
        _require_fitting(made_with.shapes(), tensors)
        numbers = range(len(WIDTHS))
        weights = (np.ascontiguousarray(tensors[f"layers.{2 * each}.weight"].T, dtype=np.float64) for each in numbers)
        biases = (tensors[f"layers.{2 * each}.bias"].astype(np.float64) for each in numbers)
        return cls(made_with, tensors, DenseLayers(tuple(weights), tuple(biases)))

    @property
    def input_count(self) -> int:
        """`Correction.input_count`."""
        return self.made_with.input_count

    @property
    def arguments(self) -> dict[str, Any]:
        """`Correction.arguments`."""
        return self.made_with.describe()

    def metres(self, columns: Array, times: Array) -> Array:
        """`Correction.metres`; infinite where the network has no finite answer in the range of float32.

        What is said of a scenario and a time depends on the other times by rounding of float64 only, on the other
        scenarios not at all.
        """
        found = np.empty((2, *times.shape))
        with np.errstate(over="ignore", invalid="ignore"):
            for row, (others, time) in enumerate(zip(columns, times, strict=True)):
                found[:, row] = self._outputs(others, np.minimum(time, 1.0))
            found *= np.array(self.made_with.output_scale_m, np.float32)[:, None, None]  # as torch keeps it
            if self.made_with.x_form == "mean_speed":
                found[0] *= (1.0 + times) / 2.0
        if found.size and not max(found.max(), -found.min()) <= LARGEST:
            found[~(np.abs(found) <= LARGEST)] = np.inf
        return found

    def _outputs(self, others: Array, seen: Array) -> Array:
        """(output, time) at the times that the layers are shown: up to 1."""
        line = self.layers.line(others)
        worth_it = len(seen) >= _WORTH_A_POLYGON and seen.min() >= -1.0
        polygon = line.polygon(-1.0, 1.0, _MOST_CORNERS) if worth_it else None  # whole, whichever times are asked
        if polygon is not None:
            return polygon.at(seen)
        distinct, places = np.unique(seen, return_inverse=True)  # a summary asks for many of the times shown
        return line.at(distinct)[:, places]


@dataclass(frozen=True, eq=False)
class ZeroCorrection:
    """Corrections of exactly zero, for any number of inputs (`residuals.ZeroResidual`)."""

    input_count: int

    name: ClassVar[str] = "zero"

    @classmethod
    def of(cls, arguments: Mapping[str, Any], tensors: Tensors) -> Self:
        """Raises TypeError for arguments that are not its own, CheckpointError for tensors: it has none."""
        made = cls(**arguments)
        _require_fitting({}, tensors)
        return made

    @property
    def arguments(self) -> dict[str, Any]:
        """`Correction.arguments`."""
        return {"input_count": self.input_count}

    @property
    def tensors(self) -> Tensors:
        """`Correction.tensors`."""
        return {}

    def metres(self, columns: Array, times: Array) -> Array:  # noqa: ARG002
        """`Correction.metres`."""
        return np.zeros((2, *times.shape))


_CORRECTIONS: dict[str, Callable[[Mapping[str, Any], Tensors], Correction]] = {
    PaperCorrection.name: PaperCorrection.of,
    ZeroCorrection.name: ZeroCorrection.of,
}
ARCHITECTURE_NAMES = tuple(_CORRECTIONS)


def require_known(name: str) -> None:
    """Raises ValueError for the name of an architecture that is not in the table."""
    if name not in _CORRECTIONS:
        raise ValueError(f"architecture is {name!r}, allowed is one of {', '.join(ARCHITECTURE_NAMES)}")


def make_correction(name: str, arguments: Mapping[str, Any], tensors: Tensors) -> Correction:
    """The correction of that architecture with these weights.

    Raises ValueError for an unknown name or arguments, TypeError for wrong ones, CheckpointError for tensors that do
    not fit or are not finite.
    """
    require_known(name)
    return _CORRECTIONS[name](arguments, tensors)


def _require_fitting(expected: Mapping[str, tuple[int, ...]], found: Tensors) -> None:
    if expected.keys() != found.keys():
        raise CheckpointError(f"the weights name {sorted(found)}, the architecture needs {sorted(expected)}")
    for name, tensor in found.items():
        if tensor.shape != expected[name] or tensor.dtype != np.float32:
            raise CheckpointError(
                f"weight {name} is {tensor.dtype} {tensor.shape}, the architecture needs float32 {expected[name]}"
            )
        if not np.isfinite(tensor).all():
            raise CheckpointError(f"weight {name} holds values that are not finite")
