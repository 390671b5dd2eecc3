"""Which runs can be used: the checks of one run in order, and the checks between runs."""

from __future__ import annotations

import difflib
import hashlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

from service.datasets.alignment import Frame, Reference
from service.datasets.checks import motion, recording, times, values, wheels
from service.datasets.checks.candidate import Candidate
from service.datasets.digest import content_digest, stored_integers
from service.datasets.file_names import shown
from service.datasets.findings import Code, Finding, reject, warn
from service.datasets.passport import PASSPORT_FILE, Passport
from service.datasets.run import Run
from service.datasets.run_table import FILE as RUN_TABLE
from service.datasets.run_table import RunEntry, radians_suspected
from service.datasets.summary import RunSummary

Check = Callable[[Candidate], Iterator[Finding]]

# Each stage relies on the ones before: differences of nan or of unordered times say nothing.
_STAGES: tuple[tuple[Check, ...], ...] = (
    (values.finite, values.told, times.rows),
    (recording.frame,),
    (values.units, recording.reference),
    (values.ranges, values.brake, values.agreement, times.increasing),
    (times.start, times.horizon, times.step, times.varying, times.gaps, recording.start),
    (motion.origin, motion.jumps, motion.speed, motion.wheel_band, wheels.spin, wheels.pitch),
)


def check_run(candidate: Candidate) -> list[Finding]:
    """Everything found in one run. A stage that rejects ends the list, except that time and motion are
    both told: one correction less for the user.
    """
    findings: list[Finding] = []
    for index, stage in enumerate(_STAGES):
        findings += [finding for check in stage for finding in check(candidate)]
        if index < 4 and any(finding.rejects for finding in findings):
            break
    return findings


def check_passport(passport: Passport) -> Iterator[Finding]:
    """The frame is the slope frame, the point the rear wheel, as far as words tell, and no field is misspelt."""
    frame, body = passport.frame.lower(), passport.reference_body.lower()
    if "slope" not in frame:
        message = (
            f"frame is {passport.frame[:80]!r}, expected a slope frame (x along the slope, y normal to it); if x is "
            f"horizontal and the height vertical, pass --frame {Frame.WORLD}"
        )
        yield warn(PASSPORT_FILE, Code.FRAME, message)
    if "rear" not in body and "back" not in body:
        wanted = Reference.FRONT_WHEEL if "front" in body else Reference.CHASSIS
        message = (
            f"reference_body is {passport.reference_body[:80]!r}, expected the rear wheel's centre; if rear_x_m and "
            f"rear_y_m hold another point's positions, say so: --reference {wanted}"
        )
        yield warn(PASSPORT_FILE, Code.REFERENCE, message, column="reference_body")
    absent = sorted(set(Passport.model_fields) - passport.model_fields_set)
    for name in passport.model_extra or {}:
        meant = difflib.get_close_matches(name.lower(), absent, n=1, cutoff=0.8)
        if meant:
            message = f"{shown(name)!r} is kept but not read: is {meant[0]!r} meant?"
            yield warn(PASSPORT_FILE, Code.PASSPORT, message, column=name)


def check_entries(entries: Sequence[RunEntry]) -> Iterator[Finding]:
    """Lines of runs.csv against each other: files listed twice, slopes in radians (all lines rejected)."""
    first_line: dict[str, int] = {}
    for entry in entries:
        if entry.file in first_line:
            message = f"{entry.file} is already listed in line {first_line[entry.file]}"
            yield reject(RUN_TABLE, Code.DUPLICATE_ENTRY, message, row=entry.line, column="file")
        first_line.setdefault(entry.file, entry.line)
    slopes = [entry.slope_deg for entry in entries if entry.slope_deg is not None]
    suspicion = radians_suspected(slopes)
    if suspicion is not None:
        shown = ", ".join(f"{slope:g}" for slope in slopes[:4])
        message = f"slopes ({shown}) all lie within 0.79: looks like radians, expected degrees"
        say = reject if suspicion is Code.UNITS else warn
        yield say(RUN_TABLE, suspicion, message, column="slope_deg")


@dataclass(frozen=True, slots=True)
class Fingerprint:
    """What tells a run from others, without its rows: digests of its trajectory and of all that it was told."""

    file: str
    content: str
    told: tuple[object, ...]


def fingerprint(file: str, run: Run) -> Fingerprint:
    """Of a run and its file."""
    changes = (hashlib.sha256(stored_integers(run, name).tobytes()).hexdigest() for name in run.varies)
    told = (*run.scenario, *zip(run.varies, changes, strict=True))
    return Fingerprint(file, content_digest(run), told)


def check_duplicates(runs: Iterable[Fingerprint]) -> Iterator[Finding]:
    """Runs against each other, in order.

    The same content twice rejects the later one; under *different* scenarios it rejects both, since one of
    the labels is wrong and nothing tells which. One scenario with different content is a warning: a
    repetition with another time step is legitimate, but weighs twice in training.
    """
    by_content: dict[str, Fingerprint] = {}
    by_scenario: dict[tuple[object, ...], str] = {}
    for run in runs:
        other = by_content.setdefault(run.content, run)
        if other is not run:
            same = other.told == run.told
            message = "the same trajectory as {}" + ("" if same else ", but for another scenario: which one is it?")
            yield reject(run.file, Code.DUPLICATE_CONTENT, message.format(other.file))
            if not same:
                yield reject(other.file, Code.DUPLICATE_CONTENT, message.format(run.file))
            continue
        if run.told in by_scenario:
            message = f"the same scenario as {by_scenario[run.told]}, with another trajectory"
            yield warn(run.file, Code.DUPLICATE_SCENARIO, message)
        by_scenario.setdefault(run.told, run.file)


def check_slopes(runs: Iterable[tuple[str, RunSummary]]) -> Iterator[Finding]:
    """Slopes that change, over all rows of all such runs (with their files): a word where they may be radians."""
    highest = [
        (file, max(abs(run.slope_deg.lowest), abs(run.slope_deg.highest)))
        for file, run in runs
        if "slope_deg" in run.varies
    ]
    if len(highest) > 1 and radians_suspected([slope for _, slope in highest]) is not None:
        file, slope = max(highest, key=lambda each: each[1])
        message = (
            f"slopes that change stay within {slope:g} in all {len(highest)} runs that have them: degrees are expected"
        )
        yield warn(file, Code.SCENARIO_RANGE, message, column="slope_deg")
