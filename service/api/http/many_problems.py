"""What is wrong with many of what one request asked for: the first in full, the rest in a line each.

A thousand wrong scenarios with ninety unknown fields each are a megabyte; told in full they were five.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from service.api.http.errors import problem_members, told

MOST_IN_FULL = 32
_LINE = 100  # characters


def problems_of(failures: Mapping[int, Exception]) -> list[dict[str, Any]]:
    """The problems by rising `index`.

    Each is what the route would answer if it were alone, without what only a whole answer has. Beyond
    the first `MOST_IN_FULL` they have a short `detail` and no `errors`.
    """
    return [
        problem_of(index, failures[index], short=count >= MOST_IN_FULL) for count, index in enumerate(sorted(failures))
    ]


def problem_of(index: int, error: Exception, *, short: bool = False) -> dict[str, Any]:
    """One of them."""
    described = told(error)
    found = {"index": index, **problem_members(described)}
    if not short:
        return {**found, **described.members}
    if len(described.detail) > _LINE:
        found["detail"] = described.detail[:_LINE] + "..."
    return found
