"""`python -m tests.cosimulation.figure`: an FMU in FMPy beside a drive of Chrono, drawn to docs/cosimulation.svg."""

from __future__ import annotations

import tempfile
from contextlib import ExitStack
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from service.fmu import Fmi, fmu_bytes
from service.local import load
from tests.cosimulation.chrono import chrono_drive
from tests.cosimulation.lockstep import FmuPeer, cells, ride

RUN = "viper_drive01_m690.3_h20"
TARGET = Path(__file__).parents[2] / "docs" / "cosimulation.svg"


def main() -> None:
    run, twin = chrono_drive(RUN), load()
    steps = list(cells(run.controls, run.until_s))
    times = np.cumsum([step.dt_s for step in steps])
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        file = folder / "viper.fmu"
        file.write_bytes(fmu_bytes(twin.twin, Fmi.THREE))
        x_m = ride(FmuPeer(file, run.mass_kg, folder / "unpacked", stack), run.terrain, steps)
    controls = {name: [getattr(told, name) for told in run.controls] for name in ("time_s", "torque_nm", "brake")}
    track = {"distance_m": run.terrain.distance_m, "slope_deg": run.terrain.slope_deg}
    drive = twin.drive(run.mass_kg, track, controls, times_s=times, include=["band"])
    apart, off = np.abs(drive.trajectory["x_m"] - x_m).max(), np.interp(times, run.time_s, run.x_m) - x_m
    print(f"FMU and drive: {apart:.1e} m apart; Chrono: {off[-1]:+.3f} m at the end, {np.abs(off).max():.3f} m at most")

    mpl.rcParams["svg.hashsalt"] = "rover-twin"
    figure = Figure(figsize=(8, 6), layout="constrained")
    above, middle, below = figure.subplots(3, 1, sharex=True, height_ratios=[3, 1, 1])
    assert drive.band is not None
    low, high = drive.band.x_lower_m, drive.band.x_upper_m
    above.fill_between(times, low, high, alpha=0.3, lw=0, label="90 % band of /v1/drives")
    above.plot(run.time_s, run.x_m, "k", lw=1.5, label="Chrono")
    above.plot(times, x_m, "C1--", lw=1.5, label="FMU, stepped by FMPy")
    above.set_ylabel("position x (m)")
    above.legend()
    middle.plot(times, drive.trajectory["slope_deg"])
    middle.set_ylabel("slope (deg)")
    below.step(times, drive.trajectory["torque_nm"], where="post")
    below.set_ylabel("torque (N m)")
    below.set_xlabel("time (s)")
    figure.savefig(TARGET, metadata={"Date": None})


if __name__ == "__main__":
    main()
