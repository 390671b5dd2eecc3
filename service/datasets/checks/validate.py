"""Which runs can be used: the checks of one run in order, and the checks between runs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence

from service.datasets.checks import motion, times, values
from service.datasets.checks.candidate import Candidate
from service.datasets.digest import content_digest
from service.datasets.findings import Code, Finding, reject, warn
from service.datasets.passport import PASSPORT_FILE, Passport
from service.datasets.run import Run
from service.datasets.run_table import FILE as RUN_TABLE
from service.datasets.run_table import RunEntry, radians_suspected

Check = Callable[[Candidate], Iterator[Finding]]

# Each stage relies on the ones before: differences of nan or of unordered times say nothing.
_STAGES: tuple[tuple[Check, ...], ...] = (
    (values.finite, times.rows),
    (values.units,),
    (values.ranges, times.increasing),
    (times.start, times.horizon, times.step, times.gaps),
    (motion.origin, motion.jumps, motion.speed, motion.wheel_band),
)


def check_run(candidate: Candidate) -> list[Finding]:
    """Everything found in one run. A stage that rejects ends the list, except that time and motion are
    both told: one correction less for the user.
    """
    findings: list[Finding] = []
    for index, stage in enumerate(_STAGES):
        findings += [finding for check in stage for finding in check(candidate)]
        if index < 3 and any(finding.rejects for finding in findings):
            break
    return findings


def check_passport(passport: Passport) -> Iterator[Finding]:
    """The frame is the slope frame, as far as its description tells."""
    if "slope" not in passport.frame.lower():
        message = f"frame is {passport.frame[:80]!r}, expected a slope frame (x along the slope, y normal to it)"
        yield warn(PASSPORT_FILE, Code.FRAME, message)


def check_entries(entries: Sequence[RunEntry]) -> Iterator[Finding]:
    """Lines of runs.csv against each other: files listed twice, slopes in radians (all lines rejected)."""
    first_line: dict[str, int] = {}
    for entry in entries:
        if entry.file in first_line:
            message = f"{entry.file} is already listed in line {first_line[entry.file]}"
            yield reject(RUN_TABLE, Code.DUPLICATE_ENTRY, message, row=entry.line, column="file")
        first_line.setdefault(entry.file, entry.line)
    suspicion = radians_suspected([entry.slope_deg for entry in entries])
    if suspicion is not None:
        shown = ", ".join(f"{entry.slope_deg:g}" for entry in entries[:4])
        message = f"slopes ({shown}) all lie within 0.79: looks like radians, expected degrees"
        say = reject if suspicion is Code.UNITS else warn
        yield say(RUN_TABLE, suspicion, message, column="slope_deg")


def check_duplicates(runs: Iterable[tuple[str, Run]]) -> Iterator[Finding]:
    """Runs (with their files) against each other, in order.

    The same content twice rejects the later one; under *different* scenarios it rejects both, since one of
    the labels is wrong and nothing tells which. One scenario with different content is a warning: a
    repetition with another time step is legitimate, but weighs twice in training.
    """
    by_content: dict[str, tuple[str, Run]] = {}
    by_scenario: dict[tuple[float, ...], str] = {}
    for file, run in runs:
        digest = content_digest(run)
        if digest in by_content:
            other_file, other = by_content[digest]
            same = other.scenario == run.scenario
            message = "the same trajectory as {}" + ("" if same else ", but for another scenario: which one is it?")
            yield reject(file, Code.DUPLICATE_CONTENT, message.format(other_file))
            if not same:
                yield reject(other_file, Code.DUPLICATE_CONTENT, message.format(file))
            continue
        by_content[digest] = (file, run)
        if run.scenario in by_scenario:
            message = f"the same scenario as {by_scenario[run.scenario]}, with another trajectory"
            yield warn(file, Code.DUPLICATE_SCENARIO, message)
        by_scenario.setdefault(run.scenario, file)
