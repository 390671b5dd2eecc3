"""Prints what an environment needs, one requirement a line: `requirements.py serving` or `requirements.py whole`.

`serving` leaves out what pyproject.toml names in `[tool.rover-twin] not-for-serving`. Both have tracing, since nothing
can be added to an image that cannot be written.
"""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path


def requirements(project: Path, kind: str) -> list[str]:
    """The requirements of `project` (a pyproject.toml). Raises KeyError for a `kind` other than the two."""
    document = tomllib.loads(project.read_text(encoding="utf-8"))
    without = {"serving": set(document["tool"]["rover-twin"]["not-for-serving"]), "whole": set()}[kind]
    wanted = [*document["project"]["dependencies"], *document["project"]["optional-dependencies"]["tracing"]]
    return [each for each in wanted if re.split(r"[^\w.-]", each)[0] not in without]


if __name__ == "__main__":
    print(*requirements(Path("pyproject.toml"), sys.argv[1]), sep="\n")
