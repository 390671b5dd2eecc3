"""Traction: what an axle's wheels push with as a function of their slip, and the speed law that follows from it.

The torque of an axle's two motors over the rover's weight and wheel radius, D = 2 q (1 - w/w0) with
q = tau/(m g R_w), balances n phi(s): n is the axle's static share of the weight, s = 1 - v/(R_w w) the slip. In the
shipped runs D/n of all scenarios falls on one curve phi of the slip per axle, and one for the rear axle in the ruts.
The formulas are in `native/laws.c`.
"""

from __future__ import annotations

from collections.abc import Mapping
from ctypes import addressof, byref, c_double
from dataclasses import asdict, astuple, dataclass, fields, replace
from typing import Any

import numpy as np

from service.learning.resistance.hyperparameters import Hyperparameters
from service.learning.resistance.library import (
    Body,
    Curve,
    Laws,
    address,
    contiguous,
    library,
    require_success,
    vector_bits,
)
from service.physics.parameters import RoverParameters
from service.physics.scenario import Array

# From slipping backwards at three times the rim speed to skidding at twice it; dense where the curves bend.
SLIP = np.concatenate([-np.geomspace(1.0, 0.002, 40), [0.0], np.geomspace(0.001, 4.0, 160)])
_FALLING_SLIP = np.ascontiguousarray(SLIP[::-1])  # tables go along rising speeds
# Speeds of the tabulated law, in units of the no-load rim speed.
_LOWEST_SPEED, _HIGHEST_SPEED, SPEED_COUNT = -2.0, 3.0, 801


@dataclass(frozen=True, slots=True)
class TractionCurve:
    """phi(s) = [adhesion + plateau J(s / (slip_scale f)) + linear clip(s, -0.5, 1)] [1 - backing_loss S(s - 1)].

    f = (load / 275 kg)**-load_exponent. J(x) = 1 - (1 - exp(-x))/x is Janosi and Hanamoto's shear law averaged over the
    contact patch, continued as an odd function (Wong, Theory of Ground Vehicles, 4th ed., eq. 2.59). S rises smoothly
    from 0 to 1 over `backing_slip`: a wheel that turns uphill while the rover slides back (s > 1) meets fresh soil
    behind it, which helps to turn it. All parameters are dimensionless.
    """

    adhesion: float
    plateau: float
    slip_scale: float
    load_exponent: float = 0.0
    linear: float = 0.0
    backing_loss: float = 0.0
    backing_slip: float = 1.0

    def __post_init__(self) -> None:
        if not all(np.isfinite(getattr(self, each.name)) for each in fields(self)) or self.slip_scale <= 0:
            raise ValueError(f"a traction curve needs finite values and a positive slip_scale, got {self}")
        if not 0.0 <= self.backing_loss <= 1.0 or self.backing_slip <= 0:
            raise ValueError(f"backing_loss must be 0 to 1 and backing_slip positive, got {self}")

    def __call__(self, slip: Array, load_kg: Array | float) -> Array:
        """phi at slips and loads (kg); shapes broadcast."""
        slips, loads = (contiguous(each) for each in np.broadcast_arrays(slip, load_kg))
        found = np.empty_like(slips)
        bounds = float(SLIP[0]), float(SLIP[-1])
        library().rover_traction(
            byref(self.compiled()), found.size, address(slips), address(loads), *bounds, address(found)
        )
        return found

    def compiled(self) -> Curve:
        """As the engine has it."""
        return Curve(*astuple(self))


def mean_shear(deformation: Array) -> Array:
    """J of `TractionCurve`."""
    asked = contiguous(deformation)
    found = np.empty_like(asked)
    library().rover_mean_shear(found.size, address(asked), address(found))
    return found


@dataclass(frozen=True, slots=True)
class TractionCurves:
    """The front axle's curve, the rear axle's on virgin soil and in the ruts. Defaults: fitted to all shipped runs."""

    front: TractionCurve = TractionCurve(0.150, 0.383, 0.416, 1.0, 1.0)
    rear: TractionCurve = TractionCurve(0.166, 0.871, 0.321, 0.446)
    rear_in_rut: TractionCurve = TractionCurve(0.127, 0.871, 0.026)

    def backing(self, hyper: Hyperparameters) -> TractionCurves:
        """The same with what rear wheels lose where the rover slides back: of front wheels it hardly matters."""
        rear, rear_in_rut = (
            replace(curve, backing_loss=hyper.backing_loss, backing_slip=hyper.backing_slip)
            for curve in (self.rear, self.rear_in_rut)
        )
        return TractionCurves(self.front, rear, rear_in_rut)

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
    """Shares of the axles in m g, at rest: front n_f = (L_r cos th - h sin th)/L - d cos th, rear n_r = cos th - n_f.

    The centre of mass rises with the load: h = h_0 + height_rise (m - m_0)/m_0. The shift d comes from the soil, which
    carries a rolling wheel ahead of its centre. Held where an axle would lift off.
    """
    front, rear = c_double(), c_double()
    library().rover_axle_shares(byref(_body(rover, hyper)), angle_rad, mass_kg, addressof(front), addressof(rear))
    return front.value, rear.value


def _body(rover: RoverParameters, hyper: Hyperparameters) -> Body:
    return Body(
        wheelbase_m=rover.wheelbase_m,
        centre_ahead_m=rover.centre_of_mass_ahead_of_rear_axle_m,
        centre_height_m=rover.centre_of_mass_height_m,
        height_rise_m=hyper.height_rise_m,
        unladen_mass_kg=hyper.unladen_mass_kg,
        share_shift=hyper.share_shift,
    )


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


def compiled_laws(rover: RoverParameters, curves: TractionCurves, hyper: Hyperparameters, speeds_m_s: Array) -> Laws:
    """What the engine makes speed laws of; `speeds_m_s` is `speed_grid(rover)`, to be kept as long as the answer."""
    return Laws(
        vector_bits=vector_bits(),
        body=_body(rover, hyper),
        rim_speed_m_s=rover.wheel_radius_m * rover.no_load_speed_rad_s,
        reference_mass_kg=hyper.reference_mass_kg,
        mass_exponent=hyper.mass_exponent,
        mean_resistance=hyper.mean_resistance,
        sticking_margin=hyper.sticking_margin,
        sticking_width=hyper.sticking_width,
        sticking_wheel_m_s=hyper.sticking_wheel_m_s,
        sticking_speed_m_s=hyper.sticking_speed_m_s,
        margin_speed_m_s=hyper.margin_speed_m_s,
        curves=(Curve * 3)(curves.front.compiled(), curves.rear.compiled(), curves.rear_in_rut.compiled()),
        slip_count=len(_FALLING_SLIP),
        slips=address(_FALLING_SLIP),
        speed_count=len(speeds_m_s),
        speeds_m_s=address(speeds_m_s),
    )


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
    laws = compiled_laws(rover, curves, hyper, speeds)
    scenario = np.array([angle_rad, torque_ratio, mass_kg])
    (virgin, rut), ends = np.empty((2, len(speeds))), np.empty(2)
    columns = [address(scenario) + 8 * column for column in range(3)]
    tables = address(virgin), address(rut), address(ends), address(ends) + 8
    require_success(library().rover_tabulate_laws(byref(laws), 1, *columns, *tables))
    return SpeedLaw(speeds, virgin, rut, float(ends[0]), float(ends[1]))
