"""Runs the cells of a notebook one after the other, as Jupyter does, without Jupyter.

A kernel would be a dozen packages and 100 MB for one test; what it adds are widgets and magics, which we do not use.
"""

from __future__ import annotations

import ast
import asyncio
import inspect
import json
from pathlib import Path
from typing import Any


def cells_of(path: Path) -> list[dict[str, Any]]:
    """The cells, as they are written."""
    found: list[dict[str, Any]] = json.loads(path.read_text(encoding="utf-8"))["cells"]
    return found


def shown_by(cells: list[dict[str, Any]]) -> dict[str, Any]:
    """What each cell of code shows, by its id: the value of its last line, unless that ends with a semicolon."""

    async def run() -> dict[str, Any]:
        names: dict[str, Any] = {"__name__": "__main__"}
        return {
            cell["id"]: await _value("".join(cell["source"]), names) for cell in cells if cell["cell_type"] == "code"
        }

    return asyncio.run(run())


async def _value(source: str, names: dict[str, Any]) -> Any:
    tree = ast.parse(source)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) and not source.rstrip().endswith(";") else None
    await _run(compile(tree, "cell", "exec", ast.PyCF_ALLOW_TOP_LEVEL_AWAIT), names)
    if last is None:
        return None
    return await _run(compile(ast.Expression(last.value), "cell", "eval", ast.PyCF_ALLOW_TOP_LEVEL_AWAIT), names)


async def _run(code: Any, names: dict[str, Any]) -> Any:
    found = eval(code, names)
    return await found if code.co_flags & inspect.CO_COROUTINE else found
