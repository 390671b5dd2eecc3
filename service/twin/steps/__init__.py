"""Rovers that are moved on step by step, many at once. No HTTP."""

from __future__ import annotations

from service.twin.steps.half_width import HALF_WIDTH_LEVEL
from service.twin.steps.live import Live
from service.twin.steps.one import Moment
from service.twin.steps.states import StateError, StoredStates, read_states, write_states
from service.twin.steps.stepper import STATE_SIZE, Moments, Stepper

__all__ = [
    "HALF_WIDTH_LEVEL",
    "STATE_SIZE",
    "Live",
    "Moment",
    "Moments",
    "StateError",
    "Stepper",
    "StoredStates",
    "read_states",
    "write_states",
]
