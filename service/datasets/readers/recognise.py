"""Which program of Chrono wrote a file, as far as its header or the number of its columns tells."""

from __future__ import annotations

import json
from collections.abc import Sequence

from service.datasets.columns import unquoted
from service.datasets.readers.presets import DEMOS, SILENT, Demo, Silent

_UNITS = {
    *("", "-", "1", "s", "sec", "second", "seconds", "m", "m/s", "m s-1", "m/s2", "m/s^2", "m/s\u00b2", "rad", "rad/s"),
    *("n", "nm", "n m", "n*m", "n.m", "n\u00b7m"),
}
_SUFFIXES = ("_radps", "_rad_s", "_mps2", "_m_s2", "_mps", "_m_s", "_nm", "_n", "_s", "_m")
_FEW = 3


def plain(header: str) -> str:
    """A header cell in lower case, without quotes and without an SI unit; another unit stays, so that nothing fits."""
    text = unquoted(header).lower()
    at = max(text.rfind("["), text.rfind("("))
    if at > 0 and text.endswith(("]", ")")):
        return text[:at].strip() if text[at + 1 : -1].strip() in _UNITS else text
    suffix = next((each for each in _SUFFIXES if text.endswith(each) and text != each), "")
    return text.removesuffix(suffix)


def preset_of(names: Sequence[str]) -> str | None:
    """The preset whose columns are all among `names`, each of them once: of several the one with the most columns."""
    there = [plain(name) for name in names]
    fitting = [key for key, demo in DEMOS.items() if demo.header and all(there.count(n) == 1 for n in demo.header)]
    silent = silent_of(names)
    return None if silent else max(fitting, key=lambda key: DEMOS[key].width, default=None)


def silent_of(names: Sequence[str]) -> Silent | None:
    """The kind of file without position that has exactly this header."""
    there = sorted(plain(name) for name in names if name)
    return next((each for each in SILENT if each.header and sorted(each.header) == there), None)


def places(demo: Demo, names: Sequence[str] | None, width: int) -> dict[str | int, int]:
    """Where the columns of a demo are: its own name or index of each one that is there -> index in the file.

    A file whose header was removed has them in the demo's order, where there are as many.
    """
    if not demo.header:
        return {index: index for index in range(min(width, demo.width))}
    if names is None:
        return {name: index for index, name in enumerate(demo.header)} if width == demo.width else {}
    there = [plain(name) for name in names]
    return {name: there.index(name) for name in demo.header if there.count(name) == 1}


def told_by_header(names: Sequence[str]) -> str | None:
    """What to do about a header that leaves out a column that runs must have, or None."""
    silent = silent_of(names)
    if silent is not None:
        return nothing_to_learn(silent)
    there = [plain(name) for name in names]
    lacking = {
        key: [name for name in demo.header if there.count(name) != 1] for key, demo in DEMOS.items() if demo.header
    }
    key = min(lacking, key=lambda each: (len(lacking[each]), -DEMOS[each].width))
    demo, missing = DEMOS[key], lacking[key]
    if len(missing) > min(_FEW, len(demo.header) // 3):
        return None
    listed = " and ".join(repr(name) for name in missing)
    known = {name: source for name, source in demo.sources.items() if source not in missing}
    remedy = f"column_map={key}" if len(known) == len(demo.sources) else f"the right name in {json.dumps(known)}"
    return (
        f"it is close to that of the preset {key}, {demo.program}, but has not exactly one column {listed}; "
        f"write it as the demo does, or pass {remedy}"
    )


def nothing_to_learn(silent: Silent) -> str:
    """Why nothing can be learned from such a file, and what to write as well."""
    why = "nothing can be learned from them, for they have no position of the rover"
    return f"{silent.what}, as {silent.program} writes: {why}; {silent.add}"


def candidates(width: int) -> tuple[list[str], list[Silent]]:
    """The presets and the kinds without position that have so many columns."""
    return [key for key, demo in DEMOS.items() if demo.width == width], [
        each for each in SILENT if each.width == width and not each.header
    ]
