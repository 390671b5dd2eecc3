"""Which drives to simulate next: how they are written, as JSON or as a `runs.csv`."""

from __future__ import annotations

import csv
import io
from typing import Any

import numpy as np

from model_store import Manifest
from service.learning.drive.inputs import Controls, Track
from service.learning.suggest_drives import DURATION_S, SuggestedDrive

COLUMNS = ("file", "set", "mass_kg", "horizon_s", "step_s", "slopes", "torques")
_SET = "suggested"
_STEP_S = 0.001  # of the shipped drives
_BRAKE = "-1"


def drives_as_json(manifest: Manifest, drives: tuple[SuggestedDrive, ...]) -> dict[str, Any]:
    """Each drive with its track over distance, its controls over time, and how it may end."""
    return {
        "model": {"name": manifest.name, "version": manifest.version},
        "drives": [_drive(number, drive) for number, drive in enumerate(drives)],
    }


def drives_as_csv(drives: tuple[SuggestedDrive, ...]) -> str:
    """A `runs.csv` as that of the shipped drives.

    `slopes` are knots distance:deg, linear between and constant beyond, `torques` are time:N m until the next; -1 is
    the brake.
    """
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(COLUMNS)
    for number, drive in enumerate(drives):
        rows.writerow([*_about(number, drive).values(), _slopes(drive.track()), _torques(drive.controls())])
    return text.getvalue()


def _about(number: int, drive: SuggestedDrive) -> dict[str, Any]:
    file = f"runs/viper_{drive.change}{number:02d}_m{drive.mass_kg}_h{DURATION_S:g}.csv.gz"
    return dict(zip(COLUMNS, (file, _SET, drive.mass_kg, DURATION_S, _STEP_S), strict=False))


def _drive(number: int, drive: SuggestedDrive) -> dict[str, Any]:
    track, controls = drive.track(), drive.controls()
    brake = np.asarray(controls.brake) > 0
    return _about(number, drive) | {
        "change": drive.change.value,
        "track": {"distance_m": track.distance_m.tolist(), "slope_deg": _degrees(track)},
        "controls": {
            "time_s": controls.time_s.tolist(),
            "torque_nm": controls.torque_nm.tolist(),
            "brake": brake.tolist(),
        },
        "probabilities": dict(zip(("passes", "sticks", "slides"), drive.chances, strict=True)),
    }


def _degrees(track: Track) -> list[float]:
    return [round(each, 6) for each in np.degrees(track.slope_rad).tolist()]  # what the detour over radians added goes


def _slopes(track: Track) -> str:
    return " ".join(f"{at:g}:{deg:g}" for at, deg in zip(track.distance_m.tolist(), _degrees(track), strict=True))


def _torques(controls: Controls) -> str:
    acts = zip(controls.time_s.tolist(), controls.torque_nm.tolist(), np.asarray(controls.brake).tolist(), strict=True)
    return " ".join(f"{at:g}:{_BRAKE if brake else format(torque, 'g')}" for at, torque, brake in acts)
