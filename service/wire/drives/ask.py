"""From a drive as it was asked for to one that can be written."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from service.twin import Loaded, NonFiniteError, OutsideDomainError, Twin
from service.twin.drives import Drive, DriveOutcome, DriveQuestion, Wanted, drives
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
    (found,) = driven_many([question], wanted, strict, loaded, count)
    if isinstance(found, Exception):
        raise found
    return DriveSubject(loaded, found)


def driven_many(
    questions: Sequence[DriveQuestion], wanted: Wanted, strict: bool, loaded: Loaded, count: CountDrive = uncounted
) -> list[Drive | NonFiniteError | OutsideDomainError]:
    """The same for many, sooner: of each the drive, or why there is none. Each counts as long as the others.

    Raises InvalidValueError as `driven` does.
    """
    began, twin = time.perf_counter(), loaded.twin
    answers = drives(twin, questions, wanted)
    each_s = (time.perf_counter() - began) / max(len(questions), 1)
    found: list[Drive | NonFiniteError | OutsideDomainError] = []
    for answer in answers:
        if isinstance(answer, NonFiniteError):
            found.append(answer)
            continue
        count(twin, each_s, answer.summary.outcome, answer.domain.inside)
        refused = strict and not answer.domain.inside
        found.append(twin.outside(answer.domain.verdict()) if refused else answer)
    return found
