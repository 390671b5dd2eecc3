"""What is told of datasets: the report of an upload, and who uses one."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BaseModel, Field

from service.datasets import ValidationReport

MOST_FINDINGS = 1000
"""Findings that an answer lists; counts are always complete."""


class FindingAnswer(BaseModel):
    """One thing found in an upload; `reject` keeps its run out, `warn` does not."""

    file: str
    row: Annotated[int | None, Field(description="Line of the file, counted from 1; null when it is about the whole.")]
    column: str | None
    code: Annotated[str, Field(description="Stable name of the reason.")]
    severity: Annotated[str, Field(pattern="^(reject|warn)$")]
    message: str


class ReportAnswer(BaseModel):
    """What was accepted, what was not and why."""

    accepted: Annotated[list[str], Field(description="Files (or groups of rows) that became runs.")]
    rejected: Annotated[list[str], Field(description="Those that did not.")]
    findings: Annotated[list[FindingAnswer], Field(description=f"The first {MOST_FINDINGS}, rejections first.")]
    findings_count: int
    summary: Annotated[
        dict[str, Any] | None,
        Field(
            description="Runs, rows, ranges, sampling and columns of what was accepted, and which runs vary "
            "(`varies`, `varying_runs`); null when nothing was."
        ),
    ]


class DatasetUsers(BaseModel):
    """Versions and jobs that use a dataset. While there are any, it cannot be deleted."""

    versions: Annotated[list[str], Field(description="Published versions, as name@number.")]
    jobs: Annotated[
        list[str] | None,
        Field(description="Ids of queued and running training jobs; null while their database does not answer."),
    ]


def report_document(report: ValidationReport) -> dict[str, Any]:
    """The report as it stands in an answer: a `ReportAnswer`, its findings bounded."""
    document = report.as_json()
    findings = list(report.findings)
    ordered = [each for each in findings if each.rejects] + [each for each in findings if not each.rejects]
    shown = [
        {"file": each.file, "row": each.row, "column": each.column}
        | {"code": each.code.value, "severity": each.severity.value, "message": each.message}
        for each in ordered[:MOST_FINDINGS]
    ]
    return document | {"findings": shown, "findings_count": len(findings)}
