"""The resistance process in plain Python, slow and independent of the compiled engine: what that is compared with.

Nothing here calls the engine. Of the product's code it uses what stands in Python only: parameters, kernels between
scenarios (`kernels.scenario_kernels`), the blend into the ruts, knots.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, exp

import numpy as np

from service.learning.resistance.hyperparameters import Hyperparameters
from service.learning.resistance.kernels import (
    ScenarioFeatures,
    ScenarioKernels,
    matern52,
    rut_plateau,
    scenario_kernels,
)
from service.learning.resistance.model import ResistanceProcess
from service.learning.resistance.tables import TRAVEL_GRID_M, TRAVEL_KNOTS_M, ResponseTables
from service.learning.resistance.traction import (
    SLIP,
    SPEED_COUNT,
    SpeedLaw,
    TractionCurve,
    TractionCurves,
    rut_blend,
    speed_grid,
)
from service.physics.parameters import RegolithParameters, RoverParameters
from service.physics.scenario import Array, Positions, Scenarios
from service.physics.similarity import torque_ratio

_SCHEDULE = ((0.02, 2.0), (0.05, 10.0), (0.1, float("inf")))


def positions(model: ResistanceProcess, scenarios: Scenarios, time_s: Array, *, refine: int = 1) -> Positions:
    """`ResistanceProcess.positions`, one scenario after the other."""
    times = np.broadcast_to(time_s, (len(scenarios), np.shape(time_s)[-1]))
    x, y = np.empty(times.shape), np.empty(times.shape)
    for row, time in enumerate(times):
        one = slice(row, row + 1)
        scenario = Scenarios(scenarios.slope_angle_rad[one], scenarios.mass_kg[one], scenarios.torque_nm[one])
        x[row], y[row] = _trajectory(model, scenario, time, refine)
    return Positions(x, y)


def _trajectory(model: ResistanceProcess, scenario: Scenarios, time_s: Array, refine: int) -> tuple[Array, Array]:
    hyper, rover, regolith = model.hyper, model.prior.rover, model.prior.regolith
    known = model.features.scaled
    masses = hyper.reference_mass_kg * np.exp(known[:, 2] * 0.33)
    mass = np.clip(scenario.mass_kg, masses.min() / hyper.mass_reach, masses.max() * hyper.mass_reach)
    ratio = float(torque_ratio(rover, regolith, scenario)[0])
    law = speed_law(rover, model.curves, hyper, float(scenario.slope_angle_rad[0]), ratio, float(mass[0]))
    scaled = scaled_features(scenario, rover, regolith, hyper)
    scaled = np.clip(scaled, known.min(axis=0) - hyper.feature_margin, known.max(axis=0) + hyper.feature_margin)
    features = ScenarioFeatures(scaled, stall_gate(scaled, np.array([law.margin]), hyper))
    start_speed, start_height = start_at(model, scaled)
    steps = step_times(float(time_s.max()), refine)
    kernels = scenario_kernels(hyper.resistance, features, model.features)
    scale = (float(mass[0]) / hyper.reference_mass_kg) ** hyper.mass_exponent
    resistance = np.interp(TRAVEL_GRID_M, TRAVEL_KNOTS_M, along_travel(model.resistance, kernels))
    middles = 0.5 * (steps[1:] + steps[:-1])
    release = np.interp(middles, model.time_knots_s, along_time(model.resistance, kernels))
    travel = integrate(
        hyper,
        law,
        regolith.gravity_m_s2,
        scale * (hyper.mean_resistance + resistance),
        scale * release,
        start_speed,
        steps,
    )
    kernels = scenario_kernels(hyper.height, features, model.features)
    height = start_height + np.interp(travel, TRAVEL_KNOTS_M, along_travel(model.height, kernels))
    height += np.interp(steps, model.time_knots_s, along_time(model.height, kernels))
    height[0] = start_height
    return np.interp(time_s, steps, travel), np.interp(time_s, steps, height)


def step_times(horizon_s: float, refine: int = 1) -> Array:
    """Steps from 0 to the horizon or just past it."""
    times, start = [0.0], 0.0
    for step, until in _SCHEDULE:
        if start >= horizon_s:
            break
        count = ceil((min(until, max(horizon_s, start + step)) - start) * refine / step - 1e-9)
        times += [start + number * (step / refine) for number in range(1, count + 1)]
        start = until
    return np.array(times)


def integrate(
    hyper: Hyperparameters,
    law: SpeedLaw,
    gravity_m_s2: float,
    along_travel: Array,
    along_time: Array,
    start_speed_m_s: float,
    steps_s: Array,
) -> Array:
    """Travel (m) at the steps by exponential Euler; `along_travel` is over TRAVEL_GRID_M."""
    blends, cells = rut_blend(hyper, TRAVEL_GRID_M), len(TRAVEL_GRID_M) - 1
    speeds, per_speed = law.speeds_m_s, 1.0 / (law.speeds_m_s[1] - law.speeds_m_s[0])
    rim_speed = -0.5 * speeds[0]
    x, v, travelled = 0.0, start_speed_m_s, [0.0]
    for end, dt, release in zip(steps_s[1:], np.diff(steps_s), along_time, strict=True):
        place = float(np.clip((x + v * dt * 0.5 - TRAVEL_GRID_M[0]) / 0.01, 0.0, cells - 0.000001))
        cell = int(place)
        rho = along_travel[cell] + (place - cell) * (along_travel[cell + 1] - along_travel[cell]) + release
        rutted = blends[cell]
        place = float(np.clip((v - speeds[0]) * per_speed, 0.0, SPEED_COUNT - 1.000001))
        at, fraction = int(place), place - int(place)
        ends = law.virgin[at : at + 2] + rutted * (law.rut[at : at + 2] - law.virgin[at : at + 2])
        rate = max(-gravity_m_s2 * per_speed * (ends[1] - ends[0]), 0.05)
        force = ends[0] + fraction * (ends[1] - ends[0]) - rho
        if v < 0.0:
            force = max(force, min(-law.sine, 0.0))
        gain, approach = gravity_m_s2 * force / rate, 1.0 - exp(-rate * dt)
        x += v * dt + gain * (dt - approach / rate)
        bound = max(1.2 * rim_speed, gravity_m_s2 * end)
        v = min(max(v + gain * approach, -bound), bound)
        travelled.append(x)
    return np.array(travelled)


def along_travel(tables: ResponseTables, kernels: ScenarioKernels, scenario: int = 0) -> Array:
    """The part of a process that depends on the travel, at TRAVEL_KNOTS_M."""
    rut = (kernels.rut[scenario] @ tables.rut) * rut_plateau(TRAVEL_KNOTS_M)
    return kernels.level[scenario] @ tables.level + rut + kernels.travel[scenario] @ tables.travel


def along_time(tables: ResponseTables, kernels: ScenarioKernels, scenario: int = 0) -> Array:
    """The part that depends on the time since release, at the time knots."""
    return kernels.release[scenario] @ tables.release + kernels.stall[scenario] @ tables.stall


def start_at(model: ResistanceProcess, scaled: Array) -> tuple[float, float]:
    """Speed (m/s) and height (m) at release."""
    slope = (np.degrees(np.arctan(scaled[0, 0] * 0.19 + 0.27)) - 15.0) / 10.0
    here = np.array([slope, scaled[0, 2]])
    return tuple(model.start.mean + start_shape(here[None], model.start.features)[0] @ model.start.weights)


def start_shape(one: Array, two: Array) -> Array:
    """The kernel of the start between features (one, 2) and (two, 2)."""
    apart = (one[:, None] - two[None]) / np.array([1.2, 6.0])
    return matern52(np.sqrt(np.square(apart).sum(axis=-1))) + 1.0 + one @ two.T


def scaled_features(
    scenarios: Scenarios, rover: RoverParameters, regolith: RegolithParameters, hyper: Hyperparameters
) -> Array:
    """`features.scaled_features`."""
    ratio = np.maximum(torque_ratio(rover, regolith, scenarios), 1e-9)
    columns = [
        (np.tan(scenarios.slope_angle_rad) - 0.27) / 0.19,
        np.log(ratio / 0.32) / 0.55,
        np.log(scenarios.mass_kg / hyper.reference_mass_kg) / 0.33,
    ]
    return np.stack(columns, axis=-1)


def stall_gate(scaled: Array, margins: Array, hyper: Hyperparameters) -> Array:
    """`features.stall_gate`."""
    threshold = hyper.gate_margin + hyper.gate_torque * 0.55 * scaled[:, 1] + hyper.gate_mass * 0.33 * scaled[:, 2]
    return 1.0 / (1.0 + np.exp(np.clip((margins - threshold) / hyper.gate_width, -700.0, 700.0)))


def mean_shear(deformation: Array) -> Array:
    """J of `TractionCurve`."""
    size = np.maximum(np.abs(deformation), 1e-6)
    return np.sign(deformation) * (1.0 + np.expm1(-size) / size)


def traction(curve: TractionCurve, slip: Array, load_kg: float) -> Array:
    """phi of `TractionCurve`."""
    bounded = np.clip(slip, -1.0, 4.0)
    shear = mean_shear(bounded / (curve.slip_scale * (load_kg / 275.0) ** -curve.load_exponent))
    whole = curve.adhesion + curve.plateau * shear + curve.linear * np.clip(bounded, -0.5, 1.0)
    back = np.clip((bounded - 1.0) / curve.backing_slip, 0.0, 1.0)
    return whole * (1.0 - curve.backing_loss * (3.0 * back**2 - 2.0 * back**3))


def axle_shares(
    rover: RoverParameters, hyper: Hyperparameters, angle_rad: float, mass_kg: float
) -> tuple[float, float]:
    """`traction.axle_shares`."""
    payload = (mass_kg - hyper.unladen_mass_kg) / hyper.unladen_mass_kg
    height = rover.centre_of_mass_height_m + hyper.height_rise_m * payload
    cosine = float(np.cos(angle_rad))
    moment = rover.centre_of_mass_ahead_of_rear_axle_m * cosine - height * float(np.sin(angle_rad))
    share = moment / rover.wheelbase_m - hyper.share_shift * cosine
    front = float(np.clip(share, 0.02 * cosine, 0.98 * cosine))
    return front, cosine - front


@dataclass(frozen=True)
class _Axle:
    """Torques and rim speeds over rising speeds."""

    speed_m_s: Array
    torque: Array
    rim_m_s: Array
    share: float

    def torque_at(self, speeds: Array) -> Array:
        return np.interp(speeds, self.speed_m_s, self.torque)

    def rim_at(self, speeds: Array) -> Array:
        return np.interp(speeds, self.speed_m_s, self.rim_m_s)


def _axle(curve: TractionCurve, share: float, load_kg: float, ratio: float, rim_speed: float) -> _Axle:
    slip, most = SLIP[::-1], 2.0 * max(ratio, 1e-4)
    demand = share * traction(curve, slip, load_kg)
    rim = np.maximum(rim_speed * (1.0 - demand / most), 0.0)
    speed = rim * (1.0 - slip)
    back = slip > 1.0
    speed[back] = np.minimum.accumulate(speed[back][::-1])[::-1]
    return _Axle(np.maximum.accumulate(speed), np.minimum(demand, most), rim, share)


def speed_law(
    rover: RoverParameters,
    curves: TractionCurves,
    hyper: Hyperparameters,
    angle_rad: float,
    ratio: float,
    mass_kg: float,
) -> SpeedLaw:
    """`traction.speed_law`."""
    speeds, sine = speed_grid(rover), float(np.sin(angle_rad))
    rim_speed = rover.wheel_radius_m * rover.no_load_speed_rad_s
    front_share, rear_share = axle_shares(rover, hyper, angle_rad, mass_kg)
    front = _axle(curves.front, front_share, 0.5 * mass_kg, ratio, rim_speed)
    rears = [
        _axle(curve, rear_share, rear_share * mass_kg, ratio, rim_speed) for curve in (curves.rear, curves.rear_in_rut)
    ]
    pushes = [front.torque_at(speeds) + rear.torque_at(speeds) for rear in rears]
    crawl = float(np.interp(hyper.margin_speed_m_s, speeds, pushes[0]))
    scale = (mass_kg / hyper.reference_mass_kg) ** hyper.mass_exponent
    margin = crawl - sine - hyper.mean_resistance * scale + hyper.mean_resistance
    above = (margin - hyper.sticking_margin) / hyper.sticking_width
    if above < 8.0:
        stuck = hyper.mean_resistance * scale / (1.0 + exp(above))
        direction = stuck * (1.0 - np.tanh(speeds / hyper.sticking_speed_m_s))
        for push, rear in zip(pushes, rears, strict=True):
            for axle in (front, rear):
                wheel = hyper.sticking_wheel_m_s
                turning = np.square(axle.rim_at(speeds) / wheel) if wheel else np.zeros_like(speeds)
                push += axle.share * (1.0 - np.tanh(turning)) * direction
    for push in pushes:
        push -= sine
        push[0], push[-1] = push[1], push[-2]
    return SpeedLaw(speeds, pushes[0], pushes[1], margin, sine)
