"""Whole answers as the service writes them, in the words of its contract, for made-up rovers."""

from __future__ import annotations

from typing import Any

import numpy as np

NEAREST_RUN = {
    "run": "s28_m430_t60",
    "slope_deg": 28,
    "mass_kg": 430,
    "torque_nm": 60,
    "left_out_final_error_m": 0.0074,
    "distance": 0.41,
}


def prediction_document(query: dict[str, str]) -> dict[str, Any]:
    """What the service answers (contract of /v1/predictions), for a rover that moves 0.1 m/s uphill."""
    across = "z_m" if query.get("frame") == "world" else "y_m"
    query = {"horizon_s": "10"} | query
    time_s = [0.0, 5.0, float(query["horizon_s"])]
    trajectory = {"time_s": time_s, "x_m": [0.1 * t for t in time_s], across: [0.0, 0.01, 0.02]}
    answer = {
        "model": {"name": "viper-lunar", "version": 3, "alias": "champion"},
        "scenario": {k: float(query[k]) for k in ("slope_deg", "mass_kg", "torque_nm", "horizon_s")},
        "frame": query.get("frame", "slope"),
        "trajectory": trajectory,
        "domain": {"inside": True, "reasons": [], "distance": 0.41, "nearest_runs": [dict(NEAREST_RUN)]},
        "summary": {
            "outcome": "climbs",
            "final_x_m": 0.1 * time_s[-1],
            "final_y_m": 0.02,
            "distance_m": 1.0,
            "mean_speed_m_s": 0.1,
            "slip_ratio": 0.55,
        },
    }
    if "prior" in query.get("include", ""):
        answer["prior"] = {"name": "motor_slope", "x_m": [0.0, 0.4, 0.9], across: [0.0, 0.0, 0.0]}
    if "band" in query.get("include", ""):
        bounds = ("x_lower_m", "x_upper_m", "y_lower_m", "y_upper_m")
        level = float(query.get("band_level", "0.9"))
        answer["band"] = {"level": level} | {name: [0.0, 0.5, 1.0 + at] for at, name in enumerate(bounds)}
    return answer


def mobility_document(query: dict[str, str]) -> dict[str, Any]:
    """What the service answers (contract of /v1/mobility), for a rover that climbs a degree per 2 N m."""
    lowest_nm = float(query["torque_min_nm"])
    torques = _axis(lowest_nm, float(query.get("torque_max_nm", lowest_nm)), int(query.get("torque_steps", "10")))
    ends = float(query.get("slope_min_deg", "0")), float(query.get("slope_max_deg", "35"))
    slopes = _axis(*ends, int(query.get("slope_steps", "36")))
    climbed = [[slope for slope in slopes if slope <= torque / 2] for torque in torques]
    return {
        "model": {"name": "viper-lunar", "version": 3, "alias": "champion"},
        "mass_kg": float(query["mass_kg"]),
        "horizon_s": float(query.get("horizon_s", "10")),
        "confidence": float(query.get("confidence", "0.9")),
        "steepest_by": "band",
        "slope_deg": slopes,
        "torque_nm": torques,
        "outcome": [["climbs" if slope in row else "stalls" for slope in slopes] for row in climbed],
        "mean_speed_m_s": [[0.1 if slope in row else 0.0 for slope in slopes] for row in climbed],
        "slip_ratio": [[0.5 if slope in row else None for slope in slopes] for row in climbed],
        "inside_domain": [[slope >= 5 for slope in slopes] for _ in torques],
        "steepest_climb_slope_deg": [row[-1] if row else None for row in climbed],
        "steepest_inside_domain": [row[-1] >= 5 if row else None for row in climbed],
    }


def _axis(lowest: float, highest: float, steps: int) -> list[float]:
    return np.linspace(lowest, highest, steps if highest > lowest else 1).tolist()


def suggested_runs_document(name: str, version: int, count: int) -> dict[str, Any]:
    """What the service answers (contract of .../suggested-runs); the second run has no error to expect."""
    runs = [
        {
            "file": f"runs/viper_s{slope}_m430_t60_h10.csv.gz",
            "set": "suggested",
            "slope_deg": slope,
            "mass_kg": 430,
            "torque_nm": 60.5,
            "horizon_s": 10,
            "step_s": 0.001,
            "reason": {
                "expected_error_m": None if slope == 11 else 0.36,
                "distance": 0.92,
                "nearest_run": NEAREST_RUN["run"],
            },
        }
        for slope in range(10, 10 + count)
    ]
    return {"model": {"name": name, "version": version}, "runs": runs}
