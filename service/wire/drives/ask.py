"""From a drive as it was asked for to one that can be written."""

from __future__ import annotations

import time
from collections.abc import Callable

from service.twin import Loaded, Twin
from service.twin.drives import DriveOutcome, DriveQuestion, Wanted, drive
from service.wire.drives.subject import DriveSubject

CountDrive = Callable[[Twin, float, DriveOutcome, bool], None]
"""Told which twin took how long (s) for a drive, its outcome, and whether it is inside the domain."""


def uncounted(_twin: Twin, _seconds: float, _outcome: DriveOutcome, _inside: bool) -> None:
    """For whoever counts nothing."""


def driven(
    question: DriveQuestion, wanted: Wanted, strict: bool, loaded: Loaded, count: CountDrive = uncounted
) -> DriveSubject:
    """The drive that was asked for.

    Raises InvalidValueError for a version that cannot drive and for a band that cannot be had, NonFiniteError, and
    OutsideDomainError where a strict client asks for a drive that leaves the domain.
    """
    began = time.perf_counter()
    found = drive(loaded.twin, question, wanted)
    count(loaded.twin, time.perf_counter() - began, found.summary.outcome, found.domain.inside)
    if strict and not found.domain.inside:
        raise loaded.twin.outside(found.domain.verdict())
    return DriveSubject(loaded, found)
