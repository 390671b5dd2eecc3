"""Residual architectures that torch trains, one file each, by the names of `corrections`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from service.learning.network.corrections import require_known
from service.learning.network.residuals.architecture import Residual
from service.learning.network.residuals.paper_network import PaperNetwork
from service.learning.network.residuals.zero import ZeroResidual

_ARCHITECTURES: dict[str, Callable[..., Residual]] = {
    PaperNetwork.name: PaperNetwork,
    ZeroResidual.name: ZeroResidual,
}


def make_residual(name: str, arguments: Mapping[str, Any]) -> Residual:
    """A residual with fresh weights. Raises ValueError for an unknown name or arguments, TypeError for wrong ones."""
    require_known(name)
    return _ARCHITECTURES[name](**arguments)


__all__ = ["PaperNetwork", "Residual", "ZeroResidual", "make_residual"]
