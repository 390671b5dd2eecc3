"""Uploads as operators make them: small, quick to read, different where a test wants them to be."""

from __future__ import annotations

import io
import json
import zipfile

import numpy as np

PASSPORT = {
    "format": "rover-twin-passport/1",
    "title": "synthetic",
    "gravity_m_s2": 1.62,
    "frame": "slope frame: x along the slope, y normal to it",
    "reference_body": "centre of the rear left wheel",
    "rover": {"wheel_radius_m": 0.25, "wheelbase_m": 1.2836},
    "drive": {"law": "DC motor", "no_load_speed_rad_s": 3.14159},
    "soil": {"name": "regolith", "bekker_n": 1.0},
}


def run_text(scale=1.0, rows=101, horizon_s=10.0):
    """One run as ChWriterCSV writes it: a rover that settles and then climbs at about 0.1 m/s times `scale`."""
    time = np.linspace(0.0, horizon_s, rows)
    x = scale * (0.1 * time - 0.02 * (1.0 - np.exp(-time)))
    y = 0.23 + 0.003 * np.sin(3.0 * time)
    lines = ["time_s,rear_x_m,rear_y_m,"]
    lines += [f"{t:.9g},{along:.9g},{normal:.9g}," for t, along, normal in zip(time, x, y, strict=True)]
    return ("\n".join(lines) + "\n").encode()


def archive(runs=3, *, seed=0.0, broken=(), passport=PASSPORT):
    """A zip with runs.csv and passport.json; runs of the numbers in `broken` have a text where a number belongs."""
    table = ["file,set,slope_deg,mass_kg,torque_nm,horizon_s"]
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as out:
        for number in range(runs):
            text = run_text(1.0 - 0.1 * number + seed)
            if number in broken:
                text = text.replace(b"\n0.5,", b"\nhalf,")
            out.writestr(f"runs/run{number}.csv", text)
            table.append(f"runs/run{number}.csv,a,{20 + number},430,60,10")
        out.writestr("runs.csv", "\n".join(table) + "\n")
        out.writestr("passport.json", json.dumps(passport))
    return packed.getvalue()
