"""`suggest-runs`: the API's rows without a server."""

from __future__ import annotations

import csv

import httpx
import pytest

from service.cli.failures import ExitCode
from tests.cli.conftest import call

WORDS = ("suggest-runs", "rover")


def test_the_answer_is_the_one_of_the_server(serving):
    # the model was trained on slopes only: three scenarios is what its domain has room for
    address = f"{serving.address}/v1/models/rover/versions/1/suggested-runs"
    table = call(*WORDS, "-n", "3", "--store", serving.store)
    document = call(*WORDS, "-n", "3", "--json", "--store", serving.store)

    assert table.code == 0, table.err
    assert table.out == httpx.get(address, params={"n": 3, "format": "csv"}, timeout=30).text
    assert document.json == httpx.get(address, params={"n": 3}, timeout=30).json()


@pytest.mark.slow
def test_output_goes_to_the_file(small_store, tmp_path):
    target = tmp_path / "runs.csv"
    answer = call("suggest-runs", "rover@1", "-n", "2", "--output", target, "--store", small_store)

    assert (answer.code, answer.out) == (0, "")
    assert target.read_text() == call(*WORDS, "-n", "2", "--store", small_store).out


@pytest.mark.slow
@pytest.mark.parametrize(("count", "allowed"), [("0", "1 to 64"), ("65", "1 to 64"), ("64", "at most")])
def test_counts_that_are_not_allowed(small_store, count, allowed):
    answer = call(*WORDS, "-n", count, "--store", small_store)

    assert answer.code == ExitCode.USAGE
    assert allowed in answer.error


def test_options_that_do_not_go_together(small_store, tmp_path):
    both = call(*WORDS, "--json", "--output", tmp_path / "runs.csv", "--store", small_store)

    assert both.code == ExitCode.USAGE
    assert not (tmp_path / "runs.csv").exists()


def test_what_is_not_there(small_store):
    assert call("suggest-runs", "absent", "--store", small_store).code == ExitCode.NOT_FOUND


def test_a_version_that_lists_no_runs_says_what_is_missing():
    answer = call("suggest-runs", "viper-lunar@1")

    assert answer.code == ExitCode.USAGE
    assert "training runs" in answer.error
    assert answer.out == ""


@pytest.mark.slow
def test_drives_of_the_shipped_champion(tmp_path):
    target = tmp_path / "runs.csv"
    table = call("suggest-runs", "viper-lunar", "--drives", "-n", "6")
    document = call("suggest-runs", "viper-lunar", "--drives", "-n", "6", "--json").json
    kept = call("suggest-runs", "viper-lunar", "--drives", "-n", "6", "--output", target)
    rows = list(csv.DictReader(table.out.splitlines()))

    assert (table.code, kept.code, kept.out) == (0, 0, "")
    assert target.read_text() == table.out
    assert document["model"]["name"] == "viper-lunar"
    assert len({row["file"] for row in rows}) == len(rows) == len(document["drives"]) == 6
    for row, drive in zip(rows, document["drives"], strict=True):
        assert {name: row[name] for name in ("file", "set")} == {name: drive[name] for name in ("file", "set")}
        assert [float(row[name]) for name in ("mass_kg", "horizon_s", "step_s")] == [
            drive[name] for name in ("mass_kg", "horizon_s", "step_s")
        ]
        track, controls = drive["track"], drive["controls"]
        assert pairs(row["slopes"]) == list(zip(track["distance_m"], track["slope_deg"], strict=True))
        acts = [-1 if brake else torque for torque, brake in zip(controls["torque_nm"], controls["brake"], strict=True)]
        assert pairs(row["torques"]) == list(zip(controls["time_s"], acts, strict=True))
        assert sum(drive["probabilities"].values()) == pytest.approx(1.0)
        assert any(controls["brake"]) == (drive["change"] == "stop")


def pairs(text):
    return [tuple(map(float, each.split(":"))) for each in text.split()]


def test_a_version_that_knows_no_drives_says_what_is_missing():
    answer = call("suggest-runs", "viper-lunar-paper", "--drives")

    assert answer.code == ExitCode.USAGE
    assert "drive_model" in answer.error
    assert answer.out == ""
