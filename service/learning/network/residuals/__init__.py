"""Residual architectures, one file each, and the closed table that a checkpoint picks from by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from service.learning.network.residuals.architecture import Residual
from service.learning.network.residuals.paper_network import PaperNetwork
from service.learning.network.residuals.zero import ZeroResidual

_ARCHITECTURES: dict[str, Callable[..., Residual]] = {
    PaperNetwork.name: PaperNetwork,
    ZeroResidual.name: ZeroResidual,
}
ARCHITECTURE_NAMES = tuple(_ARCHITECTURES)


def make_residual(name: str, arguments: Mapping[str, Any]) -> Residual:
    """A residual with fresh weights. Raises ValueError for an unknown name or arguments, TypeError for wrong ones."""
    if name not in _ARCHITECTURES:
        raise ValueError(f"architecture is {name!r}, allowed is one of {', '.join(ARCHITECTURE_NAMES)}")
    return _ARCHITECTURES[name](**arguments)


__all__ = ["ARCHITECTURE_NAMES", "PaperNetwork", "Residual", "ZeroResidual", "make_residual"]
