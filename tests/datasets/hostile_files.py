"""Files that must not become datasets: (name, bytes, expected code). Used by the tests of the API as well.

Each builder makes its file anew, from the same small honest one; nothing here is larger than a few megabytes.
"""

from __future__ import annotations

import bz2
import gzip
import io
import json
import lzma
import struct
import tarfile
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pyarrow as pa
from pyarrow import parquet as pq

from service.datasets import Dataset, Run, parse_passport, to_parquet
from tests.datasets.conftest import PASSPORT, chrono_text, motion

SCENARIO = {"slope_deg": 20.0, "mass_kg": 430.0, "torque_nm": 60.0}
HEADER = "file,set,slope_deg,mass_kg,torque_nm,horizon_s"


@dataclass(frozen=True)
class HostileFile:
    """`code` is in the report's rejections; `form` are the fields that come with the file."""

    name: str
    build: Callable[[], bytes]
    code: str
    filename: str = "upload.bin"
    form: dict = field(default_factory=dict)


def text(**changed):
    return chrono_text({**motion(), **changed})


def changed_at(name, index, value):
    column = motion()[name].copy()
    column[index] = value
    return text(**{name: column})


def honest(files=None, *, passport=None, table=None):
    """The members of an honest archive, with others put in their place."""
    rows = table if table is not None else f"{HEADER}\nrun.csv,a,20,430,60,10\n"
    members = {
        "passport.json": json.dumps(PASSPORT).encode() if passport is None else passport,
        "runs.csv": rows if isinstance(rows, bytes) else rows.encode(),
        "run.csv": text(),
    }
    return members | (files or {})


def zipped(members, *, method=zipfile.ZIP_DEFLATED):
    sink = io.BytesIO()
    with zipfile.ZipFile(sink, "w", method) as archive:
        for name, data in members.items():
            info = name if isinstance(name, zipfile.ZipInfo) else zipfile.ZipInfo(name)
            archive.writestr(info, data, compress_type=method)
    return sink.getvalue()


def zip_named(name):
    """An honest zip with one more member, whose name is written without zipfile's own care."""
    stand_in = "n" * len(name.encode())
    return zipped(honest({stand_in: b"1,2,3\n"})).replace(stand_in.encode(), name.encode())


def zip_mode(mode, data=b"/etc/passwd"):
    info = zipfile.ZipInfo("special")
    info.create_system, info.external_attr = 3, mode << 16
    return zipped({**honest(), info: data})


def zip_twice(first, second):
    sink = io.BytesIO(zipped(honest({"AAAA": b"1", "BBBB": b"2"})))
    return sink.getvalue().replace(b"AAAA", first).replace(b"BBBB", second)


def zip_encrypted():
    data = bytearray(zipped(honest()))
    for magic, at in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        start = data.find(magic)
        while start >= 0:
            data[start + at] |= 1
            start = data.find(magic, start + 4)
    return bytes(data)


def zip_crc():
    data = zipped(honest(), method=zipfile.ZIP_STORED)
    return data.replace(b"0.05,", b"0.06,", 1)


def zip_lying_size():
    """The header says 10 bytes, 4 MB come out."""
    data = bytearray(zipped({"runs.csv": bytes(4_000_000)}))
    start = data.find(b"PK\x01\x02")
    data[start + 24 : start + 28] = struct.pack("<I", 10)
    data[22:26] = struct.pack("<I", 10)
    return bytes(data)


def zip_large_directory():
    data = bytearray(zipped(honest()))
    end = data.rfind(b"PK\x05\x06")
    data[end + 12 : end + 16] = struct.pack("<I", 0xFFFFFFF0)
    return bytes(data)


def zip_large_directory_64():
    data = zipped(honest())
    end = data.rfind(b"PK\x05\x06")
    record = struct.pack("<4sQHHIIQQQQ", b"PK\x06\x06", 44, 45, 45, 0, 0, 1, 1, 1 << 40, 0)
    locator = struct.pack("<4sIQI", b"PK\x06\x07", 0, end, 1)
    return data[:end] + record + locator + data[end:]


def zip_overlapping():
    """Several entries of the directory share the data of one member."""
    data = zipped({"runs.csv": bytes(1_000_000)})
    end, start = data.rfind(b"PK\x05\x06"), data.find(b"PK\x01\x02")
    entry, tail = data[start:end], bytearray(data[end:])
    tail[8:12] = struct.pack("<HH", 50, 50)
    tail[12:16] = struct.pack("<I", 50 * len(entry))
    return data[:start] + 50 * entry + bytes(tail)


def many_members():
    return zipped({f"{index}.csv": b"" for index in range(11_001)}, method=zipfile.ZIP_STORED)


def tarred(members, *extra):
    sink = io.BytesIO()
    with tarfile.open(fileobj=sink, mode="w", format=tarfile.PAX_FORMAT) as archive:
        for name, data in members.items():
            info = tarfile.TarInfo(name)
            info.size = len(data)
            archive.addfile(info, io.BytesIO(data))
        for info in extra:
            archive.addfile(info)
    return sink.getvalue()


def tar_kind(kind, link=""):
    info = tarfile.TarInfo("special")
    info.type, info.linkname = kind, link
    return tarred(honest(), info)


def tar_header(name=b"run.csv", size=b"00000000012", kind=b"0"):
    """One header block as bytes, with a right checksum."""
    block = bytearray(512)
    block[0 : len(name)], block[100:107], block[108:115], block[116:123] = name, b"0000644", b"0000000", b"0000000"
    block[124 : 124 + len(size)], block[136:147], block[148:156] = size, b"00000000000", b" " * 8
    block[156:157], block[257:265] = kind, b"ustar\x0000"
    block[148:155] = b"%06o\x00" % sum(block)
    return bytes(block)


def tar_negative_size():
    return tar_header(size=b"\xff" * 11 + b"\xf0") + bytes(2048)


def tar_negative_pax():
    return tar_header(b"pax", size=b"\xff" * 11 + b"\xf0", kind=b"x") + bytes(2048)


def tar_long_pax():
    return tar_header(b"pax", size=b"%011o" % (64 << 20), kind=b"x") + bytes(1 << 20)


def tar_name_chain():
    """Long-name headers one after the other, each of which asks for the next."""
    return (tar_header(b"././@LongLink", size=b"%011o" % 4, kind=b"L") + b"abc".ljust(512, b"\0")) * 3000


def tar_broken_header():
    data = bytearray(tarred(honest()))
    second = 512 + (len(honest()["passport.json"]) + 511) // 512 * 512
    data[second : second + 40] = b"\x99" * 40
    return bytes(data)


def tar_many():
    return gzip.compress(b"".join(tar_header(b"%d.csv" % i, b"00000000000") for i in range(11_001)) + bytes(1024), 1)


def zeros(packer, megabytes=64):
    return packer(bytes(megabytes << 20))


def xz_memory():
    """A small stream whose header asks the reader for a dictionary of 1.5 GiB."""
    data = bytearray(lzma.compress(text()))
    size = (data[12] + 1) * 4
    data[16] = 0x27 - 0x04
    data[12 + size - 4 : 12 + size] = struct.pack("<I", zlib.crc32(data[12 : 12 + size - 4]))
    return bytes(data)


def deep_json():
    return b'{"a":' * 100_000 + b"1" + b"}" * 100_000


def long_csv(**changed):
    columns = motion(rows=41, horizon_s=10.0)
    count = len(columns["time_s"])
    labels = {
        "run": ["one"] * count,
        "slope_deg": [20.0] * count,
        "mass_kg": [430.0] * count,
        "torque_nm": [60.0] * count,
    }
    every = {**labels, **columns, **changed}
    rows = zip(*every.values(), strict=True)
    return "\n".join([",".join(every), *(",".join(map(str, row)) for row in rows)]).encode()


def parquet(columns, **options):
    sink = io.BytesIO()
    pq.write_table(pa.table(columns), sink, **options)
    return sink.getvalue()


def run(**changed):
    return Run("one", "a", 20.0, 430.0, 60.0, 10.0, {**motion(), **changed})


def ours(**changed):
    return to_parquet(Dataset("ours", parse_passport(json.dumps(PASSPORT).encode()), (run(**changed),)))


def ours_without_rows():
    table = pq.read_table(io.BytesIO(ours()))
    sink = io.BytesIO()
    pq.write_table(table.slice(0, 0), sink)
    return sink.getvalue()


def ours_two_runs_in_a_group():
    one = pq.read_table(io.BytesIO(ours()))
    other = one.set_column(2, one.schema.field(2), pa.array(np.full(one.num_rows, 25.0)))
    sink = io.BytesIO()
    pq.write_table(pa.concat_tables([one, other]), sink)
    return sink.getvalue()


def jumped():
    x = motion()["rear_x_m"].copy()
    x[100:] += 50.0
    return x


def long_footer():
    data = bytearray(ours())
    return bytes(bytes(20 << 20) + data[:-8] + struct.pack("<I", 18 << 20) + b"PAR1").replace(b"\0", b"PAR1", 1)


def rows_bomb():
    """Eleven million rows in a few kilobytes."""
    column = pa.DictionaryArray.from_arrays(pa.array(np.zeros(11_000_000, dtype=np.int8)), pa.array([0.5]))
    return parquet(dict.fromkeys(("time_s", "rear_x_m", "rear_y_m"), column), compression="zstd")


def headless(rows):
    return "\n".join(" ".join(f"{value:g}" for value in row) for row in rows).encode()


def torques_only():
    """As demo_ROBOT_Viper_SCM writes: time and four wheel torques."""
    return headless((t, 60 - t, 59 - t, 58 - t, 57 - t) for t in np.linspace(0, 10, 201))


_T = motion()["time_s"]
_MODES = {"symlink": 0o120777, "character device": 0o020666, "fifo": 0o010666}
_LONE = {"form": SCENARIO, "filename": "run.csv"}
_LONG = {"filename": "long.csv"}
_PARQUET = {"filename": "runs.parquet"}
_ZIP = {"filename": "runs.zip"}
_TAR = {"filename": "runs.tar"}

ARCHIVES = [
    HostileFile("zip: no member", lambda: zipped({}), "missing-file", **_ZIP),
    HostileFile("zip: cut in half", lambda: zipped(honest())[:3000], "broken-archive", **_ZIP),
    HostileFile("zip: content altered", zip_crc, "broken-archive", **_ZIP),
    HostileFile("zip: name leads out", lambda: zip_named("../../out.csv"), "unsafe-path", **_ZIP),
    HostileFile("zip: absolute name", lambda: zip_named("/etc/cron.d/x"), "unsafe-path", **_ZIP),
    HostileFile("zip: drive letter", lambda: zip_named("C:/x.csv"), "unsafe-path", **_ZIP),
    HostileFile("zip: backslashes", lambda: zip_named("..\\..\\x.csv"), "unsafe-path", **_ZIP),
    HostileFile("zip: NUL in a name", lambda: zip_named("a.csv\0.png"), "unsafe-path", **_ZIP),
    HostileFile("zip: escape sequence in a name", lambda: zip_named("\x1b[2Ja.csv"), "unsafe-path", **_ZIP),
    HostileFile("zip: name of 600 characters", lambda: zip_named("x" * 600), "unsafe-path", **_ZIP),
    HostileFile("zip: 40 folders deep", lambda: zip_named("d/" * 40 + "x"), "unsafe-path", **_ZIP),
    HostileFile("zip: link", lambda: zip_mode(_MODES["symlink"]), "link", **_ZIP),
    HostileFile("zip: device", lambda: zip_mode(_MODES["character device"]), "special-file", **_ZIP),
    HostileFile("zip: fifo", lambda: zip_mode(_MODES["fifo"]), "special-file", **_ZIP),
    HostileFile("zip: encrypted", zip_encrypted, "encrypted", **_ZIP),
    HostileFile("zip: one name twice", lambda: zip_twice(b"same", b"same"), "duplicate-name", **_ZIP),
    HostileFile("zip: names equal but for case", lambda: zip_twice(b"same", b"SAME"), "duplicate-name", **_ZIP),
    HostileFile(
        "zip: a file that is a folder", lambda: zip_twice(b"a   ".strip() * 4, b"aaaa"), "duplicate-name", **_ZIP
    ),
    HostileFile("zip: a file below a file", lambda: zipped(honest({"a": b"1", "a/b": b"2"})), "duplicate-name", **_ZIP),
    HostileFile("zip: zip inside", lambda: zipped({**honest(), "x.csv": zipped(honest())}), "nested-archive", **_ZIP),
    HostileFile("zip: tar inside", lambda: zipped({**honest(), "x.csv": tarred(honest())}), "nested-archive", **_ZIP),
    HostileFile("zip: xz inside", lambda: zipped({**honest(), "x": lzma.compress(text())}), "nested-archive", **_ZIP),
    HostileFile("zip: bomb", lambda: zipped(honest({"x.csv": bytes(64 << 20)})), "decompression-bomb", **_ZIP),
    HostileFile("zip: bomb with a lying header", zip_lying_size, "broken-archive", **_ZIP),
    HostileFile("zip: overlapping members", zip_overlapping, "duplicate-name", **_ZIP),
    HostileFile("zip: 11,001 members", many_members, "too-many-files", **_ZIP),
    HostileFile("zip: directory of 4 GB", zip_large_directory, "too-many-files", **_ZIP),
    HostileFile("zip: 64-bit directory of 1 TB", zip_large_directory_64, "too-many-files", **_ZIP),
    HostileFile("zip: packed by LZMA", lambda: zipped(honest(), method=zipfile.ZIP_LZMA), "unsupported-format", **_ZIP),
    HostileFile("tar: name leads out", lambda: tarred(honest({"../out.csv": b"1"})), "unsafe-path", **_TAR),
    HostileFile("tar: absolute name", lambda: tarred(honest({"/tmp/out.csv": b"1"})), "unsafe-path", **_TAR),
    HostileFile("tar: name that is no text", lambda: tarred(honest({"\udcff\udcfe": b"1"})), "unsafe-path", **_TAR),
    HostileFile("tar: symbolic link", lambda: tar_kind(tarfile.SYMTYPE, "/etc"), "link", **_TAR),
    HostileFile("tar: hard link", lambda: tar_kind(tarfile.LNKTYPE, "/etc/passwd"), "link", **_TAR),
    HostileFile("tar: fifo", lambda: tar_kind(tarfile.FIFOTYPE), "special-file", **_TAR),
    HostileFile("tar: device", lambda: tar_kind(tarfile.BLKTYPE), "special-file", **_TAR),
    HostileFile("tar: negative size", tar_negative_size, "broken-archive", **_TAR),
    HostileFile("tar: extended header of negative size", tar_negative_pax, "broken-archive", **_TAR),
    HostileFile("tar: extended header of 64 MB", tar_long_pax, "broken-archive", **_TAR),
    HostileFile("tar: endless chain of headers", tar_name_chain, "broken-archive", **_TAR),
    HostileFile("tar: broken header", tar_broken_header, "broken-archive", **_TAR),
    HostileFile("tar: cut off", lambda: tarred(honest())[:4000], "broken-archive", **_TAR),
    HostileFile("tar: gz inside is a zip", lambda: tarred({"x.gz": gzip.compress(zipped(honest()))}), "nested-archive"),
    HostileFile("tar.gz: bomb", lambda: gzip.compress(tarred({"x.csv": bytes(64 << 20)})), "decompression-bomb"),
    HostileFile("tar.gz: 11,001 members", tar_many, "too-many-files"),
    HostileFile("gz: bomb", lambda: zeros(gzip.compress), "decompression-bomb"),
    HostileFile("gz: of gz", lambda: gzip.compress(gzip.compress(text())), "nested-archive"),
    HostileFile("gz: cut off", lambda: gzip.compress(text())[:-300], "broken-gzip"),
    HostileFile("gz: checksum altered", lambda: gzip.compress(text())[:-8] + bytes(8), "broken-gzip"),
    HostileFile("bz2: bomb", lambda: zeros(bz2.compress), "decompression-bomb"),
    HostileFile("bz2: cut off", lambda: bz2.compress(text())[:-300], "broken-archive"),
    HostileFile("xz: bomb", lambda: zeros(lambda data: lzma.compress(data, preset=0)), "decompression-bomb"),
    HostileFile("xz: wants 1.5 GiB of memory", xz_memory, "broken-archive"),
    HostileFile("xz: something after its end", lambda: lzma.compress(text()) + b"more", "broken-archive"),
    HostileFile("HDF5", lambda: b"\x89HDF\r\n\x1a\n" + bytes(2000), "unsupported-format"),
    HostileFile("7-Zip", lambda: b"7z\xbc\xaf\x27\x1c" + bytes(2000), "unsupported-format"),
    HostileFile("RAR", lambda: b"Rar!\x1a\x07\x01\x00" + bytes(2000), "unsupported-format"),
    HostileFile("Zstandard", lambda: b"\x28\xb5\x2f\xfd" + bytes(2000), "unsupported-format"),
    HostileFile("pickle", lambda: b"\x80\x04\x95\x1e\x00\x00\x00\x00\x00\x00\x00\x8c\x02os.", "unsupported-format"),
    HostileFile("program", lambda: b"\x7fELF" + bytes(2000), "unsupported-format"),
]
FOLDERS = [
    HostileFile("no runs.csv, two files", lambda: zipped({"a.csv": text(), "b.csv": text()}), "missing-file", **_ZIP),
    HostileFile("two datasets", lambda: zipped({"a/runs.csv": b"", "b/runs.csv": b""}), "run-table", **_ZIP),
    HostileFile("passport: no JSON", lambda: zipped(honest(passport=b"{")), "passport", **_ZIP),
    HostileFile("passport: NaN", lambda: zipped(honest(passport=b'{"gravity_m_s2": NaN}')), "passport", **_ZIP),
    HostileFile("passport: 100,000 levels deep", lambda: zipped(honest(passport=deep_json())), "passport", **_ZIP),
    HostileFile("passport: 2 MB", lambda: zipped(honest(passport=b" " * (2 << 20))), "passport", **_ZIP),
    HostileFile("passport: newer major format",
                lambda: zipped(honest(passport=json.dumps(PASSPORT | {"format": "rover-twin-passport/2"}).encode())),
                "passport", **_ZIP),
    HostileFile("passport: unknown column map",
                lambda: zipped(honest(passport=json.dumps(PASSPORT | {"column_map": "x"}).encode())),
                "passport", **_ZIP),
    HostileFile("runs.csv: no mass", lambda: zipped(honest(table="file,slope_deg\nrun.csv,20\n")), "run-table", **_ZIP),
    HostileFile("runs.csv: no text", lambda: zipped(honest(table=b"\xff\xfe\x00")), "not-text", **_ZIP),
    HostileFile("runs.csv: 10,001 runs",
                lambda: zipped(honest(table=f"{HEADER}\n" + "run.csv,a,20,430,60,10\n" * 10_001)), "run-table", **_ZIP),
    HostileFile("runs.csv: leads out",
                lambda: zipped(honest(table=f"{HEADER}\n../x.csv,a,20,430,60,10\n")), "unsafe-path", **_ZIP),
    HostileFile("runs.csv: file is not there",
                lambda: zipped(honest(table=f"{HEADER}\ngone.csv,a,20,430,60,10\n")), "missing-file", **_ZIP),
    HostileFile("runs.csv: mass in grams",
                lambda: zipped(honest(table=f"{HEADER}\nrun.csv,a,20,430000,60,10\n")), "units", **_ZIP),
    HostileFile("runs.csv: slope of 91 degrees",
                lambda: zipped(honest(table=f"{HEADER}\nrun.csv,a,91,430,60,10\n")), "scenario-range", **_ZIP),
    HostileFile("runs.csv: slopes in radians",
                lambda: zipped(honest({"b.csv": text(rear_x_m=0.5 * motion()["rear_x_m"])},
                                      table=f"{HEADER}\nrun.csv,a,0.349,430,60,10\nb.csv,a,0.367,430,60,10\n")),
                "units", **_ZIP),
    HostileFile("one trajectory under two scenarios",
                lambda: zipped(honest({"b.csv": text()},
                                      table=f"{HEADER}\nrun.csv,a,20,430,60,10\nb.csv,a,25,430,60,10\n")),
                "duplicate-content", **_ZIP),
    HostileFile("run stopped early",
                lambda: zipped(honest(table=f"{HEADER}\nrun.csv,a,20,430,60,30\n")), "horizon", **_ZIP),
]  # fmt: skip
TEXTS = [
    HostileFile("no bytes", lambda: b"", "empty-file", **_LONE),
    HostileFile("header only", lambda: b"time_s,rear_x_m,rear_y_m\n", "empty-file", **_LONE),
    HostileFile("UTF-16 without a mark", lambda: text().decode().encode("utf-16-le"), "not-text", **_LONE),
    HostileFile("UTF-16, cut", lambda: text().decode().encode("utf-16")[:-1], "not-text", **_LONE),
    HostileFile("UTF-32", lambda: text().decode().encode("utf-32"), "not-text", **_LONE),
    HostileFile("binary", lambda: text() + bytes(range(256)), "not-text", **_LONE),
    HostileFile("web page", lambda: b"<!DOCTYPE html>\n<html><body>404</body></html>\n", "missing-column", **_LONE),
    HostileFile("word among numbers", lambda: text().replace(b"0.05,", b"five,", 1), "not-a-number", **_LONE),
    HostileFile("commas and points", lambda: text().replace(b",", b";").replace(b".", b",", 5), "not-a-number",
                **_LONE),
    HostileFile("last row cut off", lambda: text()[:-40], "ragged-row", **_LONE),
    HostileFile("empty cell", lambda: text().replace(b"\n0.05,", b"\n,", 1), "empty-cell", **_LONE),
    HostileFile("header of other columns", lambda: b"a,b\n" + text().partition(b"\n")[2], "header-mismatch", **_LONE),
    HostileFile("300 columns", lambda: b"1," * 300 + b"\n", "too-large", **_LONE),
    HostileFile("no header, no map", lambda: text().partition(b"\n")[2], "missing-column", **_LONE),
    HostileFile("torques only", torques_only, "missing-column", **_LONE),
    HostileFile("torques only, taken for positions", torques_only, "out-of-range", filename="output.dat",
                form=SCENARIO | {"column_map": "vehicle-python"}),
    HostileFile("scenario not told", text, "scenario-missing", filename="run.csv"),
    HostileFile("nan", lambda: changed_at("rear_y_m", 7, np.nan), "non-finite", **_LONE),
    HostileFile("inf", lambda: changed_at("rear_x_m", 7, np.inf), "non-finite", **_LONE),
    HostileFile("three rows", lambda: b"\n".join(text().split(b"\n")[:5]), "too-few-rows", **_LONE),
    HostileFile("time in milliseconds", lambda: text(time_s=1000 * _T), "units", filename="run.csv",
                form=SCENARIO | {"horizon_s": 10.0}),
    HostileFile("heights in millimetres", lambda: text(rear_y_m=1000 * motion()["rear_y_m"]), "units", **_LONE),
    HostileFile("time goes back", lambda: text(time_s=np.where(_T == 5.0, 1.0, _T)), "time-backward", **_LONE),
    HostileFile("time stands still", lambda: text(time_s=np.minimum(_T, 9.0)), "time-duplicate", **_LONE),
    HostileFile("time starts late", lambda: text(time_s=_T + 5.0), "start-time", **_LONE),
    HostileFile("position starts at 3 m", lambda: text(rear_x_m=3.0 + motion()["rear_x_m"]), "start-position", **_LONE),
    HostileFile("hole of one second", lambda: text(time_s=np.where(_T > 5.0, _T + 1.0, _T)), "sampling-gap", **_LONE),
    HostileFile("jump of 50 m", lambda: text(rear_x_m=jumped()), "jump", **_LONE),
    HostileFile("speed is another column", lambda: text(speed_mps=3.0 * np.sin(_T)), "speed-mismatch", **_LONE),
    HostileFile("1e300", lambda: changed_at("rear_y_m", 7, 1e300), "out-of-range", **_LONE),
    HostileFile("passport of the form", text, "passport", filename="run.csv",
                form=SCENARIO | {"passport": {"format": 1}}),
]  # fmt: skip
TABLES = [
    HostileFile("long: mass changes within a run",
                lambda: long_csv(mass_kg=[430.0] * 20 + [431.0] * 21), "scenario-varies", **_LONG),
    HostileFile("long: slope changes to 80", lambda: long_csv(slope_deg=[20.0] * 20 + [80.0] * 21), "out-of-range",
                **_LONG),
    HostileFile("long: torque changes to -1", lambda: long_csv(torque_nm=[60.0] * 20 + [-1.0] * 21), "out-of-range",
                **_LONG),
    HostileFile("long: half a brake", lambda: long_csv(brake=[0.0] * 20 + [0.5] * 21), "out-of-range", **_LONG),
    HostileFile("long: word as mass", lambda: long_csv(mass_kg=["heavy"] * 41), "not-a-number", **_LONG),
    HostileFile("long: ragged", lambda: long_csv() + b"\none,20", "ragged-row", **_LONG),
    HostileFile("long: slope of 80", lambda: long_csv(slope_deg=[80.0] * 41), "scenario-range", **_LONG),
    HostileFile("long: nan as slope", lambda: long_csv(slope_deg=["nan"] * 41), "non-finite", **_LONG),
    HostileFile("long: no mass anywhere",
                lambda: long_csv().replace(b"mass_kg", b"weight"), "scenario-missing", **_LONG),
    HostileFile("long: no position", lambda: long_csv().replace(b"rear_x_m", b"depth"), "missing-column", **_LONG),
    HostileFile("long: a run per row", lambda: long_csv(run=[f"r{i}" for i in range(41)]), "too-few-rows", **_LONG),
    HostileFile("Parquet: cut off", lambda: ours()[:-500], "broken-parquet", **_PARQUET),
    HostileFile("Parquet: altered inside", lambda: ours()[:-9] + b"\xff" + ours()[-8:], "broken-parquet", **_PARQUET),
    HostileFile("Parquet: only marks", lambda: b"PAR1" + bytes(100) + b"PAR1", "broken-parquet", **_PARQUET),
    HostileFile("Parquet: footer of 18 MB", lambda: b"PAR1" + long_footer(), "too-large", **_PARQUET),
    HostileFile("Parquet: 11 million rows", rows_bomb, "too-large", **_PARQUET),
    HostileFile("Parquet: columns of something else",
                lambda: parquet({"a": [1, 2], "b": [3, 4]}), "missing-column", **_PARQUET),
    HostileFile("Parquet: texts as positions",
                lambda: parquet({"time_s": [0.0], "rear_x_m": ["x"], "rear_y_m": [0.2]}), "not-a-number", **_PARQUET),
    HostileFile("Parquet: lists as positions",
                lambda: parquet({"time_s": [0.0], "rear_x_m": [[1.0]], "rear_y_m": [0.2]}), "not-a-number", **_PARQUET),
    HostileFile("Parquet: empty cells",
                lambda: parquet({"time_s": [0.0, 1.0], "rear_x_m": [0.0, None], "rear_y_m": [0.2, 0.2]}),
                "empty-cell", **_PARQUET),
    HostileFile("Parquet: scenario not told", lambda: parquet(motion()), "scenario-missing", **_PARQUET),
    HostileFile("Parquet of ours: no rows", ours_without_rows, "broken-parquet", **_PARQUET),
    HostileFile("Parquet of ours: two runs in one group", ours_two_runs_in_a_group, "broken-parquet", **_PARQUET),
    HostileFile("Parquet of ours: jump of 50 m", lambda: ours(rear_x_m=jumped()), "jump", **_PARQUET),
]  # fmt: skip
HOSTILE_FILES = [*ARCHIVES, *FOLDERS, *TEXTS, *TABLES]
