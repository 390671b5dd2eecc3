"""The result of reading a dataset: what was accepted, what was not and why."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass

from service.datasets.findings import Finding
from service.datasets.summary import DatasetSummary
from service.errors import DatasetError

MAX_FINDINGS = 2000
"""A report is read by people and sent in one answer."""


@dataclass(frozen=True, slots=True)
class ValidationReport:
    """`accepted` and `rejected` are files as listed; `summary` is None when nothing was accepted.

    `findings` are at most `MAX_FINDINGS`, rejections first to stay; `findings_left_out` counts the others.
    """

    accepted: tuple[str, ...]
    rejected: tuple[str, ...]
    findings: tuple[Finding, ...]
    summary: DatasetSummary | None
    findings_left_out: int = 0

    @property
    def rejections(self) -> tuple[Finding, ...]:
        """Findings that keep something out."""
        return tuple(finding for finding in self.findings if finding.rejects)

    def as_json(self) -> dict[str, object]:
        """Plain JSON content."""
        return {
            "accepted": list(self.accepted),
            "rejected": list(self.rejected),
            "findings": [asdict(finding) for finding in self.findings],
            "findings_left_out": self.findings_left_out,
            "summary": self.summary.as_json() if self.summary else None,
        }


def make_report(
    accepted: Sequence[str], rejected: Sequence[str], findings: Sequence[Finding], summary: DatasetSummary | None
) -> ValidationReport:
    """A report within its bound, in the order of the findings."""
    kept = list(findings)
    if len(kept) > MAX_FINDINGS:
        order = sorted(range(len(kept)), key=lambda index: not kept[index].rejects)
        kept = [kept[index] for index in sorted(order[:MAX_FINDINGS])]
    return ValidationReport(tuple(accepted), tuple(rejected), tuple(kept), summary, len(findings) - len(kept))


def refused(findings: Sequence[Finding], what: str = "nothing in it can be used") -> RejectedDatasetError:
    """The error for an upload that cannot be read at all."""
    return RejectedDatasetError(
        make_report((), tuple(dict.fromkeys(f.file for f in findings if f.rejects)), findings, None), what
    )


class RejectedDatasetError(DatasetError):
    """No run is usable, or one is not and the caller was strict; `report` has all reasons."""

    def __init__(self, report: ValidationReport, what: str) -> None:
        self.report, self.what = report, what
        shown = "; ".join(str(finding) for finding in report.rejections[:3])
        more = len(report.rejections) - 3
        super().__init__(f"{what}: {shown}" + (f"; and {more} more" if more > 0 else ""))
