"""docs/security.md: every threat has a test, and every test that is named is there."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "security.md").read_text(encoding="utf-8")
NAMED = re.compile(r"`(tests/[\w/]+\.py)::(\w+)`")
_FORBIDDEN = re.compile(
    r"\bimport (?:pickle|marshal|shelve|dill|joblib)\b|\bfrom pickle\b|allow_pickle=True|"
    r"(?<!safetensors\.)torch\.load\(|"
    r"\byaml\.(?:unsafe_)?load\(|(?<![\w.])(?:eval|exec)\("
)


def test_every_named_test_exists():
    named = NAMED.findall(PAGE)

    assert len(named) > 40
    for file, test in named:
        tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
        there = {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)}
        assert test in there, f"{file}::{test}"


def test_every_threat_names_a_test():
    threats = [
        line
        for table in re.findall(r"^\| tried \|.*?(?=\n\n)", PAGE, re.MULTILINE | re.DOTALL)
        for line in table.splitlines()[2:]
    ]

    assert len(threats) > 30
    assert [line for line in threats if not NAMED.search(line)] == []


@pytest.mark.parametrize("folder", ["service", "model_store", "clients/python/src"])
def test_nothing_here_unpickles_or_evaluates(folder):
    found = [
        f"{path.relative_to(ROOT)}: {hit.group()}"
        for path in sorted((ROOT / folder).rglob("*.py"))
        for hit in _FORBIDDEN.finditer(path.read_text(encoding="utf-8"))
    ]

    assert found == []
