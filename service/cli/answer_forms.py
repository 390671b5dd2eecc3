"""The form of an answer that may be a picture or a page: which one was asked for, and where it goes."""

from __future__ import annotations

import sys
from pathlib import Path

from service.cli.failures import UsageError
from service.cli.output import note


def chosen_form(form: str, json: bool, output: Path | None) -> str:
    """The form of an answer, of `--format` and `--json`. Raises UsageError for both, and for pixels on a terminal."""
    if json and form not in ("table", "json"):
        raise UsageError(f"--json and --format {form} ask for two answers; leave one out")
    if form == "png" and output is None and sys.stdout.isatty():
        raise UsageError("--format png is no text for a terminal; write it with --output FILE or pipe it")
    return "json" if json else form


def write_content(content: bytes, form: str, output: Path | None) -> None:
    """An answer to a file, or to stdout; text ends with a line feed."""
    if form != "png":
        content = content.rstrip(b"\n") + b"\n"
    if output is not None:
        output.write_bytes(content)
        note(f"wrote {output}")
    elif form == "png":
        sys.stdout.buffer.write(content)
        sys.stdout.buffer.flush()
    else:
        print(content.decode(), end="")
