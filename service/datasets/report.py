"""The result of reading a dataset: what was accepted, what was not and why."""

from __future__ import annotations

from dataclasses import asdict, dataclass

from service.datasets.findings import Finding
from service.datasets.summary import DatasetSummary
from service.errors import DatasetError


@dataclass(frozen=True, slots=True)
class ValidationReport:
    """`accepted` and `rejected` are files as listed; `summary` is None when nothing was accepted."""

    accepted: tuple[str, ...]
    rejected: tuple[str, ...]
    findings: tuple[Finding, ...]
    summary: DatasetSummary | None

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
            "summary": self.summary.as_json() if self.summary else None,
        }


class RejectedDatasetError(DatasetError):
    """No run is usable, or one is not and the caller was strict; `report` has all reasons."""

    def __init__(self, report: ValidationReport, what: str) -> None:
        self.report = report
        shown = "; ".join(str(finding) for finding in report.rejections[:3])
        more = len(report.rejections) - 3
        super().__init__(f"{what}: {shown}" + (f"; and {more} more" if more > 0 else ""))
