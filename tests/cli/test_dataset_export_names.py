"""`datasets export`: whatever runs are called, files are written in the new folder only."""

from __future__ import annotations

import json

import pytest

from model_store import DatasetDraft, ModelStore
from service.cli.failures import ExitCode
from service.datasets import Dataset, Run, dataset_id, parse_passport, to_parquet
from tests.cli.conftest import PASSPORT, call
from tests.datasets.conftest import motion


def _stored(root, names):
    """A store that has runs of these names, as if they had been stored before names were looked at."""
    runs = [
        Run(name, "a", 20.0 + count, 430.0, 60.0, 10.0, motion(1.0 + count / 10)) for count, name in enumerate(names)
    ]
    dataset = Dataset("any", parse_passport(json.dumps(PASSPORT).encode()), tuple(runs))
    files = {"runs.parquet": to_parquet(dataset), "passport.json": dataset.passport.canonical_json().encode()}
    ModelStore.open(root / "store", create=True).put_dataset(
        dataset_id(dataset), files, DatasetDraft(name="any", created_by="tests")
    )
    return dataset_id(dataset)


def _every_file(root):
    return {each: each.read_bytes() for each in root.rglob("*") if each.is_file()}


@pytest.mark.parametrize(
    "name", ["../../evil", "../evil", "/evil", "a/../../../evil", "..\\evil", "a\nb", "a\0b", "..", ""]
)
def test_a_name_that_leads_elsewhere_is_refused_before_anything_is_written(name, tmp_path):
    identity = _stored(tmp_path, ["good", name])
    (tmp_path / "ex").mkdir()
    (tmp_path / "ex" / "evil.csv.gz").write_bytes(b"mine")
    (tmp_path / "evil.csv.gz").write_bytes(b"mine")
    before = _every_file(tmp_path)
    refused = call("datasets", "export", identity, tmp_path / "ex" / "out", "--store", tmp_path / "store")
    assert refused.code == ExitCode.FAILED
    assert "nothing is exported" in refused.error
    assert _every_file(tmp_path) == before
    assert [each.name for each in (tmp_path / "ex").iterdir()] == ["evil.csv.gz"]


@pytest.mark.parametrize("names", [["a/b"], ["a/x", "a/y"], ["A", "a"], ["ä" * 200], ["x.parquet"], ["x.csv.gz.csv"],
                                   ["=1+1", "#", "-"], ["a, b", 'q"q'], [".hidden"], ["a b", "c/d"]])  # fmt: skip
def test_every_other_name_comes_back(names, tmp_path):
    identity = _stored(tmp_path, names)
    exported = call("datasets", "export", identity, tmp_path / "out", "--store", tmp_path / "store")
    assert exported.code == 0
    back = call("datasets", "import", tmp_path / "out", "--name", "back", "--json", "--store", tmp_path / "other")
    assert back.json["dataset"]["id"] == identity
