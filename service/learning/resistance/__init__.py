"""Resistance process: motor and traction laws for the drive, a Gaussian process for what the soil takes from it."""

from __future__ import annotations

from service.learning.resistance.fit import FittedProcess, fit_resistance_process
from service.learning.resistance.model import ResistanceProcess

__all__ = ["FittedProcess", "ResistanceProcess", "fit_resistance_process"]
