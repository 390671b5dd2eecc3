"""Real runs as other people record them: each way is the inverse of what an option does."""

from __future__ import annotations

import io
import tarfile
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np

from service.datasets import read_parquet
from service.physics.frames import slope_to_world

STORE = Path(__file__).parents[2] / "model_store" / "datasets"
WHEELBASE_M = 1.2836
PLAIN = ("time_s", "rear_x_m", "rear_y_m")


@cache
def shipped():
    """All shipped runs, by name, with all of their columns."""
    return {
        run.name: run for path in sorted(STORE.glob("*/runs.parquet")) for run in read_parquet(path.read_bytes()).runs
    }


def run_columns(run, names=None, step=1):
    """Columns of a run, writable, every `step`-th row."""
    return {name: column[::step].copy() for name, column in run.columns.items() if names is None or name in names}


def later(columns, by_s):
    return columns | {"time_s": columns["time_s"] + by_s}


def settling(columns, for_s, drop_m=0.05):
    """Rows before the motors: the rover sinks in and stands, for so long."""
    time = columns["time_s"]
    step = float(np.median(np.diff(time)))
    before = np.arange(round(for_s / step)) * step
    rest = {name: np.full(len(before), float(column[0])) for name, column in columns.items()}
    rest["time_s"] = before
    for name in ("rear_y_m", "front_y_m"):
        if name in rest:
            rest[name] = rest[name] + drop_m * np.exp(-before / 0.1)
    for name in ("speed_mps", "rear_omega_radps", "front_omega_radps"):
        if name in rest:
            rest[name] = np.zeros(len(before))
    return {name: np.concatenate([rest[name], later(columns, for_s)[name]]) for name in columns}


def cut(columns, at_s):
    rows = columns["time_s"] >= at_s
    return {name: column[rows] for name, column in columns.items()}


def reversed_x(columns):
    """x grows downhill, and so do the speeds."""
    turned = {"rear_x_m", "front_x_m", "speed_mps", "rear_omega_radps", "front_omega_radps"}
    return {name: -column if name in turned else column for name, column in columns.items()}


def world(columns, slope_deg, origin=(0.0, 0.0)):
    """x horizontal, the other coordinate up; pitch from the horizontal; the speed's horizontal part."""
    slope = np.radians(slope_deg)
    turned = dict(columns)
    for x, y in (("rear_x_m", "rear_y_m"), ("front_x_m", "front_y_m")):
        if x in columns:
            turned[x], turned[y] = slope_to_world(columns[x], columns[y], slope)
            turned[x] = turned[x] + origin[0]
            turned[y] = turned[y] + origin[0] * np.tan(slope)
    if "pitch_rad" in columns:
        turned["pitch_rad"] = columns["pitch_rad"] + slope
    if "speed_mps" in columns:
        turned["speed_mps"] = columns["speed_mps"] * np.cos(slope)
    return turned


def elsewhere(columns, by_m):
    """Another origin along x."""
    return {name: column + by_m if name in ("rear_x_m", "front_x_m") else column for name, column in columns.items()}


def of_front(columns):
    """The front wheel's own positions under the rear wheel's names."""
    kept = {name: column for name, column in columns.items() if not name.startswith("front_")}
    return kept | {"rear_x_m": columns["front_x_m"], "rear_y_m": columns["front_y_m"]}


def of_chassis(columns):
    """The middle between the wheels."""
    kept = {name: column for name, column in columns.items() if not name.startswith("front_")}
    middle = {f"rear_{a}_m": (columns[f"rear_{a}_m"] + columns[f"front_{a}_m"]) / 2.0 for a in "xy"}
    return kept | middle


@dataclass(frozen=True)
class Sent:
    """A file with the fields that go with it."""

    data: bytes
    name: str
    form: dict = field(default_factory=dict)


def text(columns, digits=".10g"):
    rows = zip(*columns.values(), strict=True)
    return ("\n".join([",".join(columns), *(",".join(format(v, digits) for v in row) for row in rows)]) + "\n").encode()


def scenario(run):
    """What its rows do not say."""
    told = {"slope_deg": run.slope_deg, "mass_kg": run.mass_kg, "torque_nm": run.torque_nm}
    return {name: value for name, value in told.items() if name not in run.varies}


def plain_file(run, columns):
    return Sent(text(columns), "run.csv", scenario(run))


def long_table(run, columns):
    rows = len(columns["time_s"])
    return Sent(text(columns | {name: np.full(rows, value) for name, value in scenario(run).items()}), "long.csv")


def archive(run, columns):
    listed = f"file,slope_deg,mass_kg,torque_nm\nrun.csv,{run.slope_deg!r},{run.mass_kg!r},{run.torque_nm!r}\n"
    sink = io.BytesIO()
    with tarfile.open(fileobj=sink, mode="w") as tar:
        for name, data in (("runs.csv", listed.encode()), ("run.csv", text(columns))):
            member = tarfile.TarInfo(name)
            member.size = len(data)
            tar.addfile(member, io.BytesIO(data))
    return Sent(sink.getvalue(), "runs.tar")


CARRIERS = {"plain": plain_file, "long": long_table, "archive": archive}
