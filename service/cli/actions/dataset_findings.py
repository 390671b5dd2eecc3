"""What was found in files, line by line on stderr."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from service.cli.output import note

if TYPE_CHECKING:
    from service.datasets import Finding


def tell_findings(findings: Iterable[Finding]) -> None:
    """A line for each finding, whether it keeps its run out or not."""
    for finding in findings:
        note(f"{'rejected' if finding.rejects else 'note'}: {finding}")
