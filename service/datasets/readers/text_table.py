"""A text as a table whose columns are read when they are asked for: Arrow's parser, and a careful one behind it.

The careful way is the definition; the fast one is used where it cannot differ, and knows of no places.
"""

from __future__ import annotations

import io
from collections.abc import Collection, Mapping, Sequence
from typing import BinaryIO

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc
from pyarrow import csv

from service.datasets.findings import MAX_LOCATED, Code, Finding, UnusableFileError, reject
from service.datasets.readers.decimal_comma import Commas, commas_in, told
from service.datasets.readers.numbers import AROUND, AS_C, FORTRAN, NO_VALUE, number
from service.datasets.readers.source import DEFAULT_MAX_BYTES, read_bounded
from service.datasets.readers.table import Lines, Numbers, Texts
from service.datasets.readers.text_header import header_of
from service.datasets.readers.text_lines import SplitText, split_text
from service.datasets.run import MAX_ROWS_PER_RUN


def read_text(stream: BinaryIO, *, file: str = "file", max_bytes: int = DEFAULT_MAX_BYTES) -> TextTable:
    """A whole file, plain or gzipped. Raises UnusableFileError for what is no text with rows of one table."""
    return parse_text(read_bounded(stream, file=file, max_bytes=max_bytes), file=file)


def parse_text(data: bytes, *, file: str = "file", max_rows: int = MAX_ROWS_PER_RUN) -> TextTable:
    """The same for bytes that are already decompressed."""
    return TextTable(split_text(data, file=file, max_rows=max_rows), file)


class TextTable:
    """A `Table` of text. Cells may be `nan` or `inf`: validation says so, not this reader."""

    def __init__(self, text: SplitText, file: str) -> None:
        header = header_of(text, file=file)
        self._text, self.file = text, file
        self.names, self.width, self.noticed = header.names, header.width, header.noticed
        self._cells = len(text.first)

    @property
    def lines(self) -> Lines:
        """1-based line of the file of each row, (row,)."""
        return self._text.lines

    def label(self, index: int) -> str:
        """What a column is called in findings."""
        name = self.names[index] if self.names is not None and index < len(self.names) else ""
        return name or f"#{index}"

    def numbers(self, indices: Sequence[int], *, flags: Collection[int] = ()) -> list[Numbers]:
        """These columns; true and false are 1 and 0 in those of `flags`.

        Raises UnusableFileError with line and column of ragged rows and of what is no number.
        """
        read = self._read(dict.fromkeys(indices, pa.float64()))
        if read is not None:
            return [_with_gaps(read[index]) for index in indices]
        strings = {index: _trimmed(column) for index, column in self._strings(indices).items()}
        strings |= {index: _as_flags(strings[index]) for index in flags if index in strings}
        commas = commas_in(lambda pattern: any(_any(column, pattern) for column in strings.values()))
        if commas is Commas.DECIMAL:
            strings = self._with_points(strings)
        faults: list[Finding] = []
        columns = [self._converted(strings[index], index, commas, faults) for index in indices]
        if faults:
            faults.sort(key=lambda fault: fault.row or 0)
            raise UnusableFileError(faults[:MAX_LOCATED])
        return columns

    def texts(self, index: int) -> Texts:
        """One column as texts. Raises UnusableFileError for ragged rows."""
        column = pc.fill_null(self._strings([index])[index], "")
        encoded = pc.utf8_trim_whitespace(column).combine_chunks().dictionary_encode()
        return Texts(encoded.indices.to_numpy().astype(np.int64), tuple(encoded.dictionary.to_pylist()))

    def _read(self, types: Mapping[int, pa.DataType]) -> dict[int, pa.ChunkedArray] | None:
        """Arrow's parser; None when it sees anything unusual."""
        text = self._text
        keys = [f"c{index}" for index in range(self._cells)]
        wanted = {keys[index]: kind for index, kind in types.items()}
        try:
            table = csv.read_csv(
                io.BytesIO(text.body),
                read_options=csv.ReadOptions(column_names=keys, use_threads=False),
                parse_options=csv.ParseOptions(delimiter=text.delimiter, quote_char=text.quote or False),
                convert_options=csv.ConvertOptions(
                    column_types=wanted,
                    include_columns=list(wanted),
                    null_values=[""],
                    strings_can_be_null=True,
                    check_utf8=False,
                ),
            )
        except pa.ArrowInvalid:
            return None
        if table.num_rows != len(text.lines):
            return None
        return {index: table.column(keys[index]) for index in types}

    def _strings(self, indices: Sequence[int]) -> dict[int, pa.ChunkedArray]:
        """The cells of these columns; where Arrow does not find them row by row."""
        read = self._read(dict.fromkeys(indices, pa.string()))
        if read is not None:
            return read
        self._require_whole_rows()
        rows = list(self._text.rows())
        return {index: pa.chunked_array([pa.array([row[index] for row in rows], pa.string())]) for index in indices}

    def _require_whole_rows(self) -> None:
        faults: list[Finding] = []
        for line, row in zip(self.lines.tolist(), self._text.rows(), strict=True):
            if len(row) != self._cells:
                tail = row[len(row) - (self._cells - self.width) :] if self._cells > self.width else []
                faults.append(self._ragged(len(row) - sum(not cell.strip() for cell in tail), line))
            if len(faults) >= MAX_LOCATED:
                break
        if faults:
            raise UnusableFileError(faults)

    def _ragged(self, count: int, line: int) -> Finding:
        message = f"{count} values, the first row has {self.width}"
        if count < self.width:
            message += "; if the simulation was stopped while writing, delete the unfinished last line"
        return reject(self.file, Code.RAGGED_ROW, message, row=line, column=self.label(min(count, self.width)))

    def _with_points(self, strings: Mapping[int, pa.ChunkedArray]) -> dict[int, pa.ChunkedArray]:
        """These columns with points for their decimal commas, which is told."""
        with_comma = (column.filter(pc.match_substring(column, ",")) for column in strings.values())
        example = next(column[0].as_py() for column in with_comma if len(column))
        self.noticed = (*self.noticed, told(self.file, example))
        return {index: pc.replace_substring(column, ",", ".") for index, column in strings.items()}

    def _converted(self, cells: pa.ChunkedArray, index: int, commas: Commas, faults: list[Finding]) -> Numbers:
        """One column of cells as numbers, by column where possible; else cell by cell, to know what is wrong."""
        for pattern in (None, FORTRAN):
            try:
                spelled = cells if pattern is None else pc.replace_substring_regex(cells, pattern, AS_C)
                return _with_gaps(pc.cast(spelled, pa.float64()))
            except pa.ArrowInvalid:
                continue
        values, found = np.full(len(cells), np.nan), list[Finding]()
        for at, cell in enumerate(cells.to_pylist()):
            try:
                values[at] = np.nan if cell is None else number(cell)
            except ValueError:
                found.append(self._no_number(cell, int(self.lines[at]), index, commas))
                if len(found) >= MAX_LOCATED:
                    break
        faults += found
        return Numbers(values, _blank(cells))

    def _no_number(self, cell: str, line: int, index: int, commas: Commas) -> Finding:
        message = f"{cell[:40]!r} is not a number"
        if "," in cell and commas is not Commas.DECIMAL:
            message += commas
        return reject(self.file, Code.NOT_A_NUMBER, message, row=line, column=self.label(index))


def _trimmed(cells: pa.ChunkedArray) -> pa.ChunkedArray:
    """Cells without what is around them; null where there is no value."""
    cells = pc.utf8_trim(pc.fill_null(cells, ""), characters=AROUND)
    return pc.if_else(pc.is_in(cells, value_set=pa.array(sorted(NO_VALUE))), pa.scalar(None, pa.string()), cells)


def _as_flags(cells: pa.ChunkedArray) -> pa.ChunkedArray:
    for written, flag in ((r"^(?i:true)$", "1"), (r"^(?i:false)$", "0")):
        cells = pc.replace_substring_regex(cells, written, flag)
    return cells


def _any(column: pa.ChunkedArray, pattern: str) -> bool:
    return bool(pc.any(pc.match_substring_regex(column, pattern)).as_py())


def _blank(column: pa.ChunkedArray) -> npt.NDArray[np.bool_] | None:
    return column.is_null().to_numpy() if column.null_count else None


def _with_gaps(column: pa.ChunkedArray) -> Numbers:
    return Numbers(column.to_numpy(), _blank(column))
