"""Files that are neither text nor Parquet, by their first bytes: what each one is, and how to make one that is read."""

from __future__ import annotations

import re
from dataclasses import dataclass

from service.datasets.findings import Code, Finding, reject


@dataclass(frozen=True, slots=True)
class Format:
    """A format that cannot be read here. `magic` is what its files have at byte `at`, and `within` at their start.

    `is_packed`: it holds other files.
    """

    what: str
    remedy: str
    magic: tuple[bytes, ...]
    at: int = 0
    within: bytes = b""
    is_packed: bool = False


_PAGE = "docs/training.md has a script"
_CHRONO = "save the times and positions of one body as CSV or Parquet"
_EXCEL = "save each sheet as CSV (Excel: Save as, CSV UTF-8)"
_PANDAS = "in Python: pandas.DataFrame({'time_s': t, 'rear_x_m': x, 'rear_y_m': y}).to_csv('run.csv', index=False)"
_MATLAB = "in MATLAB: writetable(table(time_s, rear_x_m, rear_y_m), 'run.csv')"
_HDF5 = "HDF5, as ChOutputHDF5 of Chrono 10 writes"
_REPACK = "pack its files as zip or tar.gz"
_SOURCE = "write time and position of a wheel into a CSV file beside it, one row per step"

FORMATS: tuple[Format, ...] = (
    # what Chrono and its tools leave behind
    Format("MATLAB 7.3 (HDF5)", _MATLAB, (b"MATLAB 7.3",)),
    Format(_HDF5, f"{_CHRONO}; {_PAGE}", (b"\x89HDF\r\n\x1a\n",)),
    Format(_HDF5, f"{_CHRONO}; {_PAGE}", (b"\x89HDF\r\n\x1a\n",), at=512),
    Format("the output database of Chrono 10 as text (ChOutputASCII)", f"{_CHRONO}, one row per time; {_PAGE}",
           (b"Num time frames ", b"=====================================\nTime: ",
            b"=====================================\r\nTime: ")),
    Format("VTK, or other XML", f"it holds shapes, not a run; {_SOURCE}", (b"# vtk DataFile", b"<VTKFile", b"<?xml")),
    Format("a bag of ROS 1", "in Python: AnyReader of the package rosbags, then to_csv", (b"#ROSBAG V",)),
    Format("MCAP, as ROS 2 and Foxglove write", "in Python: the package mcap-ros2-support, then to_csv",
           (b"\x89MCAP",)),
    # tables of other programs
    Format("a workbook or another document of Office (.xlsx, .docx)", _EXCEL,
           (b"[Content_Types].xml", b"docProps/", b"_rels/.rels", b"xl/"), at=30, within=b"PK"),
    Format("a workbook of Excel 97 (.xls)", _EXCEL, (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1",)),
    Format("an OpenDocument (.ods)", "save each sheet as CSV",
           (b"mimetypeapplication/vnd.oasis",), at=30, within=b"PK"),
    Format("MATLAB 5 (.mat)", _MATLAB, (b"MATLAB 5.0",)),
    Format("NumPy (.npy)", _PANDAS, (b"\x93NUMPY",)),
    Format("pickle", f"load it where you trust it; {_PANDAS}", tuple(b"\x80" + bytes([v]) for v in (2, 3, 4, 5))),
    Format("Arrow (Feather 2)", "in Python: pandas.read_feather('run.arrow').to_parquet('run.parquet')", (b"ARROW1",)),
    Format("Feather 1", "in Python: pandas.read_feather('run.feather').to_parquet('run.parquet')", (b"FEA1",)),
    Format("an Arrow stream", "in Python: pyarrow.ipc.open_stream(file).read_pandas().to_parquet('run.parquet')",
           (b"\xff\xff\xff\xff",)),
    Format("SQLite", "sqlite3 -header -csv run.db 'select * from run' > run.csv", (b"SQLite format 3\x00",)),
    Format("netCDF", "in Python: xarray.open_dataset('run.nc').to_dataframe().to_csv('run.csv')",
           (b"CDF\x01", b"CDF\x02", b"CDF\x05")),
    Format("Avro", "in Python: fastavro.reader(file), then to_csv", (b"Obj\x01",)),
    Format("R data", "in R: write.csv(run, 'run.csv', row.names=FALSE)", (b"RDX2\n", b"RDX3\n", b"X\n\x00\x00\x00")),
    # other ways to pack files
    Format("7-Zip", _REPACK, (b"7z\xbc\xaf\x27\x1c",), is_packed=True),
    Format("RAR", _REPACK, (b"Rar!\x1a\x07",), is_packed=True),
    Format("Zstandard", _REPACK, (b"\x28\xb5\x2f\xfd",), is_packed=True),
    Format("LZ4", _REPACK, (b"\x04\x22\x4d\x18",), is_packed=True),
    Format("lzip", _REPACK, (b"LZIP",), is_packed=True),
    Format("compress (.Z)", _REPACK, (b"\x1f\x9d",), is_packed=True),
    Format("a zip in several parts", _REPACK, (b"PK\x07\x08",), is_packed=True),
    # no data at all
    Format("PDF", _SOURCE, (b"%PDF",)),
    Format("PNG", _SOURCE, (b"\x89PNG",)),
    Format("an ELF program", _SOURCE, (b"\x7fELF",)),
)  # fmt: skip


def format_of(head: bytes) -> Format | None:
    """The format of a file that starts with `head` (520 bytes are enough), or None for what may be read here."""
    # in a tar or zip the first file inside begins a little later
    known = (each for each in FORMATS if any(head.startswith(magic, each.at) for magic in each.magic))
    return next((each for each in known if head.startswith(each.within) and not is_tar(head)), None)


def is_tar(head: bytes) -> bool:
    """Whether it is a tar: it says so at byte 257 or, as old ones and labels of volumes, has a sum of its header."""
    if head.startswith(b"ustar", 257):
        return True
    header = head[:512]
    said = re.fullmatch(rb" *([0-7]{1,7})[ \0]*", header[148:156])
    return said is not None and len(header) == 512 and int(said[1], 8) == sum(header) - sum(header[148:156]) + 8 * 32


def unsupported(head: bytes, file: str) -> Finding | None:
    """The rejection of a file that starts with `head`, or None for what may be read here."""
    found = format_of(head)
    if found is None:
        return None
    message = f"is {found.what}; expected text with one row per sample, Parquet, or an archive of such: {found.remedy}"
    return reject(file, Code.UNSUPPORTED_FORMAT, message)
