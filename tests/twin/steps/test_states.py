"""States as bytes: what was written is read to the bit, everything else is refused with a reason."""

from __future__ import annotations

import struct
import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as stn

from service.twin.steps import read_states, write_states

numbers = stn.arrays(np.float64, st.tuples(st.integers(1, 5), st.just(7)))


def signed(body: bytes) -> bytes:
    return body + zlib.crc32(body).to_bytes(4, "little")


@given(numbers, st.integers(1, 2**32 - 1), st.text(min_size=1, max_size=30))
def test_what_was_written_is_read_to_the_bit(table, version, name):
    written = write_states(name, version, table)
    (found,), wrong = read_states(written)
    assert not wrong
    assert (found.name, found.version) == (name, version)
    assert found.numbers.tobytes() == table.tobytes()
    assert found.rows.tolist() == list(range(len(table)))


def test_several_versions_are_told_apart():
    table = np.arange(12.0).reshape(4, 3)
    a, b = write_states("a", 1, table), write_states("b", 2, table)
    found, wrong = read_states([a[0], b[1], b"?", a[2]])
    assert {(each.name, each.version): each.rows.tolist() for each in found} == {("a", 1): [0, 3], ("b", 2): [1]}
    assert list(wrong) == [2]


@given(st.data())
def test_a_changed_byte_is_noticed(data):
    (state,) = write_states("viper-lunar", 5, np.arange(5.0)[None])
    at, other = data.draw(st.integers(0, len(state) - 1)), data.draw(st.integers(1, 255))
    changed = state[:at] + bytes([state[at] ^ other]) + state[at + 1 :]
    found, wrong = read_states([changed])
    assert not found
    assert list(wrong) == [0]


@given(st.binary(max_size=200))
def test_rubbish_is_refused(rubbish):
    found, wrong = read_states([rubbish])
    assert not found
    assert list(wrong) == [0]


@given(st.integers(0, 60))
def test_what_was_cut_is_refused(kept):
    (state,) = write_states("viper-lunar", 5, np.arange(5.0)[None])
    found, wrong = read_states([state[: min(kept, len(state) - 1)], state])
    assert [each.rows.tolist() for each in found] == [[1]]
    assert list(wrong) == [0]


@pytest.mark.parametrize(
    ("body", "said"),
    [
        (struct.pack("<4sHHI", b"RTST", 2, 1, 5) + b"a" + bytes(8), "format 2"),
        (struct.pack("<4sHHI", b"RTSX", 1, 1, 5) + b"a" + bytes(8), "not the state of a rover"),
        (struct.pack("<4sHHI", b"RTST", 1, 1, 5) + b"\xff" + bytes(8), "names no model"),
        (struct.pack("<4sHHI", b"RTST", 1, 60000, 5) + b"a" + bytes(8), "cut off"),
        (struct.pack("<4sHHI", b"RTST", 1, 1, 5) + b"a" + bytes(7), "cut off"),
        (struct.pack("<4sHHI", b"RTST", 1, 1, 5) + b"a" + bytes(8 * 600), "cut off, or something was added"),
        (b"RVST" + bytes(100), "not the state of a rover"),
    ],
)
def test_the_reason_is_said(body, said):
    assert said in str(read_states([signed(body)])[1][0])
