"""What may differ between two files of one run, as data: axes, their values, and what may come of each.

The first value of an axis is the clean one. A value with `refused` may be refused, for one of these reasons and no
other; one with `must` has to be. `told` are the codes that the report of an accepted file has, `may` those it can have.
Every other value has to be accepted.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Value:
    """One value of an axis. `refused` are (code, words of the message as a pattern)."""

    name: str
    refused: tuple[tuple[str, str], ...] = ()
    must: bool = False
    told: tuple[str, ...] = ()
    may: tuple[str, ...] = ()


def must(name, *reasons):
    """A value that has to be refused, for one of these reasons."""
    return Value(name, reasons, must=True)


def told(name, *codes):
    """A value that is accepted, with these codes in the report."""
    return Value(name, told=codes)


def plain(*names):
    """Values of which nothing needs to be said."""
    return tuple(map(Value, names))


UNSORTED = (("time-backward", "is earlier than the row before"), ("time-duplicate", "repeats the time"))
NO_HEADER = ("missing-column", "there is no header over its")
GAP = ("empty-cell", "no value in this cell")
WORD = ("not-a-number", "is not a number")

AXES: dict[str, tuple[Value, ...]] = {
    "carrier": plain("alone", "long", "long, runs not named", "archive", "archive, runs.csv alike", "table in archive"),
    "wrap": (
        *plain("none", "gz", "gz of two members", "bz2", "xz"),
        *plain("zip", "zip, stored", "zip, with a folder", "zip, members gz"),
        told("zip by DOS", "renamed"),
        told("zip by macOS", "unlisted-file"),
        must("zip, encrypted", ("encrypted", "without a password")),
        must("zip in a zip", ("nested-archive", "is itself an archive")),
        *plain("tar", "tar, pax", "tar, gnu", "tar.gz", "tar.bz2", "tar.xz", "tar, ./ in front", "tar, with folders"),
        must("tar, with a link", ("link", "put the file itself")),
    ),
    "delimiter": plain("comma", "semicolon", "tab", "bar", "space", "aligned", "comma and space"),
    "header": (
        *plain("usual", "other names", "Names (unit)", "names[unit]", "UPPER", "own names, mapped", "none, mapped"),
        must("none", NO_HEADER),
        told("groups above", "comment"),
        told("units below", "comment"),
        told("title above", "comment"),
        told("in a comment", "comment"),
        *plain("sep="),
    ),
    "quoting": plain("none", "all", "header", "texts", "single"),
    "index": (
        *plain("none"),
        *(told(name, "ignored-column") for name in ("no name above", "empty name", "index", "from one")),
    ),
    "encoding": (
        *plain("ASCII", "byte-order mark"),
        told("UTF-8", "ignored-column"),
        told("Windows-1252", "ignored-column", "encoding"),
        told("UTF-16, little", "ignored-column", "encoding"),
        told("UTF-16, big", "ignored-column", "encoding"),
        must("UTF-16, no mark", ("not-text", "UTF-16")),
    ),
    "ends": plain("LF", "CRLF", "CR", "mixed", "none at the end", "blank at the end"),
    "units": (
        *plain("SI"),
        *(must(f"{unit} by name", ("units", f"is in {unit}, expected")) for unit in ("mm", "cm", "ms")),
        told("deg by name", "ignored-column"),
        told("km/h by name", "ignored-column"),
        must("mm without a word", ("units", "millimetres")),
        must("ms without a word", ("out-of-range", "another unit")),
    ),
    "number": (
        *plain("repr", "six digits", "six decimals", "1.0e-03", "1.0D-03", "1.0-003", "+1.0", "padded"),
        told("1,0", "decimal-comma"),
        *(must(name, ("not-a-number", "thousands")) for name in ("1,0 and 1.430", "1.0 and 1,430")),
    ),
    "hole": (
        *plain("none"),
        *(must(name, ("non-finite", "is not finite")) for name in ("nan", "inf", "1.#QNAN")),
        *(must(name, WORD) for name in ("-", "0x1p-3", "stuck", "1_0.0", "1.2.3")),
        *(must(name, GAP) for name in ("N/A", "empty")),
    ),
    "extra": (
        *plain("none"),
        *(told(name, "ignored-column") for name in (
            "text", "truth", "date", "half empty", "empty", "two of one name", "delimiter in quotes",
            "quotes in quotes", "like comments", "several lines", "counts", "thousands")),
        must("rear_x_m again", ("duplicate-column", "rear_x_m")),
    ),
    "place": plain("last", "first", "middle"),
    "comments": (
        *plain("none"),
        *(told(name, "comment") for name in ("before", "middle", "end", "//", "%", "!")),
    ),
    "blank": plain("none", "empty lines", "delimiters", "spaces"),
    "trailing": plain("none", "one", "two"),
    "order": (
        *plain("usual"),
        *(must(name, *UNSORTED) for name in ("reversed", "shuffled", "two swapped")),
        must("a row twice", *UNSORTED),
        *plain("a row missing"),
        must("cut off", ("ragged-row", "unfinished last line"), GAP),
    ),
    "columns": plain("usual", "reversed", "rotated"),
}  # fmt: skip

CLEAN = {axis: values[0].name for axis, values in AXES.items()}
VALUES = {(axis, value.name): value for axis, values in AXES.items() for value in values}

LONG = ("long", "long, runs not named", "table in archive")
ARCHIVES = ("archive", "archive, runs.csv alike", "table in archive")
SPACED = ("space", "aligned")
COMMAS = ("comma", "comma and space")
PACKED_FILES = ("none", "gz", "gz of two members", "bz2", "xz")
WITHOUT_NAMES = ("none", "none, mapped")


def is_possible(ways):
    """Whether such a file can be written at all."""
    tables = (*LONG, "archive, runs.csv alike")
    return not (
        (ways["wrap"] in PACKED_FILES) == (ways["carrier"] in ARCHIVES)
        # labels of long tables have no numbers to be mapped by
        or (ways["header"] in (*WITHOUT_NAMES, "own names, mapped") and ways["carrier"] in LONG)
        or (ways["header"] == "sep=" and ways["delimiter"] in SPACED)
        or (ways["extra"] == "several lines" and ways["delimiter"] in SPACED)
        or (ways["number"] in ("1,0 and 1.430", "1.0 and 1,430") and ways["carrier"] not in tables)
        or (ways["place"] != "last" and ways["extra"] == "none")
    )


@dataclass(frozen=True)
class Together:
    """What may come of values that are fine alone: `when` is {axis: values}, all of which must hold."""

    when: dict[str, tuple[str, ...]]
    refused: tuple[tuple[str, str], ...] = ()
    may: tuple[str, ...] = ()
    must: bool = False

    def holds(self, ways):
        """Whether the file is of this kind."""
        return all(ways[axis] in values for axis, values in self.when.items())


_MORE_CELLS = (
    ("ragged-row", "values"),
    ("header-mismatch", "does not name the|names fewer columns|between thousands"),
    NO_HEADER,
)
_UNQUOTED = ("none", "header", "texts", "single")
_FEWER_CELLS = (("ragged-row", "values, the"), ("header-mismatch", "does not name the|counts the rows"))
_SHIFTED = (("header-mismatch", "names fewer columns|counts the rows|does not name the"),)

TOGETHER: tuple[Together, ...] = (
    # an unquoted comma ends a cell
    Together({"number": ("1,0",), "delimiter": COMMAS, "quoting": _UNQUOTED[:-1]}, _MORE_CELLS, must=True),
    Together({"number": ("1,0",), "delimiter": COMMAS, "quoting": ("single",)}, _MORE_CELLS),
    Together(
        {"number": ("1,0",), "delimiter": COMMAS, "header": ("none, mapped",)},
        (("out-of-range", "another column"), ("time-duplicate", "repeats the time")),
    ),
    Together({"number": ("1,0 and 1.430", "1.0 and 1,430"), "delimiter": COMMAS, "quoting": _UNQUOTED}, _MORE_CELLS),
    Together(
        {"number": ("1,0", "1,0 and 1.430", "1.0 and 1,430"), "delimiter": COMMAS, "header": ("in a comment",)},
        (("scenario-missing", "does not tell its scenario"),),
    ),
    # spaces leave no trace of a cell without a value, and words make several names
    Together({"delimiter": SPACED, "extra": ("half empty", "empty")}, _FEWER_CELLS),
    Together({"delimiter": SPACED, "hole": ("empty",)}, _FEWER_CELLS),
    Together({"delimiter": SPACED, "header": ("groups above", "units below")}, _FEWER_CELLS),
    Together({"delimiter": ("space",), "header": ("Names (unit)", "own names, mapped")}, _FEWER_CELLS),
    # neither a name above the row names nor a value in the last column
    Together({"index": ("no name above", "empty name"), "extra": ("empty", "half empty")}, _SHIFTED),
    # quotes that are not those of CSV
    Together(
        {"quoting": ("single",), "extra": ("delimiter in quotes", "several lines", "thousands")},
        (*_MORE_CELLS, *_FEWER_CELLS),
    ),
    Together(
        {"header": ("in a comment", *WITHOUT_NAMES), "extra": ("like comments",)},
        (("empty-file", "begin as comments do"),),
    ),
    Together({"header": ("own names, mapped", "none, mapped"), "extra": ("rear_x_m again",)}, may=("ignored-column",)),
    # without names there is no word about units either, but for the numbers themselves
    Together(
        {"header": ("none, mapped",), "units": ("mm by name", "cm by name", "ms by name")},
        (("units", "looks like"), ("out-of-range", "another unit")),
        must=True,
    ),
    Together({"carrier": ("archive, runs.csv alike",), "encoding": ("UTF-16, no mark",)}, (("run-table", "UTF-16"),)),
)
