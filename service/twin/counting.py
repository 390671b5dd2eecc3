"""What somebody who counts predictions is told. Whoever asks a twin tells it: a probe of readiness is no prediction."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from service.twin.summary import Outcome
from service.twin.twin import Twin

Count = Callable[[Twin, float, Sequence[Outcome], int], None]
"""Told, on the thread that predicts, which twin took how long (s), the outcomes, and how many are out of domain."""


def uncounted(_twin: Twin, _seconds: float, _outcomes: Sequence[Outcome], _outside: int) -> None:
    """For whoever counts nothing."""
