"""What validation says about a dataset: findings with a stable code, a severity, a place and a sentence."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum

from service.datasets.file_names import printable, shown
from service.errors import DatasetError

MAX_LOCATED = 20
"""Findings of one kind that are listed for one file; a broken file has thousands and the first few tell why."""


_LONGEST = 1900
"""Characters of a message."""


class Severity(StrEnum):
    """Whether a finding keeps its run out of the dataset."""

    REJECT = "reject"
    WARN = "warn"


class Code(StrEnum):
    """Stable names of the reasons; clients may match on them."""

    # the upload as a whole
    UNSUPPORTED_FORMAT = "unsupported-format"
    BROKEN_ARCHIVE = "broken-archive"
    BROKEN_PARQUET = "broken-parquet"
    ENCRYPTED = "encrypted"
    LINK = "link"
    SPECIAL_FILE = "special-file"
    NESTED_ARCHIVE = "nested-archive"
    DUPLICATE_NAME = "duplicate-name"
    TOO_MANY_FILES = "too-many-files"
    DECOMPRESSION_BOMB = "decompression-bomb"
    PASSPORT = "passport"
    DEFAULT_PASSPORT = "default-passport"
    IGNORED_FIELD = "ignored-field"
    RENAMED = "renamed"
    # the file as text
    MISSING_FILE = "missing-file"
    UNSAFE_PATH = "unsafe-path"
    UNLISTED_FILE = "unlisted-file"
    TOO_LARGE = "too-large"
    BROKEN_GZIP = "broken-gzip"
    NOT_TEXT = "not-text"
    EMPTY_FILE = "empty-file"
    RAGGED_ROW = "ragged-row"
    EMPTY_CELL = "empty-cell"
    NOT_A_NUMBER = "not-a-number"
    HEADER_MISMATCH = "header-mismatch"
    MISSING_COLUMN = "missing-column"
    DUPLICATE_COLUMN = "duplicate-column"
    IGNORED_COLUMN = "ignored-column"
    EMPTY_COLUMN = "empty-column"
    ENCODING = "encoding"
    DECIMAL_COMMA = "decimal-comma"
    COMMENT = "comment"
    PRESET = "preset"
    MISLABELLED = "mislabelled"
    # the run table
    RUN_TABLE = "run-table"
    SCENARIO_VARIES = "scenario-varies"
    SCENARIO_MISSING = "scenario-missing"
    SCENARIO_RANGE = "scenario-range"
    DUPLICATE_ENTRY = "duplicate-entry"
    DUPLICATE_CONTENT = "duplicate-content"
    DUPLICATE_SCENARIO = "duplicate-scenario"
    # the numbers
    NON_FINITE = "non-finite"
    OUT_OF_RANGE = "out-of-range"
    UNITS = "units"
    TOO_FEW_ROWS = "too-few-rows"
    TIME_DUPLICATE = "time-duplicate"
    TIME_BACKWARD = "time-backward"
    START_TIME = "start-time"
    START_POSITION = "start-position"
    HORIZON = "horizon"
    STEP = "step"
    SAMPLING_GAP = "sampling-gap"
    JUMP = "jump"
    SPEED_MISMATCH = "speed-mismatch"
    WHEEL_BAND = "wheel-band"
    WHEELBASE = "wheelbase"
    # how it was recorded
    FRAME = "frame"
    REFERENCE = "reference"
    SETTLING = "settling"
    MOVING_START = "moving-start"
    ALIGNED = "aligned"


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing found: where (file, 1-based line of that file, column), what and how bad."""

    file: str
    code: Code
    severity: Severity
    message: str
    row: int | None = None
    column: str | None = None

    @property
    def rejects(self) -> bool:
        """Whether the run cannot be used."""
        return self.severity is Severity.REJECT

    def __str__(self) -> str:
        place = self.file
        if self.row is not None:
            place += f" line {self.row}"
        if self.column is not None:
            place += f" column {self.column}"
        return f"{place}: {self.message} [{self.code}]"


def reject(file: str, code: Code, message: str, *, row: int | None = None, column: str | None = None) -> Finding:
    """A finding that keeps the run out."""
    return _finding(file, code, Severity.REJECT, message, row, column)


def warn(file: str, code: Code, message: str, *, row: int | None = None, column: str | None = None) -> Finding:
    """A finding to look at; the run stays."""
    return _finding(file, code, Severity.WARN, message, row, column)


def _finding(file: str, code: Code, severity: Severity, message: str, row: int | None, column: str | None) -> Finding:
    # messages quote files and the libraries that read them
    message = printable(message[:_LONGEST])
    message = message if len(message) < _LONGEST else f"{message[: _LONGEST - 3]}..."
    return Finding(file, code, severity, message, row, None if column is None else shown(column))


class UnusableFileError(DatasetError):
    """One file cannot be read; `findings` says why and where."""

    def __init__(self, findings: Iterable[Finding]) -> None:
        self.findings = tuple(findings)
        shown = "; ".join(str(finding) for finding in self.findings[:3])
        more = len(self.findings) - 3
        super().__init__(shown + (f"; and {more} more" if more > 0 else ""))


def told_too(error: UnusableFileError, noticed: Iterable[Finding]) -> UnusableFileError:
    """The error with what was noticed before it: it may be the cause."""
    return UnusableFileError(dict.fromkeys((*error.findings, *noticed)))
