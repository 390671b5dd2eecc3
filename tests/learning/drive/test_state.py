"""A state travels as bytes: what comes back is what was sent, or a clear error."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.learning.drive import state as state_module
from service.learning.drive.engine import Engine
from service.learning.drive.state import SIZE, State
from tests.learning.drive.drives import Drive, drives
from tests.learning.drive.laws import law_like_the_shipped_one


@given(drives(), st.floats(0.01, 8.0))
def test_a_state_survives_its_bytes(engine: Engine, drive: Drive, until_s: float):
    start = engine.start(drive.mass_kg, drive.start_speed_m_s)
    _, state = engine.drive(start, drive.track, drive.controls, np.array([until_s]))
    data = state.to_bytes()
    assert len(data) < 1024
    back = engine.restore(data, drive.mass_kg)
    assert back == state
    assert hash(back) == hash(state)
    assert back != start
    assert (back.x_m, back.speed_m_s, back.time_s) == (state.x_m, state.speed_m_s, pytest.approx(until_s))


@given(st.integers(0, 10_000), st.integers(1, 255))
def test_no_altered_byte_goes_unnoticed(engine: Engine, at: int, change: int):
    data = bytearray(engine.start(430.0).to_bytes())
    data[at % len(data)] ^= change
    with pytest.raises(ValueError, match="state"):
        engine.restore(bytes(data))


@given(st.binary(max_size=900))
def test_foreign_bytes_are_no_state(engine: Engine, data: bytes):
    with pytest.raises(ValueError, match="not the state of a rover"):
        engine.restore(data)


def test_errors_say_what_it_is(engine: Engine, monkeypatch: pytest.MonkeyPatch):
    data = engine.start(430.0).to_bytes()
    with pytest.raises(ValueError, match=r"of a rover of 430 kg, not of 500 kg"):
        engine.restore(data, 500.0)
    with pytest.raises(ValueError, match="another model"):
        Engine(law_like_the_shipped_one(seed=1)).restore(data)
    for part in (data[:-1], data + b" ", data[:20]):
        with pytest.raises(ValueError, match="cut off"):
            engine.restore(part)
    numbers = engine.start(430.0).numbers.copy()
    numbers[7] = np.nan
    with pytest.raises(ValueError, match="not finite"):
        engine.restore(State(numbers).to_bytes())
    monkeypatch.setattr(state_module, "FORMAT", 2)
    with pytest.raises(ValueError, match="has format 1, this version reads format 2"):
        engine.restore(data)


def test_a_state_of_another_law_does_not_move(engine: Engine):
    other = Engine(law_like_the_shipped_one(seed=1)).start(430.0)
    with pytest.raises(ValueError, match="another law"):
        engine.step([engine.start(430.0), other], 0.1, 60.0, False, 0.1)
    assert engine.start(430.0).numbers.shape == (SIZE,)


def test_laws_with_the_same_numbers_have_the_same_number():
    assert law_like_the_shipped_one().number == law_like_the_shipped_one().number
    assert law_like_the_shipped_one().number != law_like_the_shipped_one(bumps=(40, 25)).number
