"""The examples of docs/clients.md: each with the name of its environment, and what it prints."""

from __future__ import annotations

import os
import re
import subprocess
from dataclasses import dataclass
from pathlib import Path

PAGE = Path(__file__).parents[2] / "docs/clients.md"
ADDRESS = "localhost:8000"
_EXAMPLE = re.compile(r"^```(python|sh) ([\w-]+)\n(.*?)^```\n\n```text\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_LONGEST_S = 180


@dataclass(frozen=True)
class Example:
    """A block of the page, and the block of text that follows it."""

    language: str
    environment: str
    text: str
    shown: str

    def prints(self, address: str, programs: Path, folder: Path) -> str:
        """What it prints when it is run in `folder`, with `programs` first in the path; faults are part of it."""
        text = self.text.replace(ADDRESS, address)
        command = [str(programs / "python"), "-c", text] if self.language == "python" else ["sh", "-ec", text]
        variables = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
        variables |= {"PATH": f"{programs}{os.pathsep}{os.environ['PATH']}", "NO_PROXY": "localhost,127.0.0.1"}
        try:
            done = subprocess.run(
                command, cwd=folder, env=variables, capture_output=True, text=True, timeout=_LONGEST_S, check=False
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            return f"{error}\n"
        return done.stdout if done.returncode == 0 else f"{done.stdout}{done.stderr}"


def examples() -> list[Example]:
    """All of them, in the order of the page."""
    return [Example(*found) for found in _EXAMPLE.findall(PAGE.read_text())]


def show(outputs: list[str]) -> None:
    """Writes what each of the examples printed into the page."""
    new = iter(outputs)

    def with_output(found: re.Match[str]) -> str:
        start, end = found.start(4) - found.start(), found.end(4) - found.start()
        return f"{found[0][:start]}{next(new)}{found[0][end:]}"

    PAGE.write_text(_EXAMPLE.sub(with_output, PAGE.read_text()))
