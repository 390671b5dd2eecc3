"""The compiled numbers: each as Python's own exact rounding says, in every place where they are written."""

from __future__ import annotations

import io
import json
import locale
import zipfile
import zlib

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.twin import NonFiniteError
from service.twin.kept import kept
from service.wire.digits import (
    MOST_COLUMNS,
    Rounded,
    Texts,
    address_of,
    checksum,
    library,
    list_text,
    lists_text,
    table_text,
)
from service.wire.forms.arrow import stream_of, stream_of_columns
from service.wire.forms.npz import archive_of
from service.wire.lines import Cells, Lines, Lists
from tests.digits import HALF

LARGEST = 2.0**51  # in units of the last decimal

decimals = st.integers(0, 15)
everyday = st.floats(-1e3, 1e3)
binary_fractions = st.builds(lambda whole, bits: whole / 2.0**bits, st.integers(-(2**40), 2**40), st.integers(0, 20))
near_ties = st.builds(
    lambda whole, places, way: float(np.nextafter((whole + 0.5) / 10.0**places, way)),
    st.integers(-(10**9), 10**9),
    decimals,
    st.sampled_from([-np.inf, 0.0, np.inf]),
)
ties = st.builds(lambda whole, places: (whole + 0.5) / 10.0**places, st.integers(-(10**9), 10**9), decimals)
numbers = st.one_of(everyday, binary_fractions, ties, near_ties, st.floats(allow_nan=False, allow_infinity=False))


def by_hand(value: float, places: int, *, point: bool = True) -> str:
    """What Python's exact formatting says, without zeros at the end and without a minus before a zero."""
    whole, _, after = f"{value:.{places}f}".partition(".")
    after = after.rstrip("0")
    text = f"{whole}.{after or '0'}" if after or point else whole
    return text.removeprefix("-") if float(text) == 0 else text


@given(values=st.lists(numbers, max_size=150), places=decimals)
def test_a_list_has_the_decimals_of_exact_rounding(values, places):
    text = list_text(np.array(values, dtype=np.float64), places).decode()
    large = any(abs(each) * 10.0**places >= LARGEST for each in values)

    assert json.loads(text) == (values if large else [float(by_hand(each, places)) for each in values])
    if not large:
        assert text == "[" + ",".join(by_hand(each, places) for each in values) + "]"


@given(values=st.lists(st.floats(-2e8, 2e8), min_size=1, max_size=150))
def test_what_is_read_back_is_half_a_decimal_away_at_most(values):
    read = np.array(json.loads(list_text(np.array(values), 7)))

    assert np.abs(read - values).max() <= HALF + 2.0**-26  # a float64 of 2e8 is no finer
    assert not np.signbit(read[read == 0]).any()


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0.0"), (-0.0, "0.0"), (-4e-8, "0.0"), (6e-8, "0.0000001"), (5e-8, "0.0"), (1e-300, "0.0"),
        (1.0, "1.0"), (-99.9, "-99.9"), (99.99999996, "100.0"), (0.00390625, "0.0039062"), (0.01171875, "0.0117188"),
        (1e6, "1000000.0"), (123456.7890123, "123456.7890123"), (225179981.0, "225179981.0"), (1e9, "1000000000.0"),
        (1e22, "1e+22"),
    ],
)  # fmt: skip
def test_some_that_are_easily_wrong(value, text):
    assert list_text(np.array([value]), 7).decode() == f"[{text}]"


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("at", [0, 70, 199])
def test_what_is_no_number_is_never_written(value, at):
    values = np.linspace(-1, 1, 200)
    values[at] = value

    for write in (
        lambda: list_text(values, 7),
        lambda: lists_text(values.reshape(4, 50), 7),
        lambda: table_text([Rounded(values, 7)], [b"", b"\n"], 200),
        lambda: Texts.of(values),
    ):
        with pytest.raises(NonFiniteError):
            write()


@given(data=st.data(), rows=st.integers(0, 5), width=st.integers(0, 80), places=st.sampled_from([7, 2]))
def test_lists_of_lists_are_lists_side_by_side(data, rows, width, places):
    values = np.array(data.draw(st.lists(everyday, min_size=rows * width, max_size=rows * width)))
    values = values.reshape(rows, width)
    counts = np.array(data.draw(st.lists(st.integers(0, width), min_size=rows, max_size=rows)), dtype=np.intp)

    assert lists_text(values, places) == b"[%b]" % b",".join(list_text(row, places) for row in values)
    cut = [list_text(row[:count], places) for row, count in zip(values, counts, strict=True)]
    assert lists_text(values, places, counts) == b"[%b]" % b",".join(cut)


@pytest.mark.parametrize("whole", [np.arange(6.0) / 8, (np.arange(12.0) / 16)[::2], np.arange(6) / np.float32(8)])
def test_arrays_may_have_gaps_be_unwritable_and_of_another_type(whole):
    whole.flags.writeable = False

    assert list_text(whole, 7) == b"[0.0,0.125,0.25,0.375,0.5,0.625]"
    assert lists_text(whole.reshape(2, 3).T, 7) == b"[[0.0,0.375],[0.125,0.5],[0.25,0.625]]"


pieces = st.text("():, -01xyz", max_size=40).map(str.encode)


@given(data=st.data(), rows=st.integers(0, 140), kinds=st.lists(st.sampled_from(["text", "7", "0", "12"]), max_size=5))
def test_a_table_is_its_columns_between_its_pieces(data, rows, kinds):
    random = np.random.default_rng(data.draw(st.integers(0, 2**32)))
    around = data.draw(st.lists(pieces, min_size=len(kinds) + 1, max_size=len(kinds) + 1))
    point = data.draw(st.booleans())
    columns, texts = [], []
    for kind in kinds:
        values = random.normal(size=rows) * 10.0 ** random.integers(-9, 3)
        values[random.random(rows) < 0.2] = 3.0
        if kind == "text":
            columns.append(Texts.of(values, point=point))
            texts.append(columns[-1].text.decode().split(",")[:-1])
        else:
            columns.append(Rounded(values, int(kind), point))
            texts.append([by_hand(each, int(kind), point=point) for each in values.tolist()])
    lines = [
        "".join(piece.decode() + text for piece, text in zip(around, [*row, ""], strict=True))
        for row in (zip(*texts, strict=True) if kinds else [()] * rows)
    ]

    assert table_text(columns, around, rows).decode() == "".join(lines)


def test_a_table_with_a_number_too_large_has_all_digits_of_its_columns():
    columns = [Rounded(np.array([1e300, 2.0, 0.123456789]), 7, point=False), Texts(b"a,b,c,", 3)]

    assert table_text(columns, [b"", b" ", b"\n"], 3) == b"1e+300 a\n2 b\n0.123456789 c\n"


@pytest.mark.parametrize(
    ("columns", "around"),
    [
        ([Rounded(np.zeros(2), 7)], [b"", b""]),
        ([Rounded(np.zeros((3, 1)), 7)], [b"", b""]),
        ([Rounded(np.zeros(3), 16)], [b"", b""]),
        ([Rounded(np.zeros(3), -1)], [b"", b""]),
        ([Texts(b"1,2,", 2)], [b"", b""]),
        ([Rounded(np.zeros(3), 7)], [b""]),
        ([Rounded(np.zeros(3), 7)] * (MOST_COLUMNS + 1), [b""] * (MOST_COLUMNS + 2)),
    ],
)
def test_what_is_no_table_is_refused(columns, around):
    with pytest.raises(ValueError, match=r"a column of|no table"):
        table_text(columns, around, 3)


def test_digits_do_not_depend_on_the_locale():
    before = locale.setlocale(locale.LC_NUMERIC)
    for name in ("de_DE.UTF-8", "fr_FR.UTF-8", "de_DE", "fr_FR"):
        try:
            locale.setlocale(locale.LC_NUMERIC, name)
            break
        except locale.Error:
            continue
    else:
        pytest.skip("no locale here writes numbers with a comma")
    try:
        assert list_text(np.array([1.5, 1e9]), 7) == b"[1.5,1000000000.0]"
    finally:
        locale.setlocale(locale.LC_NUMERIC, before)


def test_an_archive_is_what_zipfile_makes_of_what_numpy_saves():
    arrays = {
        "time_s": np.linspace(0, 1, 7),
        "brake": np.array([True, False]),
        "index": np.arange(3),
        "grid": np.arange(6.0).reshape(2, 3).T,
        "none": np.empty((0, 4)),
        "outcome": np.array(["climbs", "slides"]),
        "metadata": np.array('{"a": "ü"}'),
    }
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        for name, values in arrays.items():
            saved = io.BytesIO()
            np.save(saved, np.ascontiguousarray(values) if values.ndim else values)
            archive.writestr(zipfile.ZipInfo(f"{name}.npy"), saved.getvalue())

    assert archive_of(arrays) == file.getvalue()
    with pytest.raises(ValueError, match="objects"):
        archive_of({"x": np.array([None])})


@pytest.mark.parametrize("rows", [0, 1, 201, 60_000])
def test_an_arrow_stream_is_what_pyarrow_writes(rows):
    batch = pa.record_batch(
        {"x_m": pa.array(np.linspace(0, 1, rows)), "brake": pa.array(np.arange(rows) % 3 == 0), "z_m": np.zeros(rows)}
    ).replace_schema_metadata({"frame": "slope"})
    sink = io.BytesIO()
    with pa.ipc.new_stream(sink, batch.schema) as stream:
        stream.write_batch(batch)

    assert stream_of(batch) == sink.getvalue()


@pytest.mark.parametrize("rows", [0, 1, 7, 201, 60_000])
def test_an_arrow_stream_of_columns_is_that_of_their_batch(rows):
    random = np.random.default_rng(rows)
    once = random.normal(size=rows)
    columns = {
        "scenario": [np.arange(rows, dtype=np.int32), np.arange(rows, dtype=np.int32)],
        "time_s": [once] * 2,
        "brake": [random.random(2 * rows) < 0.5],
        "x_m": [np.asfortranarray(random.normal(size=(2 * rows, 2)))[:, 0]],
        "z_m": [np.repeat(once, 4)[::2]],
    }
    arrays = {name: pa.array(np.concatenate(pieces)) for name, pieces in columns.items()}
    batch = pa.record_batch(arrays).replace_schema_metadata({"frame": "slope", "about": "{}"})

    assert stream_of_columns(columns, batch.schema) == stream_of(batch)


@given(st.integers(0, 1 << 16), st.integers(0, 2**32 - 1), st.integers(0, 15))
def test_a_checksum_is_that_of_zlib(size, before, begin):
    content = np.random.default_rng(size).integers(0, 256, begin + size, dtype=np.uint8)[begin:]
    there = library().digits_checksum(address_of(content), size, before)

    assert checksum(content, before) == zlib.crc32(content, before)
    assert there in (-1, zlib.crc32(content, before))


def test_numbers_between_commas_are_a_table_like_any_other():
    rows = 150
    numbers = np.random.default_rng(5).normal(size=(5, rows)) * 40
    numbers[:, ::7] = np.rint(numbers[:, ::7])
    numbers[2, 140] = 123456.789
    times = Texts.of(np.arange(rows) * 0.05)
    for count in range(1, 6):
        lists = [json.loads(list_text(each, 7).decode(), parse_float=str) for each in numbers[:count]]
        wanted = [",".join(line) for line in zip(times.text.decode().split(",")[:-1], *lists, strict=True)]
        columns = [times, *(Rounded(each, 7) for each in numbers[:count])]

        assert table_text(columns, [b"", *[b","] * count, b"\n"], rows).decode() == "\n".join([*wanted, ""])
        numbers[0, 149] = np.inf
        with pytest.raises(NonFiniteError):
            table_text(columns, [b"", *[b","] * count, b"\n"], rows)
        numbers[0, 149] = 1.0


def test_what_is_kept_is_of_arrays_that_cannot_change():
    asked = []

    @kept
    def total(array):
        asked.append(array)
        return float(array.sum())

    own = np.arange(3.0)
    assert [total(own), total(own)] == [3.0, 3.0]
    own[0] = 5.0
    assert total(own) == 8.0
    own.flags.writeable = False
    assert [total(own), total(own), total(own[:2])] == [8.0, 8.0, 6.0]
    assert len(asked) == 5
    for size in range(40):  # none is mistaken for another that had its place
        other = np.full(4, float(size))
        other.flags.writeable = False
        assert total(other) == 4.0 * size


@given(data=st.data(), rows=st.integers(1, 9), width=st.integers(0, 70), kinds=st.lists(st.booleans(), max_size=5))
def test_lines_are_their_places_between_their_pieces(data, rows, width, kinds):
    random = np.random.default_rng(data.draw(st.integers(0, 2**32)))
    around = data.draw(st.lists(pieces, min_size=len(kinds) + 1, max_size=len(kinds) + 1))
    places, texts = [], []
    for listed in kinds:
        if listed:
            values, counts = random.normal(size=(rows, width)), random.integers(0, width + 1, rows)
            places.append(Lists(values, counts, 7))
            texts.append([list_text(row[:count], 7) for row, count in zip(values, counts, strict=True)])
        else:
            texts.append(data.draw(st.lists(pieces, min_size=rows, max_size=rows)))
            places.append(Cells.of(texts[-1]))
    lines = [
        b"".join(piece + text for piece, text in zip(around, [*row, b""], strict=True))
        for row in (zip(*texts, strict=True) if kinds else [()] * rows)
    ]
    first = data.draw(st.integers(0, rows))

    assert Lines(places, around).text(slice(first, rows)) == b"".join(lines[first:])
    assert Cells.listed(b"[1.5,null,true]").in_row(1) == b"null"
