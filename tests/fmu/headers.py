"""What a shared library says of itself, for the three kinds there are: enough to see whether a system would load it."""

from __future__ import annotations

import struct
from dataclasses import dataclass


@dataclass(frozen=True)
class Library:
    """`needed`: names of other libraries. `oldest`: the system that it is made for, where it says so."""

    kind: str
    processor: str
    exports: frozenset[str]
    needed: frozenset[str]
    oldest: str = ""
    signed: bool = False
    executable_stack: bool = False


def inspect(data: bytes) -> Library:
    """Of one library. Raises ValueError for anything else."""
    if data[:4] == b"\x7fELF":
        return _elf(data)
    if data[:2] == b"MZ":
        return _pe(data)
    if data[:4] == b"\xcf\xfa\xed\xfe":
        return _macho(data)
    raise ValueError("no shared library")


def parts(data: bytes) -> list[bytes]:
    """The libraries within one for several processors of Apple's."""
    magic, count = struct.unpack_from(">II", data)
    assert magic == 0xCAFEBABE
    found = []
    for number in range(count):
        _, _, offset, size, align = struct.unpack_from(">IIIII", data, 8 + 20 * number)
        assert offset % (1 << align) == 0
        found.append(data[offset : offset + size])
    return found


def _text(data: bytes, at: int) -> str:
    return data[at : data.index(b"\0", at)].decode()


def _elf(data: bytes) -> Library:
    bits, order, machine = data[4], data[5], struct.unpack_from("<H", data, 18)[0]
    assert (bits, order) == (2, 1)
    sections = struct.unpack_from("<Q", data, 40)[0]
    size, count = struct.unpack_from("<HH", data, 58)
    rows = [struct.unpack_from("<IIQQQQIIQQ", data, sections + size * number) for number in range(count)]
    exports, needed, versions = set(), set(), set()
    for _, kind, _, _, offset, length, link, info, _, _ in rows:
        names = rows[link][4] if link < count else 0
        if kind == 11:  # dynamic symbols
            for at in range(offset, offset + length, 24):
                name, symbol, other, section, _, _ = struct.unpack_from("<IBBHQQ", data, at)
                if section and symbol >> 4 == 1 and other & 3 == 0:
                    exports.add(_text(data, names + name))
        elif kind == 6:  # dynamic
            for at in range(offset, offset + length, 16):
                tag, value = struct.unpack_from("<QQ", data, at)
                if tag == 1:
                    needed.add(_text(data, names + value))
        elif kind == 0x6FFFFFFE:  # versions of symbols that are needed
            at = offset
            for _ in range(info):
                _, many, _, first, after = struct.unpack_from("<HHIII", data, at)
                place = at + first
                for _ in range(many):
                    _, _, _, name, following = struct.unpack_from("<IHHII", data, place)
                    versions.add(_text(data, names + name))
                    place += following
                at += after
    oldest = max(versions, key=lambda each: tuple(map(int, each.removeprefix("GLIBC_").split("."))))
    segments = struct.unpack_from("<Q", data, 32)[0]
    width, many = struct.unpack_from("<HH", data, 54)
    heads = [struct.unpack_from("<II", data, segments + width * number) for number in range(many)]
    stack = any(kind == 0x6474E551 and flags & 1 for kind, flags in heads)
    processor = {62: "x86_64", 183: "aarch64"}[machine]
    return Library("ELF", processor, frozenset(exports), frozenset(needed), oldest, executable_stack=stack)


def _pe(data: bytes) -> Library:
    head = struct.unpack_from("<I", data, 60)[0]
    assert data[head : head + 4] == b"PE\0\0"
    machine, count = struct.unpack_from("<HH", data, head + 4)
    optional, flags = struct.unpack_from("<HH", data, head + 20)
    assert flags & 0x2000  # a DLL
    at = head + 24
    assert struct.unpack_from("<H", data, at)[0] == 0x20B  # 64 bits
    directories = [struct.unpack_from("<II", data, at + 112 + 8 * number) for number in range(2)]
    rows = [struct.unpack_from("<8sIIII", data, at + optional + 40 * number) for number in range(count)]

    def place(address: int) -> int:
        for _, size, start, length, offset in rows:
            if start <= address < start + max(size, length):
                return address - start + offset
        raise ValueError(f"nowhere: {address}")

    exports, needed = set(), set()
    table = place(directories[0][0])
    many, names = struct.unpack_from("<I", data, table + 24)[0], struct.unpack_from("<I", data, table + 32)[0]
    for number in range(many):
        exports.add(_text(data, place(struct.unpack_from("<I", data, place(names) + 4 * number)[0])))
    row = place(directories[1][0])
    while name := struct.unpack_from("<I", data, row + 12)[0]:
        needed.add(_text(data, place(name)).lower())
        row += 20
    return Library("PE", {0x8664: "x86_64"}[machine], frozenset(exports), frozenset(needed))


def _macho(data: bytes) -> Library:
    _, processor, _, kind, count, _, _, _ = struct.unpack_from("<8I", data)
    assert kind == 6  # a dynamic library
    exports, needed, oldest, signed, at = set(), set(), "", False, 32
    for _ in range(count):
        command, size = struct.unpack_from("<II", data, at)
        if command == 0xC:
            needed.add(_text(data, at + struct.unpack_from("<I", data, at + 8)[0]))
        elif command == 2:
            symbols, many, names, _ = struct.unpack_from("<4I", data, at + 8)
            for place in range(symbols, symbols + 16 * many, 16):
                name, what, _, _, _ = struct.unpack_from("<IBBHQ", data, place)
                if what & 1 and not what & 0x10 and what & 0xE == 0xE:
                    exports.add(_text(data, names + name).removeprefix("_"))
        elif command == 0x1D:
            signed = True
        elif command == 0x32:
            packed = struct.unpack_from("<I", data, at + 12)[0]
            oldest = f"{packed >> 16}.{packed >> 8 & 255}"
        at += size
    exports -= {"__dso_handle", "_mh_dylib_header"}  # every linker's own
    name = {0x01000007: "x86_64", 0x0100000C: "aarch64"}[processor]
    return Library("Mach-O", name, frozenset(exports), frozenset(needed), oldest, signed)
