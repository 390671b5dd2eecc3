"""Traction: what an axle's wheels push with as a function of their slip, and the speed law that follows from it.

The torque of an axle's two motors over the rover's weight and wheel radius, D = 2 q (1 - w/w0) with
q = tau/(m g R_w), balances n phi(s): n is the axle's static share of the weight, s = 1 - v/(R_w w) the slip. In the
shipped runs D/n of all scenarios falls on one curve phi of the slip per axle, and one for the rear axle in the ruts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np

from service.learning.resistance.hyperparameters import Hyperparameters
from service.physics.parameters import RoverParameters
from service.physics.scenario import Array

# Load at which the slip scale is stated, kg on one axle (half of 550 kg).
_REFERENCE_LOAD_KG = 275.0
# Smallest share of the weight that an axle is given: a rover does not tip over here.
_LEAST_SHARE = 0.02
# From slipping backwards at three times the rim speed to skidding at twice it; dense where the curves bend.
SLIP = np.concatenate([-np.geomspace(1.0, 0.002, 40), [0.0], np.geomspace(0.001, 4.0, 160)])
# Speeds of the tabulated law, in units of the no-load rim speed.
_LOWEST_SPEED, _HIGHEST_SPEED, SPEED_COUNT = -2.0, 3.0, 801
# Without torque the wheels would turn at any speed: a ratio this small is as good as none.
_LEAST_TORQUE_RATIO = 1e-4


@dataclass(frozen=True, slots=True)
class TractionCurve:
    """phi(s) = adhesion + plateau J(s / (slip_scale f)) + linear clip(s, -0.5, 1), f = (load / 275 kg)**-load_exponent.

    J(x) = 1 - (1 - exp(-x))/x is Janosi and Hanamoto's shear law averaged over the contact patch, continued as an odd
    function (Wong, Theory of Ground Vehicles, 4th ed., eq. 2.59). All parameters are dimensionless.
    """

    adhesion: float
    plateau: float
    slip_scale: float
    load_exponent: float = 0.0
    linear: float = 0.0

    def __post_init__(self) -> None:
        if not all(np.isfinite(getattr(self, each.name)) for each in fields(self)) or self.slip_scale <= 0:
            raise ValueError(f"a traction curve needs finite values and a positive slip_scale, got {self}")

    def __call__(self, slip: Array, load_kg: Array | float) -> Array:
        """phi at slips and loads (kg) of one shape."""
        bounded = np.clip(slip, SLIP[0], SLIP[-1])
        scale = self.slip_scale * (load_kg / _REFERENCE_LOAD_KG) ** -self.load_exponent
        curve = self.adhesion + self.plateau * mean_shear(bounded / scale) + self.linear * np.clip(bounded, -0.5, 1.0)
        return np.asarray(curve, dtype=np.float64)


def mean_shear(deformation: Array) -> Array:
    """J of `TractionCurve`."""
    size = np.maximum(np.abs(deformation), 1e-6)
    return np.asarray(np.sign(deformation) * (1.0 + np.expm1(-size) / size), dtype=np.float64)


@dataclass(frozen=True, slots=True)
class TractionCurves:
    """The front axle's curve, the rear axle's on virgin soil and in the ruts. Defaults: fitted to all shipped runs."""

    front: TractionCurve = TractionCurve(0.150, 0.383, 0.416, 1.0, 1.0)
    rear: TractionCurve = TractionCurve(0.166, 0.871, 0.321, 0.446)
    rear_in_rut: TractionCurve = TractionCurve(0.127, 0.871, 0.026)

    def describe(self) -> dict[str, Any]:
        """As JSON values."""
        return asdict(self)

    @classmethod
    def restore(cls, description: Mapping[str, Mapping[str, float]]) -> TractionCurves:
        """Inverse of `describe`. Raises TypeError or ValueError for what does not fit."""
        return cls(**{name: TractionCurve(**curve) for name, curve in description.items()})


def axle_shares(
    rover: RoverParameters, hyper: Hyperparameters, angle_rad: float, mass_kg: float
) -> tuple[float, float]:
    """Static shares of the front and the rear axle in m g: n_f = (L_r cos th - h sin th)/L and n_r = cos th - n_f.

    The centre of mass rises with the load: h = h_0 + height_rise (m - m_0)/m_0. Held where an axle would lift off.
    """
    payload = (mass_kg - hyper.unladen_mass_kg) / hyper.unladen_mass_kg
    height = rover.centre_of_mass_height_m + hyper.height_rise_m * payload
    cosine = float(np.cos(angle_rad))
    moment = rover.centre_of_mass_ahead_of_rear_axle_m * cosine - height * float(np.sin(angle_rad))
    front = min(max(moment / rover.wheelbase_m, _LEAST_SHARE * cosine), (1.0 - _LEAST_SHARE) * cosine)
    return front, cosine - front


@dataclass(frozen=True, slots=True)
class SpeedLaw:
    """F(v, x) - sin th of one scenario: what pushes the rover forward before the resistance, over its weight.

    `virgin` and `rut` have shape (speed,) at `speeds_m_s`; F is their blend by `rut_blend(x)`. `margin` says how far
    the drive at a crawl exceeds what holding the rover on the slope takes, `sine` is sin th.
    """

    speeds_m_s: Array
    virgin: Array
    rut: Array
    margin: float
    sine: float

    def at(self, speed_m_s: Array, blend: Array) -> Array:
        """F - sin th at speeds and blends of one shape."""
        virgin = np.interp(speed_m_s, self.speeds_m_s, self.virgin)
        return np.asarray(virgin + blend * (np.interp(speed_m_s, self.speeds_m_s, self.rut) - virgin))


def rut_blend(hyper: Hyperparameters, travel_m: Array) -> Array:
    """0 while the rear wheels run on virgin soil, 1 once they run in the front wheels' ruts."""
    return smoothstep((travel_m - hyper.rut_start_m) / (hyper.rut_end_m - hyper.rut_start_m))


def smoothstep(fraction: Array) -> Array:
    """0 below 0, 1 above 1, smooth in between."""
    bounded = np.clip(fraction, 0.0, 1.0)
    return np.asarray(bounded * bounded * (3.0 - 2.0 * bounded), dtype=np.float64)


def speed_grid(rover: RoverParameters) -> Array:
    """The speeds (m/s) at which laws are tabulated: uniform, shape (SPEED_COUNT,)."""
    return np.linspace(_LOWEST_SPEED, _HIGHEST_SPEED, SPEED_COUNT) * rover.wheel_radius_m * rover.no_load_speed_rad_s


def speed_law(
    rover: RoverParameters,
    curves: TractionCurves,
    hyper: Hyperparameters,
    angle_rad: float,
    torque_ratio: float,
    mass_kg: float,
) -> SpeedLaw:
    """The speed law of one scenario. `torque_ratio` is q above; `mass_kg` sets loads, not the ratio."""
    speeds = speed_grid(rover)
    rim_speed = rover.wheel_radius_m * rover.no_load_speed_rad_s
    front, rear = axle_shares(rover, hyper, angle_rad, mass_kg)
    # The load of the front wheels was found not to matter beyond the mass: half of it stands for it.
    axles = (
        (curves.front, front, 0.5 * mass_kg),
        (curves.rear, rear, rear * mass_kg),
        (curves.rear_in_rut, rear, rear * mass_kg),
    )
    tables = [
        _axle_table(curve, share, load, max(torque_ratio, _LEAST_TORQUE_RATIO), rim_speed)
        for curve, share, load in axles
    ]
    torques = [np.interp(speeds, speed, torque) for speed, torque, _ in tables]
    virgin, rut = torques[0] + torques[1], torques[0] + torques[2]
    sine = float(np.sin(angle_rad))
    scale = (mass_kg / hyper.reference_mass_kg) ** hyper.mass_exponent
    crawl = float(np.interp(hyper.margin_speed_m_s, speeds, virgin))
    margin = crawl - sine - hyper.mean_resistance * scale + hyper.mean_resistance
    above = (margin - hyper.sticking_margin) / hyper.sticking_width
    if above < 8.0:  # beyond, the term is less than a thousandth of the resistance
        stuck = _sticking(
            hyper, speeds, tables, (front, rear, rear), hyper.mean_resistance * scale / (1.0 + np.exp(above))
        )
        virgin, rut = virgin + stuck[0] + stuck[1], rut + stuck[0] + stuck[2]
    # The law is held constant past its ends, and its slope there must say so.
    for table in (virgin, rut):
        table[-1], table[0] = table[-2], table[1]
    return SpeedLaw(speeds, virgin - sine, rut - sine, margin, sine)


def _axle_table(
    curve: TractionCurve, share: float, load_kg: float, ratio: float, rim_speed: float
) -> tuple[Array, Array, Array]:
    """Speed (rising), torque and rim speed of one axle, tabulated over the slip: no equation needs solving.

    At slip s the motors' law gives the rim speed u = rim_speed (1 - n phi(s)/(2 q)), and the rover moves at u (1 - s).
    """
    slip = SLIP[::-1]
    demand = share * curve(slip, load_kg)
    rim = np.maximum(rim_speed * (1.0 - demand / (2.0 * ratio)), 0.0)
    speed = rim * (1.0 - slip)
    # Backwards, a wheel that spins and a standing one can both balance: take the spinning one while there is one.
    forward = int(np.searchsorted(-slip, -1.0))
    speed[:forward] = np.minimum.accumulate(speed[:forward][::-1])[::-1]
    return np.maximum.accumulate(speed), np.minimum(demand, 2.0 * ratio), rim


def _sticking(
    hyper: Hyperparameters,
    speeds: Array,
    tables: Sequence[tuple[Array, Array, Array]],
    shares: Sequence[float],
    resistance: float,
) -> list[Array]:
    """What turns the resistance of standing wheels around where the motors cannot climb, per axle; shape (speed,)."""
    direction = resistance * (1.0 - np.tanh(speeds / hyper.sticking_speed_m_s))
    rims = [np.interp(speeds, speed, rim) for speed, _, rim in tables]
    return [
        share * (1.0 - np.tanh((rim / hyper.sticking_wheel_m_s) ** 2)) * direction
        for share, rim in zip(shares, rims, strict=True)
    ]
