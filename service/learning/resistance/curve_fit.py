"""Fitting the traction curves to what the wheels did: slip and torque while a run goes steadily."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

from service.learning.observed import ObservedRun
from service.learning.resistance.hyperparameters import Hyperparameters
from service.learning.resistance.traction import TractionCurve, TractionCurves, axle_shares, mean_shear
from service.physics.parameters import RegolithParameters, RoverParameters
from service.physics.scenario import Array
from service.physics.similarity import torque_ratio

# Travel (m) over which runs go steadily: before the rear wheels meet the ruts, and in them.
_VIRGIN, _RUT = (0.5, 1.0), (1.9, 3.2)
_LEAST_WINDOW_S, _UNFINISHED_M = 0.3, 0.4
_LEAST_VIRGIN = 4
_LOG_DEVIATION = 0.03  # of the torques around the curve
_RUT_DEVIATION = 0.02  # the same for the weighed residual in the ruts


class _Prior(NamedTuple):
    """What is known of a curve's parameters before runs are seen, in `TractionCurve`'s order; limits are hard."""

    mean: tuple[float, ...]
    deviation: tuple[float, ...]
    lowest: tuple[float, ...]
    highest: tuple[float, ...]


# Rounded from the shipped runs. The load exponent needs runs of different masses, the shape runs over a range of slips:
# where these are missing the parameters stay here.
_FRONT = _Prior((0.15, 0.4, 0.4, 0.9, 1.0), (0.03, 0.2, 0.2, 0.3, 0.2), (0, 0.1, 0.01, -1, 0), (0.4, 3, 3, 1, 2))
_REAR = _Prior((0.17, 0.87, 0.32, 0.45), (0.03, 0.2, 0.1, 0.3), (0, 0.1, 0.01, -1), (0.4, 3, 3, 1))
_RUT_CURVE = _Prior((0.13, 0.026), (0.03, 0.01), (0.05, 0.008), (0.3, 0.1))


@dataclass(frozen=True, slots=True, eq=False)
class SteadyStates:
    """Windows of runs, each array of shape (window,). Torques are D of `traction`, shares n, loads in kg."""

    in_rut: npt.NDArray[np.bool_]
    mass_kg: Array
    front_slip: Array
    rear_slip: Array
    front_torque: Array
    rear_torque: Array
    front_share: Array
    rear_share: Array

    @property
    def front_load_kg(self) -> Array:
        """Half the mass: how the weight moves between the axles was found not to matter for the front wheels."""
        return 0.5 * self.mass_kg

    @property
    def rear_load_kg(self) -> Array:
        """What the rear wheels carry."""
        return self.mass_kg * self.rear_share


def fit_curves(
    runs: Sequence[ObservedRun], rover: RoverParameters, regolith: RegolithParameters, hyper: Hyperparameters
) -> TractionCurves:
    """The curves of these runs. Where too few of them recorded wheel speeds, the stored defaults stand in.

    The defaults of `TractionCurves` come from the 80 shipped runs, so they suit their rover and regolith only.
    """
    rows = [row for run in runs for row in _windows(run, rover, regolith, hyper)]
    if not rows:
        return TractionCurves().backing(hyper)
    table = np.array(rows).T
    states = SteadyStates(table[0] > 0, *table[1:])
    virgin = ~states.in_rut
    if virgin.sum() < _LEAST_VIRGIN:
        return TractionCurves().backing(hyper)
    rear = _fit_curve(
        _REAR,
        states.rear_slip[virgin],
        states.rear_load_kg[virgin],
        states.rear_share[virgin],
        states.rear_torque[virgin],
    )
    front = _fit_curve(_FRONT, states.front_slip, states.front_load_kg, states.front_share, states.front_torque)
    return TractionCurves(front, rear, _fit_rut(states, rear.plateau)).backing(hyper)


def _windows(
    run: ObservedRun, rover: RoverParameters, regolith: RegolithParameters, hyper: Hyperparameters
) -> list[list[float]]:
    if run.rear_wheel_speed_rad_s is None or run.front_wheel_speed_rad_s is None or run.torque_nm <= 0:
        return []
    ratio = float(torque_ratio(rover, regolith, run.scenario)[0])
    shares = axle_shares(rover, hyper, float(run.scenario.slope_angle_rad[0]), run.mass_kg)
    # Of the body where it was recorded: the wheel centre also moves when the rover pitches.
    speeds = np.gradient(run.x_m, run.time_s) if run.body_speed_m_s is None else run.body_speed_m_s
    step = run.horizon_s / (len(run.time_s) - 1)
    rows = []
    for in_rut, (start, end) in ((0.0, _VIRGIN), (1.0, _RUT)):
        inside = (run.x_m >= start) & (run.x_m < end)
        if inside.sum() * step < _LEAST_WINDOW_S or run.x_m.max() < end - _UNFINISHED_M:
            continue
        speed = float(speeds[inside].mean())
        wheels = [float(w[inside].mean()) for w in (run.front_wheel_speed_rad_s, run.rear_wheel_speed_rad_s)]
        if min(wheels) <= 0:
            continue
        slips = [1.0 - speed / (rover.wheel_radius_m * wheel) for wheel in wheels]
        torques = [2.0 * ratio * (1.0 - wheel / rover.no_load_speed_rad_s) for wheel in wheels]
        if min(torques) > 0:
            rows.append([in_rut, run.mass_kg, *slips, *torques, *shares])
    return rows


def _fit_curve(prior: _Prior, slip: Array, load_kg: Array, share: Array, torque: Array) -> TractionCurve:
    """Least squares of the logarithms of torques, robust against single windows, with the prior's pull."""
    mean, deviation = np.array(prior.mean), np.array(prior.deviation)

    def residual(parameters: Array) -> Array:
        ratio = np.maximum(TractionCurve(*parameters)(slip, load_kg), 1e-3) * share / torque
        return np.concatenate([np.log(ratio) / _LOG_DEVIATION, (parameters - mean) / deviation])

    fitted = least_squares(residual, mean, bounds=(prior.lowest, prior.highest), loss="soft_l1")
    return TractionCurve(*fitted.x.tolist())


def _fit_rut(states: SteadyStates, plateau: float) -> TractionCurve:
    """In the ruts slips are so small that their error matters: the residual is weighed by it (0.01 of slip)."""
    where, mean, deviation = states.in_rut, np.array(_RUT_CURVE.mean), np.array(_RUT_CURVE.deviation)
    slip, torque = np.clip(states.rear_slip[where], -1.0, 4.0), states.rear_torque[where] / states.rear_share[where]

    def residual(p: Array) -> Array:
        modelled = p[0] + plateau * mean_shear(slip / p[1])
        pull = _RUT_DEVIATION * (p - mean) / deviation
        return np.concatenate([(modelled - torque) / (0.1 + plateau / p[1] * 0.01), pull])

    bounds = (_RUT_CURVE.lowest, _RUT_CURVE.highest)
    fitted = least_squares(residual, mean, bounds=bounds, loss="soft_l1", f_scale=_RUT_DEVIATION).x
    return TractionCurve(float(fitted[0]), plateau, float(fitted[1]))
