"""Frames that are read and written without the library are those that it reads and writes."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from websockets.frames import Frame, Opcode
from websockets.streams import StreamReader

from service.api.http.connections.frames import LONGEST_BYTES, framed, whole_message

KINDS = st.sampled_from([Opcode.TEXT, Opcode.BINARY])
LENGTHS = st.integers(0, 400) | st.sampled_from([125, 126, LONGEST_BYTES])


def ended(steps):
    """What a parser of the library returns; None if it wants more."""
    try:
        next(steps)
    except StopIteration as stop:
        return stop.value
    return None


@given(KINDS, LENGTHS, st.data())
def test_a_whole_message_is_what_the_library_reads(kind, length, data):
    content = data.draw(st.binary(min_size=length, max_size=length)) if length < 500 else bytes(length)
    assert whole_message(Frame(kind, content).serialize(mask=True)) == (kind is Opcode.TEXT, content)


@given(KINDS, LENGTHS)
def test_the_library_reads_what_is_framed(kind, length):
    reader = StreamReader()
    reader.feed_data(framed(bytes(length), is_text=kind is Opcode.TEXT))
    read = ended(Frame.parse(reader.read_exact, mask=False))
    assert (read.opcode, read.fin, bytes(read.data)) == (kind, True, bytes(length))
    assert not reader.buffer


@given(st.sampled_from(list(Opcode)), st.booleans(), st.binary(max_size=200), st.booleans(), st.integers(0, 300))
def test_all_else_is_left_to_the_library(opcode, final, content, masked, cut):
    frame = (
        Frame(opcode, content, fin=final).serialize(mask=masked) if opcode < Opcode.CLOSE else bytes([0x80 | opcode])
    )
    for sent in (frame[:cut], frame + b"\0", frame + frame):
        if sent != frame:
            assert whole_message(sent) is None
    if not (final and masked and opcode in (Opcode.TEXT, Opcode.BINARY)):
        assert whole_message(frame) is None


@given(st.binary(max_size=300))
def test_any_bytes_are_read_or_left(data):
    found = whole_message(data)
    if found is not None:
        reader = StreamReader()
        reader.feed_data(data)
        read = ended(Frame.parse(reader.read_exact, mask=True))
        assert (read.opcode is Opcode.TEXT, bytes(read.data)) == found
        assert not reader.buffer


def test_long_messages_are_left_to_the_library():
    assert whole_message(Frame(Opcode.TEXT, bytes(LONGEST_BYTES + 1)).serialize(mask=True)) is None
