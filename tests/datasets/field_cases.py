"""Ways in which people's programs write one and the same table: (name, writer, what the report must say).

A table is its header and its rows of texts. Each writer makes bytes of it; whatever it adds or spells in another way,
the numbers are the same.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable
from dataclasses import dataclass

UNITS = {"time_s": "Time (s)", "rear_x_m": "rear x [m]", "rear_y_m": "rear y (m)", "speed_mps": "speed [m/s]"}


@dataclass(frozen=True)
class Way:
    """One way of writing; `codes` must be in the report, and no other finding of the file may."""

    name: str
    write: Callable[[list[str], list[list[str]]], bytes]
    codes: tuple[str, ...] = ()


def is_number(text):
    try:
        float(text)
    except ValueError:
        return False
    return True


def joined(mark, ending="\n", before=(), after="", around=""):
    def write(header, rows):
        lines = [mark.join(f"{around}{cell}{around}" for cell in row) + after for row in (header, *rows)]
        return (ending.join([*before, *lines]) + ending).encode()

    return write


def python_csv(**options):
    def write(header, rows):
        sink = io.StringIO()
        writer = csv.writer(sink, **options)
        writer.writerow(header)
        for row in rows:
            writer.writerow([float(each) if is_number(each) else each for each in row])
        return sink.getvalue().encode()

    return write


def aligned(width=16, header_only=False, left=False):
    def pad(cell):
        return cell.ljust(width) if left else cell.rjust(width)

    def write(header, rows):
        lines = ["".join(map(pad, header))]
        lines += [" ".join(row) if header_only else "".join(map(pad, row)) for row in rows]
        return ("\n".join(lines) + "\n").encode()

    return write


def indexed(header, rows):
    """pandas' `to_string`: aligned, an index without a name."""
    lines = ["  " + "".join(f"{cell:>14}" for cell in header)]
    lines += [f"{at:<2}" + "".join(f"{cell:>14}" for cell in row) for at, row in enumerate(rows)]
    return "\n".join(lines).encode()


def r_table(header, rows):
    """R's `write.table`: no name above the row names, texts in quotes."""

    def cell(text):
        return text if is_number(text) else f'"{text}"'

    lines = [" ".join(f'"{name}"' for name in header)]
    lines += [" ".join([f'"{at}"', *map(cell, row)]) for at, row in enumerate(rows, start=1)]
    return "\n".join(lines).encode()


def with_column(name, value, at=None, mark=","):
    """A further column: `value` is called with the row's index."""

    def write(header, rows):
        place = len(header) if at is None else at
        lines = [[*header[:place], name, *header[place:]]]
        lines += [[*row[:place], value(index), *row[place:]] for index, row in enumerate(rows)]
        return ("\n".join(mark.join(line) for line in lines) + "\n").encode()

    return write


def spelled(write, header=str, cell=str):
    """The same with other spellings of names, or of numbers."""

    def spell(text):
        return cell(text) if is_number(text) else text

    return lambda names, rows: write([header(name) for name in names], [[*map(spell, row)] for row in rows])


def between(line, every=7):
    """A line between the rows; `{n}` is as many delimiters as a row has."""

    def write(header, rows):
        noise = line.replace("{n}", "," * (len(header) - 1))
        lines = [",".join(header)]
        for at, row in enumerate(rows):
            lines += [noise] if at % every == 3 else []
            lines.append(",".join(row))
        return ("\n".join([*lines, noise]) + "\n").encode()

    return write


def fortran(letter, point="1.{}"):
    def cell(text):
        mantissa, exponent = f"{float(text):.9e}".split("e")
        return f"{mantissa}{letter}{int(exponent):+03d}"

    return cell


def three_digits(text):
    """Fortran has no room for the letter beside three digits of exponent."""
    mantissa, exponent = f"{float(text):.9e}".split("e")
    return f"{mantissa}{int(exponent):+04d}"


def units(name):
    return UNITS.get(name, name)


def as_text(index):
    return "start" if index < 5 else "drive"


def with_units(write):
    """A line of units below the header."""
    units = {"s": "s", "m": "m", "mps": "m/s", "deg": "deg", "kg": "kg", "nm": "N m"}

    def written(header, rows):
        return write(
            header,
            [[units.get(name.strip("])").split("_")[-1].split("(")[-1].split("[")[-1], "") for name in header], *rows],
        )

    return written


def decimal_commas(mark):
    return spelled(joined(mark), cell=lambda text: text.replace(".", ","))


COMMA, SPACE = joined(","), joined(" ")
WAYS = [
    Way("commas", COMMA),
    Way("semicolons, CRLF, byte-order mark", lambda h, r: b"\xef\xbb\xbf" + joined(";", "\r\n")(h, r)),
    Way("tabs, CR", joined("\t", "\r")),
    Way("bars", joined("|")),
    Way("a delimiter after every value", joined(",", after=",")),
    # 01: headers over columns
    Way("aligned to the right", aligned()),
    Way("aligned to the left", aligned(left=True)),
    Way("aligned header over rows that are not", aligned(header_only=True)),
    Way("aligned names with units", spelled(aligned(), units)),
    Way("aligned by commas", spelled(COMMA, lambda name: f"{name:>14}", lambda text: f"{text:>14}")),
    Way("aligned by tabs", spelled(joined("\t"), lambda name: f"{name:>14}", lambda text: f"{text:>14}")),
    Way("pandas, to_string", indexed, ("ignored-column",)),
    # 02: comments
    Way("a comment above the header", joined(",", before=["# by a program", "% of ours"]), ("comment",)),
    Way("comments between the rows", between("# paused, then went on"), ("comment",)),
    Way("other comments between the rows", between("// 1"), ("comment",)),
    Way("header in a comment", lambda h, r: b"# " + COMMA(h, r), ("comment",)),
    # 03: columns without values
    Way("two delimiters after every row", joined(",", after=",,")),
    Way("empty cells in quotes at the end", joined(",", after=',"",""')),
    Way("a named column without values", with_column("note", lambda _: ""), ("ignored-column",)),
    Way("an optional label without values", with_column("horizon_s", lambda _: "")),
    Way("an optional column without values", with_column("pitch_rad", lambda _: ""), ("empty-column",)),
    Way("an optional column of NA", with_column("pitch_rad", lambda _: "NA"), ("empty-column",)),
    Way("an optional column of nan", with_column("front_x_m", lambda _: "nan"), ("empty-column",)),
    # 04: columns that nobody asked for
    Way("texts", with_column("phase", as_text, 1), ("ignored-column",)),
    Way("texts first", with_column("phase", as_text, 0), ("ignored-column",)),
    Way("texts that begin as comments do", with_column("phase", lambda at: "#a" if at % 2 else "%b", 0),
        ("ignored-column",)),
    Way("truths", with_column("moving", lambda at: str(at > 3)), ("ignored-column",)),
    Way("half empty", with_column("load_n", lambda at: "5.0" if at < 20 else ""), ("ignored-column",)),
    Way("dates", with_column("stamp", lambda at: f"2026-11-28T09:00:{at:02d}Z", 0), ("ignored-column",)),
    Way("texts with other delimiters", with_column("phase", lambda _: "a;b|c", 1), ("ignored-column",)),
    Way("texts with the delimiter in quotes", with_column("phase", lambda _: '"a, b"', 1), ("ignored-column",)),
    Way("texts with quotes in quotes", with_column("phase", lambda _: '"a ""b"", c"', 1), ("ignored-column",)),
    Way("texts over several lines", with_column("phase", lambda _: '"a\nb"'), ("ignored-column",)),
    Way("texts in Windows-1252", lambda h, r: with_column("phase", lambda _: "H\u00fcgel")(h, r).decode()
        .encode("cp1252"), ("ignored-column", "encoding")),
    Way("two columns of one name", lambda h, r: with_column("a", lambda _: "x")([*h, "a"], [[*x, "1"] for x in r]),
        ("ignored-column",)),
    # 05: quotes
    Way("everything in quotes", joined(",", around='"')),
    Way("everything in quotes, CRLF", joined(";", "\r\n", around='"')),
    Way("everything in single quotes", joined(",", around="'")),
    Way("csv.QUOTE_NONNUMERIC", python_csv(quoting=csv.QUOTE_NONNUMERIC)),
    Way("quotes after spaces", lambda h, r: joined(", ", around='"')(h, r)),
    Way("quotes between tabs", joined("\t", around='"')),
    Way("quotes between spaces", joined(" ", around='"')),
    Way("R, write.csv", lambda h, r: joined(",", around='"')(["", *h], [[str(at), *x] for at, x in enumerate(r, 1)]),
        ("ignored-column",)),
    Way("R, write.table", r_table, ("ignored-column",)),
    # 11: Excel's first line
    Way("sep=;", joined(";", before=["sep=;"])),
    Way("sep=, with more delimiters", joined(",", "\r\n", before=["SEP=,,,"])),
    Way("sep= and a tab", joined("\t", before=["sep=\t"])),
    Way("sep= in quotes", joined("|", before=['"sep=|"'])),
    Way("sep=: and nothing else would tell", joined(":", before=["sep=:"])),
    # 12: rows of delimiters
    Way("rows of delimiters", between("{n}")),
    Way("rows of delimiters and spaces", between(" {n} ")),
    Way("rows of empty quotes", between('"",""')),
    # tables of Excel in most of Europe, and lines above and below the header
    Way("decimal commas, semicolons", decimal_commas(";"), ("decimal-comma",)),
    Way("decimal commas, tabs", decimal_commas("\t"), ("decimal-comma",)),
    Way("decimal commas, spaces", decimal_commas(" "), ("decimal-comma",)),
    Way("decimal commas in quotes", spelled(joined(",", around='"'), cell=lambda text: text.replace(".", ",")),
        ("decimal-comma",)),
    Way("UTF-16, little end first", lambda h, r: COMMA(h, r).decode().encode("utf-16"), ("encoding",)),
    Way("UTF-16, big end first", lambda h, r: b"\xfe\xff" + joined("\t", "\r\n")(h, r).decode().encode("utf-16-be"),
        ("encoding",)),
    Way("titles above the header", joined(",", before=["Climb, by hand", "", "on regolith"]), ("comment",)),
    Way("a line of units below the header", with_units(COMMA), ("comment",)),
    # 20: Fortran
    Way("D exponents", spelled(SPACE, cell=fortran("D"))),
    Way("d exponents, commas", spelled(COMMA, cell=fortran("d"))),
    Way("exponents without a letter", spelled(SPACE, cell=three_digits)),
    Way("signs in front", spelled(COMMA, cell=lambda text: f"{float(text):+.9e}")),
]  # fmt: skip


def readable(name):
    return re.sub(r"[^A-Za-z0-9]+", "-", name).strip("-")
