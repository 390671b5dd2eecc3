"""Whatever way a table is written, the same numbers come out; whatever is wrong has a line and a column."""

from __future__ import annotations

import gzip
import io
import math
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.datasets.findings import UnusableFileError
from service.datasets.readers.text_table import parse_text, read_text
from service.datasets.run import MAX_ROWS_PER_RUN

numbers = st.floats(min_value=-1e6, max_value=1e6, allow_nan=False)


def values(table):
    return [column.values for column in table.numbers(range(table.width))]


@st.composite
def written_tables(draw):
    """(matrix, bytes, line of each row): one table in one of the ways that programs write."""
    width, rows = draw(st.integers(2, 5)), draw(st.integers(1, 6))
    matrix = np.array(draw(st.lists(st.lists(numbers, min_size=width, max_size=width), min_size=rows, max_size=rows)))
    delimiter = draw(st.sampled_from([",", ";", "\t", " ", "   ", ", "]))
    form = draw(st.sampled_from(["{!r}", "{:.17e}", "{:+.17g}", "{:.17E}"]))
    lines, where = [], []
    if draw(st.booleans()):
        lines.append("// by a program")
    if draw(st.booleans()):
        lines.append(delimiter.join(f"column{i}" for i in range(width)) + draw(st.sampled_from(["", delimiter])))
    tail = draw(st.booleans())
    for row in matrix.tolist():
        lines += draw(st.lists(st.sampled_from(["", "# note, with 1;2 3", "% x", "! 1 2 3", "  "]), max_size=2))
        lines.append(delimiter.join(form.format(value) for value in row) + (delimiter if tail else ""))
        where.append(len(lines))
    text = draw(st.sampled_from(["\n", "\r\n", "\r"])).join(lines)
    text += draw(st.sampled_from(["", "\n", "\n\n"]))
    data = draw(st.sampled_from([b"", b"\xef\xbb\xbf"])) + text.encode()
    return matrix, gzip.compress(data, 1) if draw(st.booleans()) else data, where


@pytest.mark.slow
@given(written_tables())
def test_every_way_of_writing_gives_the_same_numbers_and_lines(case):
    matrix, data, where = case
    table = read_text(io.BytesIO(data))
    np.testing.assert_array_equal(np.column_stack(values(table)), matrix)
    assert table.lines.tolist() == where


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("time,x,z,\n0,1,2,\n", ("time", "x", "z")),
        ('"time" ; "x";"z"\n0;1;2\n', ("time", "x", "z")),
        ("time x z\n0,1,2,\n", ("time", "x", "z")),  # free text over ChWriterCSV rows
        ("time (s)\twall clock time (s)\tRTF\n0\t1\t2\n", ("time (s)", "wall clock time (s)", "RTF")),
        ("# time x z\n0 1 2\n", ("time", "x", "z")),  # numpy.savetxt
        ("# made by hand\n0 1 2\n", ("made", "by", "hand")),  # indistinguishable, and harmless: no known name
        ("# made by a program of ours\n0 1 2\n", None),
        ("0 1 2\n", None),
        ("nan inf 1\n0 1 2\n", None),
    ],
)
def test_header_is_found_where_there_is_one(text, names):
    assert parse_text(text.encode()).names == names


def test_values_that_are_not_finite_are_read_for_validation_to_tell():
    table = parse_text(b"0,nan,1\n1,-inf,2\n2,-nan(ind),3\n3,1.#QNAN,4\n")
    assert [math.isfinite(v) for v in values(table)[1]] == [False] * 4
    assert values(table)[1][1] == -math.inf


@pytest.mark.parametrize(
    ("text", "code", "row", "column"),
    [
        ("t,x\n0,1\n1,2,3\n", "ragged-row", 3, "#2"),
        ("t,x,y,\n0,1,5,\n\n# c\n1,2,\n", "ragged-row", 5, "y"),
        ("t,x\n0,1\n1,2\n2,oops\n", "not-a-number", 4, "x"),
        ("0 1\n1 0x10\n", "not-a-number", 2, "#1"),
        ("0;1,5\n1;2.5\n", "not-a-number", 1, "#1"),
        ("0;1,500\n1;2,500\n", "not-a-number", 1, "#1"),
        ("0;1,5\n1;2,500,0\n", "not-a-number", 1, "#1"),
        ("0,1_000\n", "not-a-number", 1, "#1"),
        ("t,x,y\n0,1\n", "header-mismatch", 2, None),
        ("", "empty-file", None, None),
        ("t,x\n\n# nothing\n", "empty-file", None, None),
        ("0,1\n\x00", "not-text", None, None),
        (",".join("1" * 300), "too-large", 1, None),
    ],
)
def test_what_is_wrong_has_a_code_a_line_and_a_column(text, code, row, column):
    with pytest.raises(UnusableFileError) as caught:
        values(parse_text(text.encode(), file="a.csv"))
    first = caught.value.findings[0]
    assert (first.file, first.code, first.row, first.column) == ("a.csv", code, row, column)


def test_empty_last_columns_are_dropped_only_when_empty_in_every_row():
    assert parse_text(b"0,1,\n1,2,\n").width == 2
    assert parse_text(b"0,1,,\n1,2,,\n").width == 2
    assert parse_text(b"0,1,3\n1,2,4\n").width == 3
    assert values(parse_text(b"0,1,3\n1,2,\n"))[2][0] == 3
    assert parse_text(b"0,1,3\n1,2,\n").numbers([2])[0].blank.tolist() == [False, True]


def test_a_file_full_of_faults_reports_a_bounded_number():
    with pytest.raises(UnusableFileError) as caught:
        values(parse_text(b"0,1\n" + b"x,y\n" * 10_000))
    assert len(caught.value.findings) == 20


@pytest.mark.slow
def test_decompression_bomb_stops_at_the_bound():
    bomb = gzip.compress(b"0,1\n" * 20_000_000, 9)
    assert len(bomb) < 1_000_000
    start = time.process_time()
    with pytest.raises(UnusableFileError, match="more than 1000000 bytes"):
        read_text(io.BytesIO(bomb), max_bytes=1_000_000)
    assert time.process_time() - start < 0.5


def test_plain_file_over_the_bound_is_refused_without_reading_it_all():
    stream = io.BytesIO(b"0,1\n" * 1000)
    with pytest.raises(UnusableFileError, match="too-large"):
        read_text(stream, max_bytes=100)
    assert stream.tell() == 101


@pytest.mark.parametrize("damage", [lambda data: data[:-20], lambda data: data[:40] + b"\0" * 20 + data[60:]])
def test_broken_gzip_is_told(damage):
    data = gzip.compress(np.random.default_rng(1).bytes(2000).hex().encode())
    with pytest.raises(UnusableFileError, match="broken gzip"):
        read_text(io.BytesIO(damage(data)))


def test_too_many_rows_are_refused_before_parsing():
    with pytest.raises(UnusableFileError, match="rows, allowed is at most 2000000"):
        parse_text(b"0 1\n" * (MAX_ROWS_PER_RUN + 2))
