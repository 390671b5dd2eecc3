"""A run of `rover-twin-usd` against a running service, and questions for it."""

from __future__ import annotations

from pathlib import Path

from pxr import Gf, Usd, UsdGeom

from rover_twin_usd.command import main
from tests.api.conftest import Running

TRACK = {"distance_m": [0, 3, 6], "slope_deg": [5, 15, 8]}
DRIVE = {"mass_kg": 430, "track": TRACK, "controls": 90, "horizon_s": 8, "dt_s": 0.1}
SCENARIO = ["--slope-deg", "20", "--mass-kg", "430", "--torque-nm", "80"]


def run(served: Running, site: Path, *arguments: object) -> int:
    return main([str(site), "--service", f"{served.url}/v1", *map(str, arguments)])


def at(stage: Usd.Stage, path: str, code: float) -> Gf.Matrix4d:
    return UsdGeom.XformCache(Usd.TimeCode(code)).GetLocalToWorldTransform(stage.GetPrimAtPath(path))
