"""Scenario -> prediction: loaded twins, domain verdict, outcome. No HTTP."""

from __future__ import annotations

from service.twin.prediction import Frame, NonFiniteError, Prediction, PredictionBand
from service.twin.registry import Loaded, RegistryStatus, TwinRegistry
from service.twin.scenario import Scenario, sample_times
from service.twin.summary import Outcome, Summary
from service.twin.twin import Twin

__all__ = [
    "Frame",
    "Loaded",
    "NonFiniteError",
    "Outcome",
    "Prediction",
    "PredictionBand",
    "RegistryStatus",
    "Scenario",
    "Summary",
    "Twin",
    "TwinRegistry",
    "sample_times",
]
