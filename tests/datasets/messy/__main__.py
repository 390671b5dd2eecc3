"""`python -m tests.datasets.messy`: reads every file, prints how many came out how, and by value of each axis."""

from __future__ import annotations

import collections
import sys
import tempfile
import time
from pathlib import Path

from tests.datasets.messy.axes import AXES
from tests.datasets.messy.files import files
from tests.datasets.messy.oracle import judged, read


def main(shown=20):
    """Exit code 1 when anything is wrong."""
    outcomes, seen, by_value = collections.Counter(), set(), collections.defaultdict(collections.Counter)
    complaints, began = [], time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        for file in files():
            if file.digest in seen:
                continue
            seen.add(file.digest)
            try:
                verdict = judged(file, read(file, Path(folder)))
            except Exception:
                print(file.chosen)
                raise
            outcome = "WRONG" if verdict.complaint else verdict.outcome
            outcomes[outcome] += 1
            for each in file.ways.items():
                by_value[each][outcome] += 1
            if verdict.complaint:
                complaints.append((verdict, file))
    took = time.perf_counter() - began
    kinds = ("alike", "alike, with a word", "refused", "WRONG")
    print(f"| {'axis: value':<36} | {' | '.join(f'{kind:>18}' for kind in kinds)} |")
    for axis, values in AXES.items():
        for value in values:
            row = by_value[axis, value.name]
            print(f"| {f'{axis}: {value.name}':<36} | {' | '.join(f'{row[kind]:>18}' for kind in kinds)} |")
    print(f"| {'all files':<36} | {' | '.join(f'{outcomes[kind]:>18}' for kind in kinds)} |")
    print(f"{len(seen)} distinct files in {took:.1f} s, {took / len(seen) * 1000:.2f} ms each")
    for verdict, file in complaints[:shown]:
        print(f"{file.chosen}: {verdict.outcome}: {verdict.complaint}")
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 20))
