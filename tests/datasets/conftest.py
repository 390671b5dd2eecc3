"""A small dataset folder as Chrono programs write it, made by each test for itself."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

PASSPORT = {
    "format": "rover-twin-passport/1",
    "title": "synthetic",
    "gravity_m_s2": 1.62,
    "frame": "slope frame: x along the slope, y normal to it",
    "reference_body": "centre of the rear left wheel",
    "rover": {"wheel_radius_m": 0.25, "wheelbase_m": 1.2836, "mass_change": "kept though unknown"},
    "drive": {"law": "DC motor", "no_load_speed_rad_s": 3.14159},
    "soil": {"name": "regolith", "bekker_n": 1.0},
}


def motion(scale=1.0, rows=201, horizon_s=10.0):
    """A rover that settles and then climbs at about 0.1 m/s times `scale`."""
    time = np.linspace(0.0, horizon_s, rows)
    x = scale * (0.1 * time - 0.02 * (1.0 - np.exp(-time)))
    return {
        "time_s": time,
        "rear_x_m": x,
        "rear_y_m": 0.23 + 0.003 * np.sin(3.0 * time),
        "front_x_m": x + 1.2836,
        "front_y_m": 0.235 + 0.002 * np.sin(3.0 * time),
        "speed_mps": scale * (0.1 - 0.02 * np.exp(-time)),
    }


def chrono_text(columns, header=True, delimiter=","):
    """Text as ChWriterCSV writes it: delimiter after every value, header, blank line, nine digits."""
    lines = [delimiter.join([*columns, ""]), ""] if header else []
    lines += ["".join(f"{value:.9g}{delimiter}" for value in row) for row in zip(*columns.values(), strict=True)]
    return ("\n".join(lines) + "\n").encode()


@dataclass
class Folder:
    """Builds a dataset folder; `line` of a data row is its index + 3 (header, blank line, 1-based)."""

    path: Path
    passport: dict = field(default_factory=lambda: json.loads(json.dumps(PASSPORT)))
    table: list = field(default_factory=lambda: ["file,set,slope_deg,mass_kg,torque_nm,horizon_s,step_s"])

    def add(self, file, content=None, *, set_name="a", slope=20.0, mass=430.0, torque=60.0, horizon=10.0, step=""):
        if content is not None:
            target = self.path / file
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(content if isinstance(content, bytes) else chrono_text(content))
        self.table.append(f"{file},{set_name},{slope},{mass},{torque},{horizon},{step}")
        return self

    def write(self):
        (self.path / "passport.json").write_text(json.dumps(self.passport))
        (self.path / "runs.csv").write_text("\n".join(self.table) + "\n")
        return self.path


@pytest.fixture
def folder(tmp_path):
    path = tmp_path / "data"
    path.mkdir()
    return Folder(path)


@pytest.fixture
def make_motion():
    return motion


@pytest.fixture
def as_text():
    return chrono_text


@pytest.fixture
def passport_content():
    return json.loads(json.dumps(PASSPORT))
