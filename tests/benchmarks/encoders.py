"""What writing an answer takes: `python -m tests.benchmarks.encoders [OTHER_CHECKOUT]` prints Markdown.

Each form of 201 and 20,001 points and of a batch; with another checkout beside the same there, in turn. Then numbers
alone, beside libraries that write them. Processor time of the thread, the least of many: a machine that does other
things too makes it longer, never shorter.
"""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from tests.benchmarks.client import scenarios
from tests.benchmarks.machine import SERVER_CPU, running_on
from tests.benchmarks.report import table

ROUNDS = 3
STEPS_S = {201: 0.05, 20_001: 0.0005}
BATCH = 1000
_HERE = Path(__file__).parents[2]


def main() -> None:
    """Measure and print."""
    if sys.argv[1:] == ["--one"]:
        print(json.dumps({name: least_ms(call, calls) for name, (call, calls) in encoders().items()}))
        return
    other = Path(sys.argv[1]).resolve() if sys.argv[1:] else None
    trees = {"ms": _HERE} | ({"ms there": other} if other else {})
    found: dict[str, dict[str, float]] = {}
    for _ in range(ROUNDS):
        for title, tree in trees.items():
            for name, taken in _in_tree(tree).items():
                row = found.setdefault(name, {})
                row[title] = min(taken, row.get(title, taken))
    rows = [[name, *row.values(), *_times(row)] for name, row in found.items()]
    print(table(["form", *trees, *(["times faster"] if other else [])], rows))
    print()
    print(table(["20,001 numbers", "ms"], [[name, least_ms(call, 50)] for name, call in alone().items()]))


def _in_tree(tree: Path) -> dict[str, float]:
    """What the encoders of a checkout take, by this program."""
    paths = [str(tree), str(tree / "clients/python/src"), str(_HERE)]
    with running_on(SERVER_CPU):
        done = subprocess.run(
            [sys.executable, str(Path(__file__)), "--one"],
            env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
            cwd=tree,
            check=True,
            capture_output=True,
            text=True,
        )
    return dict(json.loads(done.stdout))


def _times(row: dict[str, float]) -> list[float]:
    new, *old = row.values()
    return [each / new for each in old]


def least_ms(call: Callable[[], object], calls: int) -> float:
    """The least processor time of some calls."""
    least = float("inf")
    for _ in range(calls):
        began = time.thread_time()
        call()
        least = min(least, time.thread_time() - began)
    return least * 1e3


def encoders() -> dict[str, tuple[Callable[[], object], int]]:
    """Every form that holds numbers, and how often to try it."""
    import numpy as np

    from model_store import ModelStore
    from service.settings import load_settings
    from service.twin import Frame, Loaded, Scenario, sample_times
    from service.twin.load import load_twin
    from service.wire.batch_forms import BATCH_ENCODERS, BatchFormat, BatchSubject
    from service.wire.forms import ENCODERS, Format, Subject

    store = ModelStore.open(load_settings().store_url)
    resolved = store.resolve("viper-lunar")
    loaded = Loaded(load_twin(store, resolved.name, resolved.version), resolved.alias)
    asked = [Scenario(**each, horizon_s=10.0) for each in scenarios(BATCH)]
    found: dict[str, tuple[Callable[[], object], int]] = {}
    for points, dt_s in STEPS_S.items():
        subject = Subject(loaded, loaded.twin.predict(asked[0], sample_times(10.0, dt_s)))
        for form in (Format.JSON, Format.CSV, Format.USDA, Format.NPZ, Format.ARROW):
            encode = ENCODERS[form].encode
            found[f"{points:,} {form}"] = (lambda e=encode, s=subject: e(s)), 20_000_000 // (points * 100 + 50_000)
    batch = loaded.twin.predict_many(asked, sample_times(10.0, STEPS_S[201]))
    many = BatchSubject(loaded, Frame.SLOPE, batch, np.arange(BATCH), (), with_prior=False, with_band=False)
    for form in (BatchFormat.JSON, BatchFormat.NDJSON, BatchFormat.NPZ, BatchFormat.ARROW):
        chosen = BATCH_ENCODERS[form]
        write = chosen.encode or (lambda s, c=chosen: b"".join(c.stream(s)))
        found[f"{BATCH:,} x 201 {form}"] = (lambda w=write: w(many)), 10
    return found


def alone() -> dict[str, Callable[[], object]]:
    """One column of numbers as text, by ours and by what others have."""
    import numpy as np
    import orjson
    import polars as pl
    import pyarrow as pa
    from pyarrow import csv

    from service.wire.digits import list_text

    x = np.cumsum(np.random.default_rng(1).random(20_001)) * 1e-3
    numbers, frame, arrow = x.tolist(), pl.DataFrame({"x": x}), pa.table({"x": x})
    with_numpy = orjson.OPT_SERIALIZE_NUMPY
    return {
        "ours, to 1e-7": lambda: list_text(x, 7),
        "ours, to 1e-12": lambda: list_text(x, 12),
        "orjson, all digits": lambda: orjson.dumps(x, option=with_numpy),
        "orjson, of rounded numbers": lambda: orjson.dumps(np.round(x, 7), option=with_numpy),
        "polars, CSV with float_precision=7": lambda: frame.write_csv(float_precision=7),
        "pyarrow, CSV with all digits": lambda: csv.write_csv(arrow, io.BytesIO()),
        "Python, f-strings": lambda: ",".join([f"{each:.7f}" for each in numbers]),
    }


if __name__ == "__main__":
    main()
