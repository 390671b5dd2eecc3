"""What can go wrong, in words for whoever sits before the stage."""

from __future__ import annotations


class RoverTwinUsdError(Exception):
    """Root of the errors that this package raises on purpose. The message says what to do."""


class StageError(RoverTwinUsdError):
    """The stage, or the prim that was named, cannot be used so."""


class ServiceError(RoverTwinUsdError):
    """The service cannot be reached, or refuses the question."""
