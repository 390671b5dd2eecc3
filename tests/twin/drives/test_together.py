"""Drives of one call have the answers that each has alone, to the bit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from service.twin.drives import Drive, DriveQuestion, Ground, Wanted, controls_of, drive, drives
from service.twin.drives import driving as driving_module
from tests.twin.drives.made import champion, grounds, questions


def assert_same(found: object, wanted: Drive) -> None:
    assert isinstance(found, Drive)
    assert (found.summary, found.events, found.domain) == (wanted.summary, wanted.events, wanted.domain)
    columns = [each.trajectory | ({} if each.band is None else each.band.columns()) for each in (found, wanted)]
    assert columns[0].keys() == columns[1].keys()
    for name, column in columns[0].items():
        assert column.tobytes() == columns[1][name].tobytes(), name


@given(
    questions(),
    st.lists(st.tuples(grounds(), st.floats(250.0, 950.0)), min_size=1, max_size=9),
    st.lists(questions(), max_size=2),
    st.booleans(),
    st.sampled_from([0.05, 0.37]),
)
@settings(max_examples=25)
def test_each_is_as_it_is_alone(
    one: DriveQuestion, others: list[tuple[Ground, float]], strangers: list[DriveQuestion], band: bool, dt_s: float
):
    asked = [one, *(replace(one, ground=ground, mass_kg=mass) for ground, mass in others), *strangers]
    wanted = Wanted(dt_s=dt_s, band=band, band_level=0.93)
    for found, question in zip(drives(champion(), asked, wanted), asked, strict=True):
        assert_same(found, drive(champion(), question, wanted))


def test_many_go_in_parts(monkeypatch: pytest.MonkeyPatch):
    question = DriveQuestion(430.0, Ground.of_slopes([0.0, 4.0], [5.0, 20.0]), controls_of([0.0], [70.0]))
    asked = [replace(question, mass_kg=mass) for mass in np.linspace(300.0, 900.0, 7)]
    whole = drives(champion(), asked, Wanted())
    monkeypatch.setattr(driving_module, "_POINTS_AT_ONCE", 700)
    for found, wanted in zip(drives(champion(), asked, Wanted()), whole, strict=True):
        assert_same(found, wanted)
    assert drives(champion(), [], Wanted()) == []
