"""The beginnings of files that other programs write, by what each of them is called in the rejection."""

from __future__ import annotations

import io
import pickle
import sqlite3
import struct
import zipfile

import numpy as np
import pyarrow as pa
from pyarrow import feather


def hdf5(at=0):
    """A superblock of version 0 (HDF5 file format, III.A), after `at` bytes of something else."""
    block = b"\x89HDF\r\n\x1a\n" + bytes([0, 0, 0, 0, 0, 8, 8, 0]) + struct.pack("<HHI", 4, 16, 0)
    addresses = struct.pack("<QQQQ", at, 2**64 - 1, at + 96, 2**64 - 1)
    return bytes(at) + block + addresses + struct.pack("<QQII", 0, 96, 0, 0) + bytes(16)


def matlab(version):
    return f"MATLAB {version} MAT-file, Platform: PCWIN64, Created on: Mon Nov 23 09:00:00 2026".ljust(116).encode()


def zip_of(*names, first=zipfile.ZIP_DEFLATED):
    sink = io.BytesIO()
    with zipfile.ZipFile(sink, "w") as archive:
        for name in names:
            archive.writestr(name, b"application/vnd.oasis.opendocument.spreadsheet", compress_type=first)
    return sink.getvalue()


def numpy_array():
    sink = io.BytesIO()
    np.save(sink, np.arange(12.0))
    return sink.getvalue()


def arrow(version):
    sink = io.BytesIO()
    table = pa.table({"time_s": [0.0, 0.1]})
    if version == "stream":
        with pa.ipc.new_stream(sink, table.schema) as writer:
            writer.write_table(table)
    else:
        feather.write_feather(table, sink, version=2)
    return sink.getvalue()


def sqlite():
    with sqlite3.connect(":memory:") as database:
        database.execute("create table runs (time_s real)")
        return database.serialize()


ASCII_SERIES = b"Num time frames 2\nNum bodies:     1\nTime 0 0.01 \nBody wheel\n  pos 0 0 0.2 0.001 0 0.2 \n"
ASCII_FRAMES = (
    b"=====================================\nTime: 0\nBody 1 'wheel'\n  COM frame: 0  0  0.2  |  1  0  0  0\n"
)

FOREIGN = {
    "HDF5, as ChOutputHDF5 of Chrono 10": hdf5(),
    "HDF5": hdf5(at=512),
    "MATLAB 7.3 (HDF5)": matlab("7.3") + hdf5(at=512)[116:],
    "MATLAB 5 (.mat)": matlab("5.0") + bytes(400),
    "the output database of Chrono 10 as text": ASCII_SERIES,
    "Chrono 10 as text (ChOutputASCII)": ASCII_FRAMES,
    "VTK": b"# vtk DataFile Version 2.0\nVTK from simulation\nASCII\nDATASET POLYDATA\nPOINTS 2 float\n0 0 0\n1 1 1\n",
    "VTK, or other XML": b'<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="0.1">\n</VTKFile>\n',
    "a bag of ROS 1": b"#ROSBAG V2.0\n" + bytes(64),
    "MCAP": b"\x89MCAP0\r\n" + bytes(64),
    "a workbook or another document of Office": zip_of("[Content_Types].xml", "xl/workbook.xml"),
    "document of Office (.xlsx, .docx)": zip_of("docProps/app.xml", "[Content_Types].xml", "xl/workbook.xml"),
    "a workbook of Excel 97": b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(504),
    "an OpenDocument": zip_of("mimetype", "content.xml", first=zipfile.ZIP_STORED),
    "NumPy (.npy)": numpy_array(),
    "pickle": pickle.dumps({"time_s": [0.0, 0.1]}),
    "Arrow (Feather 2)": arrow(2),
    "an Arrow stream": arrow("stream"),
    "Feather 1": b"FEA1" + bytes(60),
    "SQLite": sqlite(),
    "netCDF": b"CDF\x02" + bytes(60),
    "Avro": b"Obj\x01" + bytes(60),
    "R data": b"RDX3\nX\n" + bytes(60),
}
