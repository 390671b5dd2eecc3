"""Whole drives: a question about ground and controls, its answer with events, summary, band and domain. No HTTP."""

from __future__ import annotations

from service.twin.drives.driving import Drive, Wanted, drive, drives, require_driver
from service.twin.drives.events import Event, EventName
from service.twin.drives.ground import Ground
from service.twin.drives.question import HORIZON_S, LONGEST_S, DriveQuestion, controls_of
from service.twin.drives.stretches import DriveDomain, Stretch
from service.twin.drives.summary import DriveOutcome, DriveSummary, Probabilities

__all__ = [
    "HORIZON_S",
    "LONGEST_S",
    "Drive",
    "DriveDomain",
    "DriveOutcome",
    "DriveQuestion",
    "DriveSummary",
    "Event",
    "EventName",
    "Ground",
    "Probabilities",
    "Stretch",
    "Wanted",
    "controls_of",
    "drive",
    "drives",
    "require_driver",
]
