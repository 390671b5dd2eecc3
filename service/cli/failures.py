"""Errors as one line on stderr and an exit code that scripts may rely on."""

from __future__ import annotations

import traceback
from dataclasses import dataclass
from enum import IntEnum

import typer
from pydantic import ValidationError

from service.access.token_file import TokenFileError
from service.cli.output import note
from service.errors import (
    DatasetInUseError,
    IdempotencyKeyError,
    InvalidValueError,
    JobNotFoundError,
    JobStateError,
    RoverTwinError,
)
from service.parts import missing_part


class ExitCode(IntEnum):
    """What the exit code of `rover-twin` means. The numbers do not change."""

    DONE = 0
    FAILED = 1
    USAGE = 2
    NOT_FOUND = 3
    REFUSED = 4
    INTERRUPTED = 130


EXIT_CODES_HELP = (
    "Exit codes: 0 done; 1 failed; 2 wrong usage or a value that is not allowed; 3 a model, version, alias, dataset, "
    "job or token is not there; 4 refused by a check (outside the domain with --strict, dataset rejected) or by the "
    "state of a job (cancelled, ended) or version (archived, deleted, named by an alias); 130 interrupted."
)


class UsageError(RoverTwinError):
    """Options that do not go together or a value that cannot be read; the message says which and what to write."""


class RefusedError(RoverTwinError):
    """A check that the user asked for says no: outside the domain with --strict, or a rejected dataset."""


class ServerError(RoverTwinError):
    """The server could not start or had to give up; its log says why."""


@dataclass(frozen=True, slots=True)
class Failure:
    """One line for people and the exit code."""

    message: str
    code: int


def report(error: Exception, *, debug: bool) -> int:
    """Tell why a command failed, with the traceback when `debug`; the exit code."""
    if type(error).__name__ == "NoArgsIsHelpError":  # the help has been printed
        return ExitCode.USAGE
    if debug:
        traceback.print_exception(error)
    failure = failure_of(error)
    note(f"error: {failure.message}")
    return failure.code


def failure_of(error: Exception) -> Failure:
    """Any exception as a failure. Ours say what is wrong themselves; what is unexpected says how to see where."""
    if isinstance(error, typer.TyperException):
        said = error.format_message().replace(": Value error, ", ": ")  # pydantic's words, for choices
        return Failure(_one_line(f"{said}{_where_help_is(error)}"), error.exit_code)
    if isinstance(error, ValidationError):
        return Failure(_one_line(_validation_reasons(error)), ExitCode.USAGE)
    if isinstance(error, ImportError):
        error = missing_part(error) or error
    code = _code_of(error)
    if code is not None:
        return Failure(_one_line(str(error)), code)
    if isinstance(error, OSError):
        return Failure(_one_line(str(error)), ExitCode.FAILED)
    text = f"unexpected {type(error).__name__}: {error} (`rover-twin --debug ...` shows where)"
    return Failure(_one_line(text), ExitCode.FAILED)


_WRONG_USAGE = (UsageError, InvalidValueError, IdempotencyKeyError, TokenFileError)


def _code_of(error: Exception) -> ExitCode | None:
    """The exit code of an error that our own code raises on purpose, else None."""
    from model_store import (
        DatasetNameTakenError,
        InvalidDraftError,
        InvalidReferenceError,
        NotFoundError,
        StoreError,
        VersionInUseError,
        VersionRetiredError,
    )
    from service.settings import SettingsError

    if isinstance(error, (NotFoundError, JobNotFoundError)):
        return ExitCode.NOT_FOUND
    if isinstance(
        error,
        (RefusedError, DatasetInUseError, DatasetNameTakenError, JobStateError, VersionInUseError, VersionRetiredError),
    ):
        return ExitCode.REFUSED
    if isinstance(error, (*_WRONG_USAGE, InvalidReferenceError, InvalidDraftError, SettingsError)):
        return ExitCode.USAGE
    return ExitCode.FAILED if isinstance(error, (RoverTwinError, StoreError)) else None


def _where_help_is(error: typer.TyperException) -> str:
    context = getattr(error, "ctx", None)
    return f" (see `{context.command_path} --help`)" if context is not None else ""


def _validation_reasons(error: ValidationError) -> str:
    reasons = []
    for each in error.errors(include_url=False, include_context=False)[:3]:
        place = ".".join(str(part) for part in each["loc"])
        reasons.append(f"{place} is {str(each['input'])[:60]!r}: {each['msg']}" if place else each["msg"])
    return "; ".join(reasons)


def _one_line(text: str) -> str:
    return " ".join(text.split())
