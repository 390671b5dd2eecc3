"""All files: every value alone, every pair of values, and a seeded choice of three and more; each one only once."""

from __future__ import annotations

import hashlib
import itertools
import json
import random
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property

from tests.datasets.messy.axes import ARCHIVES, AXES, CLEAN, is_possible
from tests.datasets.messy.clean import MASS_KG, TORQUE_NM, clean_runs
from tests.datasets.messy.packing import packed_file, packed_files
from tests.datasets.messy.sheet import as_run_table, of_file, of_run_table
from tests.datasets.messy.writing import written

SEED = 13
FURTHER = 1000
"""How many files differ from the clean one in three to six ways."""


@dataclass(frozen=True)
class MessyFile:
    """One file: `ways` are all axes, `chosen` those in which it is not clean."""

    ways: dict[str, str] = field(hash=False)

    @property
    def chosen(self) -> dict[str, str]:
        """What is not clean."""
        return {axis: value for axis, value in self.ways.items() if value != CLEAN[axis]}

    @cached_property
    def _made(self):
        return _made(self.ways)

    @property
    def data(self) -> bytes:
        """Its bytes."""
        return self._made[0]

    @property
    def form(self) -> dict:
        """The fields that are sent with it, but for the passport."""
        return self._made[1]

    @property
    def digest(self) -> str:
        """Tells files apart."""
        return hashlib.sha256(self.data + json.dumps(self.form, sort_keys=True).encode()).hexdigest()


def every_way() -> list[dict[str, str]]:
    """The ways of all files that can be written, in a fixed order. Some of them may still be equal, byte for byte."""
    values = {axis: [value.name for value in each[1:]] for axis, each in AXES.items()}
    chosen: list[dict[str, str]] = [{}]
    chosen += [{axis: value} for axis, each in values.items() for value in each]
    for one, other in itertools.combinations(values, 2):
        chosen += [{one: a, other: b} for a in values[one] for b in values[other]]
    chosen += _traps()
    drawn = random.Random(SEED)
    for _ in range(FURTHER):
        axes = drawn.sample(list(values), drawn.randint(3, 6))
        chosen.append({axis: drawn.choice(values[axis]) for axis in axes})
    ways = map(_whole, chosen)
    return [json.loads(each) for each in dict.fromkeys(json.dumps(each) for each in ways if is_possible(each))]


def _traps() -> Iterator[dict[str, str]]:
    """Ways that hide each other: a name or a cell that is not there, beside delimiters that leave no trace of it."""
    for delimiter, index, extra, place, trailing in itertools.product(
        ("comma", "tab", "space", "aligned"),
        ("none", "no name above", "empty name"),
        ("empty", "half empty", "counts"),
        ("last", "first", "middle"),
        ("none", "one"),
    ):
        yield {"delimiter": delimiter, "index": index, "extra": extra, "place": place, "trailing": trailing}
    for carrier, number, mark, trailing in itertools.product(
        ("long", "archive, runs.csv alike"), ("1,0", "1,0 and 1.430", "1.0 and 1,430"), ("comma", "semicolon", "tab"),
        ("none", "one", "two"),
    ):  # fmt: skip
        for extra in ("none", "empty", "text"):
            yield {"carrier": carrier, "number": number, "delimiter": mark, "trailing": trailing, "extra": extra}


def files(shard: int = 0, shards: int = 1) -> Iterator[MessyFile]:
    """The files of one of `shards` parts."""
    for ways in every_way()[shard::shards]:
        yield MessyFile(ways)


def _whole(chosen):
    """All axes; a carrier and a wrap that need each other come together, an extra column where it has a place."""
    ways = {**CLEAN, **chosen}
    if ways["carrier"] in ARCHIVES and "wrap" not in chosen:
        ways["wrap"] = "zip"
    elif ways["wrap"].startswith(("zip", "tar")) and "carrier" not in chosen:
        ways["carrier"] = "archive"
    if "place" in chosen and "extra" not in chosen:
        ways["extra"] = "text"
    if ways["number"] in ("1,0 and 1.430", "1.0 and 1,430") and "carrier" not in chosen and "wrap" not in chosen:
        ways["carrier"] = "long"
    return ways


def _made(ways):
    sheet = of_file(ways)
    data = written(sheet, ways)
    form = {"column_map": sheet.mapping} if sheet.mapping else {}
    carrier, wrap = ways["carrier"], ways["wrap"]
    if carrier == "alone":
        form |= {"slope_deg": clean_runs()[0].slope_deg, "mass_kg": MASS_KG, "torque_nm": TORQUE_NM}
    if carrier not in ARCHIVES:
        return packed_file(data, wrap), form
    ending = ".csv.gz" if wrap == "zip, members gz" else ".csv"
    if carrier == "table in archive":
        return packed_files({f"table{ending}": data}, wrap), form
    other = {**ways, "hole": "none", "order": "usual"}
    beside = written(of_file(other, clean_runs()[1:]), other)
    alike = as_run_table(ways) if carrier == "archive, runs.csv alike" else CLEAN
    runs = written(of_run_table([f"a{ending}", f"b{ending}"], alike), alike)
    return packed_files({"runs.csv": runs, f"a{ending}": data, f"b{ending}": beside}, wrap), form
