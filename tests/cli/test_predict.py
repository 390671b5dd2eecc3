"""`predict`: the API's answer without a server."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import httpx
import pytest

from service.cli.failures import ExitCode
from tests.cli.conftest import SCENARIO, call

_AT_ROVER = ("--model", "rover")
_QUERY = {"slope_deg": 22, "mass_kg": 430, "torque_nm": 60, "model": "rover", "horizon_s": 3, "include": "prior"}


@pytest.mark.parametrize("form", ["json", "csv"])
@pytest.mark.parametrize("frame", ["slope", "world"])
def test_the_answer_is_the_one_of_the_server(serving, form, frame):
    asked = ("--horizon-s", "3", "--include", "prior", "--frame", frame, "--format", form)
    mine = call("predict", *SCENARIO, *_AT_ROVER, *asked, "--store", serving.store)
    params = {**_QUERY, "frame": frame, "format": form}
    theirs = httpx.get(f"{serving.address}/v1/predictions", params=params, timeout=30)
    assert theirs.status_code == 200, theirs.text
    assert mine.code == 0
    assert mine.out.rstrip("\n") == theirs.text.rstrip("\n")


@pytest.mark.parametrize("form", ["npz", "arrow", "parquet", "usda", "svg", "png"])
def test_files_and_pipes_take_every_form_of_the_server(serving, tmp_path, form):
    params = {**_QUERY, "format": form}
    theirs = httpx.get(f"{serving.address}/v1/predictions", params=params, timeout=60)
    assert theirs.status_code == 200, theirs.text
    words = ("predict", *SCENARIO, *_AT_ROVER, "--horizon-s", "3", "--include", "prior", "--store", serving.store)
    target = tmp_path / f"answer.{form}"
    written = call(*words, "--format", form, "--output", target)
    assert (written.code, written.out) == (0, "")
    assert target.read_bytes().rstrip(b"\n") == theirs.content.rstrip(b"\n")
    if form == "npz":
        piped = subprocess.run(
            [sys.executable, "-m", "service", *map(str, words), "--format", form], capture_output=True, check=True
        )
        assert piped.stdout == theirs.content


def test_a_minus_as_output_is_stdout(small_store, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = ("predict", *SCENARIO, *_AT_ROVER, "--format", "csv", "--store", small_store)
    assert call(*words, "--output", "-").out == call(*words).out
    assert list(tmp_path.iterdir()) == []


def test_a_usd_layer_fits_a_stage_as_the_server_makes_it(serving, tmp_path):
    layout = {"prim_path": "/World/Rover", "origin_m": "1,2,3", "up_axis": "Y", "meters_per_unit": "0.01"}
    theirs = httpx.get(f"{serving.address}/v1/predictions", params={**_QUERY, **layout, "format": "usda"}, timeout=60)
    words = ("predict", *SCENARIO, *_AT_ROVER, "--horizon-s", "3", "--include", "prior", "--store", serving.store)
    options = [part for name, value in layout.items() for part in ("--usd", f"{name}={value}")]

    assert call(*words, "--format", "usda", *options).out.rstrip("\n") == theirs.text.rstrip("\n")
    for form, wrong in (("csv", "up_axis=Y"), ("usda", "up_axis=X"), ("usda", "up=Y"), ("usda", "up_axis")):
        refused = call(*words, "--format", form, "--usd", wrong)
        assert refused.code == ExitCode.USAGE
        assert "allowed is" in refused.err


@pytest.mark.processes
@pytest.mark.parametrize(("form", "code"), [("npz", ExitCode.USAGE), ("arrow", ExitCode.USAGE), ("usda", 0)])
def test_what_is_no_text_is_kept_from_a_terminal(small_store, form, code):
    words = ("predict", *SCENARIO, *_AT_ROVER, "--horizon-s", "1", "--format", form, "--store", small_store)
    leader, follower = os.openpty()
    with os.fdopen(leader, "rb") as screen:
        with os.fdopen(follower, "wb") as terminal:
            command = [sys.executable, "-m", "service", *map(str, words)]
            ended = subprocess.run(command, stdout=terminal, stderr=subprocess.PIPE, text=True)
        assert ended.returncode == code
        if code:
            assert f"--format {form} is no text for a terminal; write it with --output FILE" in ended.stderr
        else:
            assert screen.read1(6) == b"#usda "


def test_json_option_is_the_json_format(small_store):
    words = ("predict", *SCENARIO, *_AT_ROVER, "--store", small_store)
    assert call(*words, "--json").out == call(*words, "--format", "json").out
    assert call(*words, "--json", "--format", "csv").code == ExitCode.USAGE


def test_the_table_ends_where_the_trajectory_does(small_store):
    words = ("predict", *SCENARIO, *_AT_ROVER, "--store", small_store)
    table, answer = call(*words).out, call(*words, "--json").json
    assert f"{answer['trajectory']['x_m'][-1]:.4f}" in table
    assert answer["summary"]["outcome"] in table
    assert "rover@1 (champion)" in table


def test_output_goes_to_the_file(small_store, tmp_path):
    target = tmp_path / "answer.json"
    answer = call("predict", *SCENARIO, *_AT_ROVER, "--json", "--output", target, "--store", small_store)
    assert answer.out == ""
    assert json.loads(target.read_text())["model"]["name"] == "rover"


def test_outside_the_domain_is_told_and_with_strict_refused(small_store):
    words = ("predict", "--slope-deg", "40", *SCENARIO[2:], *_AT_ROVER, "--store", small_store)
    told, refused = call(*words), call(*words, "--strict")
    assert told.code == 0
    assert "OUTSIDE" in told.out
    assert refused.code == ExitCode.REFUSED
    assert "slope_deg 40" in refused.error
    assert refused.out == ""


@pytest.mark.parametrize(
    ("option", "value", "allowed"),
    [
        ("--slope-deg", "90", "-45 to 45"),
        ("--slope-deg", "nan", "-45 to 45"),
        ("--mass-kg", "-1", "1 to 10000"),
        ("--torque-nm", "inf", "0 to 10000"),
        ("--horizon-s", "0", "to 600"),
        ("--horizon-s", "1e9", "to 600"),
        ("--dt-s", "1e-9", "0.0001 to 60"),
        ("--include", "posterior", "prior"),
        ("--model", "Rover!", "name@version"),
    ],
)
def test_values_that_are_not_allowed(small_store, option, value, allowed):
    answer = call("predict", *SCENARIO, *_AT_ROVER, option, value, "--store", small_store)
    assert answer.code == ExitCode.USAGE
    assert allowed in answer.error
    assert option.removeprefix("--").replace("-", "_") in answer.error


def test_too_many_points_are_refused(small_store):
    fine = ("--horizon-s", "600", "--dt-s", "0.0001")
    answer = call("predict", *SCENARIO, *_AT_ROVER, *fine, "--store", small_store)
    assert answer.code == ExitCode.USAGE
    assert "100000 points" in answer.error


@pytest.mark.parametrize("reference", ["absent", "rover@9", "rover@candidate"])
def test_what_is_not_there(small_store, reference):
    answer = call("predict", *SCENARIO, "--model", reference, "--store", small_store)
    assert answer.code == ExitCode.NOT_FOUND
    assert answer.out == ""


def test_damaged_weights_are_one_line(store):
    weights = store / "models/rover/versions/1/weights.safetensors"
    weights.write_bytes(weights.read_bytes()[:-1])
    answer = call("predict", *SCENARIO, *_AT_ROVER, "--store", store)
    assert answer.code == ExitCode.FAILED
    assert "weights.safetensors" in answer.error


def test_the_shipped_champion_has_a_band_around_its_trajectory():
    answer = call("predict", *SCENARIO, "--include", "band", "--band-level", "0.8", "--json").json
    assert answer["band"]["level"] == 0.8
    band, x = answer["band"], answer["trajectory"]["x_m"]
    assert all(low <= at <= high for low, at, high in zip(band["x_lower_m"], x, band["x_upper_m"], strict=True))


def test_a_band_that_a_version_has_not_is_refused():
    refused = call("predict", *SCENARIO, "--model", "viper-lunar@1", "--include", "band")
    assert refused.code == ExitCode.USAGE
    assert "published without a band" in refused.err
