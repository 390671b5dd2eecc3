"""Scenarios a second of the engine: one after the other and side by side, on one core, in one run.

`python -m tests.benchmarks.side_by_side [ENGINE]`: the file of an engine of another day, to be measured beside.
"""

from __future__ import annotations

import ctypes
import sys
import time
from collections.abc import Callable

import numpy as np

from model_store import ModelStore
from service.learning.drive.library import address, library, vector_bits
from service.learning.drive.model import DriveModel
from service.settings import load_settings
from service.twin.load import load_twin
from tests.benchmarks.client import scenarios

COUNT, TIMES, ROUNDS, AT_ONCE = 1000, np.linspace(0.0, 10.0, 201), 40, 40


def main() -> None:
    """Measure and print: the shortest of many rounds that take turns, since others use the machine too."""
    store = ModelStore.open(load_settings().store_url)
    resolved = store.resolve("viper-lunar")
    model = load_twin(store, resolved.name, resolved.version).model
    if not isinstance(model, DriveModel):
        raise SystemExit("the shipped model is not a drive model")
    calls = _calls(model)
    best = dict.fromkeys(calls, np.inf)
    for _ in range(ROUNDS):
        for name, call in calls.items():
            best[name] = min(best[name], call())
    first = next(iter(best.values()))
    print("| what | us a scenario | scenarios a second | times the first |\n| --- | ---: | ---: | ---: |")
    for name, seconds in best.items():
        print(f"| {name} | {seconds * 1e6:.1f} | {1 / seconds:,.0f} | {first / seconds:.2f} |")


def _calls(model: DriveModel) -> dict[str, Callable[[], float]]:
    """Of each way, a call that measures it: seconds a scenario."""
    asked = scenarios(COUNT)
    slope = np.radians([each["slope_deg"] for each in asked])
    mass, torque = (np.array([each[name] for each in asked]) for name in ("mass_kg", "torque_nm"))
    rows = np.stack([slope, mass, torque, model.starts.at(slope, mass), np.zeros(COUNT)])
    outputs, order = np.empty((5, COUNT, len(TIMES))), np.argsort(slope).astype(np.int64)
    engine, times = model.engine, (len(TIMES), address(TIMES), 0)

    def one_by_one(loaded: ctypes.CDLL) -> Callable[[], float]:
        return _shortest(
            lambda _: loaded.rover_constant(engine._address, AT_ONCE, address(some), *times, address(outputs))
        )

    some = np.ascontiguousarray(rows[:, order[:: COUNT // AT_ONCE]])
    calls = {}
    if len(sys.argv) > 1:
        other = ctypes.CDLL(sys.argv[1])
        other.rover_constant.argtypes = library().rover_constant.argtypes
        calls["one by one, the other engine"] = one_by_one(other)
    calls["one by one"] = one_by_one(library())
    for bits in (each for each in (128, 256, 512) if each <= vector_bits()):
        calls[f"side by side, {bits} bits"] = _side_by_side(model, bits, order, rows, outputs)
    whole = (slope, mass, torque, rows[3], TIMES)
    calls["Engine.constant"] = lambda: _seconds(lambda: engine.constant(*whole)) / COUNT
    calls["Engine.ways"] = lambda: _seconds(lambda: engine.ways(*whole)) / COUNT
    return calls


def _side_by_side(
    model: DriveModel, bits: int, order: np.ndarray, rows: np.ndarray, outputs: np.ndarray
) -> Callable[[], float]:
    struct = type(model.engine._laid_out.struct).from_buffer_copy(model.engine._laid_out.struct)
    struct.vector_bits = bits

    def call(first: int) -> None:
        library().rover_side_by_side(
            ctypes.addressof(struct), AT_ONCE, address(order[first:]), COUNT, address(rows), len(TIMES), address(TIMES),
            0, 5, address(outputs), None,
        )  # fmt: skip

    return _shortest(call)


def _shortest(call: Callable[[int], object]) -> Callable[[], float]:
    """Seconds a scenario, of calls that are short enough to be disturbed by nobody: the sum of the shortest of each."""
    firsts = range(0, COUNT, AT_ONCE)
    best = dict.fromkeys(firsts, np.inf)

    def measured() -> float:
        for first in firsts:
            best[first] = min(best[first], _seconds(lambda at=first: call(at)))
        return sum(best.values()) / COUNT

    return measured


def _seconds(call: Callable[[], object]) -> float:
    began = time.perf_counter()
    call()
    return time.perf_counter() - began


if __name__ == "__main__":
    main()
