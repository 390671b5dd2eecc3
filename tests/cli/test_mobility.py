"""`mobility`: the API's map without a server."""

from __future__ import annotations

import httpx
import pytest

from service.cli.failures import ExitCode
from tests.cli.conftest import call

WORDS = ("mobility", "--mass-kg", "430", "--torque-min-nm", "30", "--model", "rover")
RANGES = ("--torque-max-nm", "120", "--torque-steps", "4", "--slope-max-deg", "40", "--slope-steps", "21")
QUERY = {"mass_kg": 430, "torque_min_nm": 30, "model": "rover", "torque_max_nm": 120, "torque_steps": 4}
QUERY |= {"slope_max_deg": 40, "slope_steps": 21}


@pytest.mark.parametrize("form", ["json", "csv"])
def test_the_answer_is_the_one_of_the_server(serving, form):
    mine = call(*WORDS, *RANGES, "--format", form, "--store", serving.store)
    theirs = httpx.get(f"{serving.address}/v1/mobility", params=QUERY | {"format": form}, timeout=30)

    assert theirs.status_code == 200, theirs.text
    assert mine.code == 0
    assert mine.out.rstrip("\n") == theirs.text.rstrip("\n")


def test_the_map_has_a_letter_for_each_cell(small_store):
    drawn = call(*WORDS, *RANGES, "--store", small_store)
    answer = call(*WORDS, *RANGES, "--json", "--store", small_store).json

    assert drawn.code == 0
    assert "rover@1 (champion)" in drawn.out
    lines = drawn.out.rstrip().splitlines()[-4:]
    letters = {"climbs": "C", "stalls": "-", "slides": "S"}
    for row, line in enumerate(lines):
        torque, steepest, cells = line.split()
        assert float(torque) == answer["torque_nm"][row]
        expected = answer["steepest_climb_slope_deg"][row]
        assert steepest.strip("()") == ("none" if expected is None else f"{expected:.2f}")
        assert steepest.startswith("(") == (answer["steepest_inside_domain"][row] is False)
        outcomes, inside = answer["outcome"][row], answer["inside_domain"][row]
        assert cells.upper().replace(".", "-") == "".join(letters[outcome] for outcome in outcomes)
        assert [cell in "C-S" for cell in cells] == inside


def test_the_ruler_stands_above_its_columns(small_store):
    *_, ruler, line = call(*WORDS, "--store", small_store).out.rstrip().splitlines()
    first = line.rindex(" ") + 1

    for slope in range(0, 36, 5):
        assert ruler[first + slope :].startswith(str(slope))


@pytest.mark.parametrize(
    ("option", "value", "allowed"),
    [
        ("--mass-kg", "0", "1 to 10000"),
        ("--torque-min-nm", "nan", "0 to 10000"),
        ("--torque-max-nm", "29", "at least torque_min_nm"),
        ("--torque-steps", "65", "a whole number from 2 to 64"),
        ("--slope-min-deg", "-46", "-45 to 45"),
        ("--slope-max-deg", "-1", "at least slope_min_deg"),
        ("--slope-steps", "1", "a whole number from 2 to 64"),
        ("--horizon-s", "601", "0.0001 to 600"),
        ("--confidence", "0.5", "0.75 to 0.995"),
        ("--model", "Rover!", "name@version"),
    ],
)
def test_values_that_are_not_allowed(small_store, option, value, allowed):
    answer = call(*WORDS, option, value, "--store", small_store)

    assert answer.code == ExitCode.USAGE
    assert option.removeprefix("--").replace("-", "_") in answer.error
    assert allowed in answer.error


def test_two_forms_are_one_too_many(small_store):
    assert call(*WORDS, "--json", "--format", "csv", "--store", small_store).code == ExitCode.USAGE


def test_what_is_not_there(small_store):
    assert call(*WORDS[:-1], "absent", "--store", small_store).code == ExitCode.NOT_FOUND


@pytest.mark.parametrize(("form", "begin"), [("svg", b"<?xml"), ("png", b"\x89PNG"), ("html", b"<!DOCTYPE html>")])
def test_the_map_is_a_picture_in_a_file(small_store, tmp_path, form, begin):
    file = tmp_path / f"map.{form}"
    done = call(*WORDS, *RANGES, "--format", form, "--output", file, "--store", small_store)

    assert (done.code, done.out) == (0, ""), done.err
    assert file.read_bytes().startswith(begin)


def test_letters_are_no_file(small_store, tmp_path):
    assert call(*WORDS, "--output", tmp_path / "map", "--store", small_store).code == ExitCode.USAGE
