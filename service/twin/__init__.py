"""Scenario -> prediction: loaded twins, domain verdict, outcome. No HTTP."""

from __future__ import annotations

from service.twin.batch import PredictionBatch, sample_grid
from service.twin.counting import Count, uncounted
from service.twin.many import ManyScenarios
from service.twin.prediction import (
    SPEED_NAMES,
    Frame,
    NonFiniteError,
    OutsideDomainError,
    Prediction,
    PredictionBand,
)
from service.twin.registry import Loaded, RegistryStatus, TwinRegistry
from service.twin.scenario import Scenario, sample_times
from service.twin.summary import Outcome, Summaries, Summary
from service.twin.twin import Twin

__all__ = [
    "SPEED_NAMES",
    "Count",
    "Frame",
    "Loaded",
    "ManyScenarios",
    "NonFiniteError",
    "Outcome",
    "OutsideDomainError",
    "Prediction",
    "PredictionBand",
    "PredictionBatch",
    "RegistryStatus",
    "Scenario",
    "Summaries",
    "Summary",
    "Twin",
    "TwinRegistry",
    "sample_grid",
    "sample_times",
    "uncounted",
]
