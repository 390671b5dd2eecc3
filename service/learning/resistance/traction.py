"""Traction: what an axle's wheels push with as a function of their slip, and the speed law that follows from it.

The torque of an axle's two motors over the rover's weight and wheel radius, D = 2 q (1 - w/w0) with
q = tau/(m g R_w), balances n phi(s): n is the axle's static share of the weight, s = 1 - v/(R_w w) the slip. In the
shipped runs D/n of all scenarios falls on one curve phi of the slip per axle, and one for the rear axle in the ruts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from service.learning.curves import interpolate_curves, interpolate_each
from service.learning.resistance.hyperparameters import Hyperparameters
from service.physics.parameters import RoverParameters
from service.physics.scenario import Array

Index = npt.NDArray[np.intp]

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
_LAWS_AT_ONCE = 64  # so that their tables stay in cache
_STUCK_BELOW = 8.0  # sticking widths above the sticking margin
# Rovers with more margin than this do not slide back but for their release, those on steeper slopes do not outrun
# their wheels: nearly all stay within -0.45 to 1.05 times the no-load rim speed. Whoever uses a law sees when not.
_MAY_SLIDE_BELOW, _MAY_RUN_BELOW = 0.15, 0.02
_USUAL = (248, 489)
_FORWARD = int(np.searchsorted(-SLIP[::-1], -1.0))  # slips above 1 come first in tables of rising speed


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
        """phi at slips and loads (kg); shapes broadcast."""
        bounded = np.clip(slip, SLIP[0], SLIP[-1])
        # with an exponent of zero the load does not matter, and one row stands for all
        factor = (load_kg / _REFERENCE_LOAD_KG) ** -self.load_exponent if self.load_exponent else 1.0
        curve = mean_shear(bounded / (self.slip_scale * factor))
        curve *= self.plateau
        curve += self.adhesion
        curve = curve + self.linear * np.clip(bounded, -0.5, 1.0) if self.linear else curve
        return np.asarray(curve, dtype=np.float64)


def mean_shear(deformation: Array) -> Array:
    """J of `TractionCurve`."""
    size = np.maximum(np.abs(deformation), 1e-6)
    mean = np.expm1(-size)
    mean /= size
    mean += 1.0
    mean *= np.sign(deformation)
    return np.asarray(mean, dtype=np.float64)


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
    front, rear = _axle_shares(rover, hyper, np.array([angle_rad]), np.array([mass_kg]))
    return float(front[0]), float(rear[0])


def _axle_shares(
    rover: RoverParameters, hyper: Hyperparameters, angle_rad: Array, mass_kg: Array
) -> tuple[Array, Array]:
    """`axle_shares` of many scenarios, each of shape (scenario,)."""
    payload = (mass_kg - hyper.unladen_mass_kg) / hyper.unladen_mass_kg
    height = rover.centre_of_mass_height_m + hyper.height_rise_m * payload
    cosine = np.cos(angle_rad)
    moment = rover.centre_of_mass_ahead_of_rear_axle_m * cosine - height * np.sin(angle_rad)
    front = np.clip(moment / rover.wheelbase_m, _LEAST_SHARE * cosine, (1.0 - _LEAST_SHARE) * cosine)
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


@dataclass(frozen=True, slots=True, eq=False)
class SpeedLaws:
    """The `SpeedLaw` of many scenarios: `virgin` and `rut` of shape (scenario, speed), `margin`, `sine` (scenario,).

    Tabulated, scenario by scenario, are the speeds from number `first` to number `last`; the others hold anything.
    """

    speeds_m_s: Array
    virgin: Array
    rut: Array
    margin: Array
    sine: Array
    first: Index
    last: Index

    def one(self, scenario: int) -> SpeedLaw:
        """That of one of them."""
        return SpeedLaw(
            self.speeds_m_s,
            self.virgin[scenario],
            self.rut[scenario],
            float(self.margin[scenario]),
            float(self.sine[scenario]),
        )


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
    columns = (np.array([value]) for value in (angle_rad, torque_ratio, mass_kg))
    return speed_laws(rover, curves, hyper, *columns).one(0)


def speed_laws(
    rover: RoverParameters,
    curves: TractionCurves,
    hyper: Hyperparameters,
    angle_rad: Array,
    torque_ratio: Array,
    mass_kg: Array,
    *,
    whole: bool = True,
) -> SpeedLaws:
    """The speed laws of many scenarios; angles, ratios q and masses have shape (scenario,).

    Unless `whole`, a scenario that will hardly slide back, or outrun its wheels, has those speeds left out.
    """
    count, sine = len(mass_kg), np.sin(angle_rad)
    virgin, rut = np.empty((2, count, SPEED_COUNT))
    ends = np.zeros(count, dtype=np.intp), np.full(count, SPEED_COUNT - 1)
    laws = SpeedLaws(speed_grid(rover), virgin, rut, np.empty(count), sine, *ends)
    ratio = np.maximum(torque_ratio, _LEAST_TORQUE_RATIO)
    rim_speed = rover.wheel_radius_m * rover.no_load_speed_rad_s
    front, rear = _axle_shares(rover, hyper, angle_rad, mass_kg)
    # The load of the front wheels was found not to matter beyond the mass: half of it stands for it.
    axles = (
        (curves.front, front, 0.5 * mass_kg),
        (curves.rear, rear, rear * mass_kg),
        (curves.rear_in_rut, rear, rear * mass_kg),
    )
    for rows in (slice(at, at + _LAWS_AT_ONCE) for at in range(0, count, _LAWS_AT_ONCE)):
        tables = [_axle_tables(curve, share[rows], load[rows], ratio[rows], rim_speed) for curve, share, load in axles]
        _tabulate(laws, rows, tables, hyper, mass_kg[rows], whole=whole)
    for table in (virgin, rut):  # The law is held constant past its ends, and its slope there must say so.
        table[:, -1], table[:, 0] = table[:, -2], table[:, 1]
    return laws


def _tabulate(
    laws: SpeedLaws, rows: slice, axles: Sequence[AxleTables], hyper: Hyperparameters, mass_kg: Array, *, whole: bool
) -> None:
    """Fill in some rows of the laws. `mass_kg` has shape (row,)."""
    speeds, virgin, rut, sine = laws.speeds_m_s, laws.virgin[rows], laws.rut[rows], laws.sine[rows]
    low, high = (0, SPEED_COUNT) if whole else _USUAL
    pushes = _pushes(speeds[low:high], axles)
    crawl = interpolate_curves(np.array([hyper.margin_speed_m_s]), speeds[low:high], pushes[0])[:, 0]
    scale = (mass_kg / hyper.reference_mass_kg) ** hyper.mass_exponent
    margin = crawl - sine - hyper.mean_resistance * scale + hyper.mean_resistance
    laws.margin[rows] = margin
    above = (margin - hyper.sticking_margin) / hyper.sticking_width
    # beyond, the term is less than a thousandth of the resistance
    sticks = above < _STUCK_BELOW
    resistance = hyper.mean_resistance * scale / (1.0 + np.exp(np.minimum(above, _STUCK_BELOW)))

    def complete(some: Index | slice, columns: slice, pushes: tuple[Array, Array]) -> None:
        if len(stuck := np.flatnonzero(sticks[some])):
            at = np.arange(len(sticks))[some][stuck]
            front, *rears = _sticking(hyper, speeds[columns], [each.of(at) for each in axles], resistance[at])
            for push, rear in zip(pushes, rears, strict=True):
                push[stuck] = push[stuck] + front + rear
        for table, push in zip((virgin, rut), pushes, strict=True):
            push -= sine[some, None]
            table[some, columns] = push

    complete(slice(None), slice(low, high), pushes)
    if whole:
        return
    slow, fast = margin < _MAY_SLIDE_BELOW, sine < _MAY_RUN_BELOW
    laws.first[rows], laws.last[rows] = np.where(slow, 0, low), np.where(fast, SPEED_COUNT, high) - 1
    for wanted, columns in ((slow, slice(0, low)), (fast, slice(high, SPEED_COUNT))):
        if len(some := np.flatnonzero(wanted)):
            complete(some, columns, _pushes(speeds[columns], [each.of(some) for each in axles]))


def _pushes(speeds: Array, axles: Sequence[AxleTables]) -> tuple[Array, Array]:
    """What both axles push with on virgin soil and in the ruts, (scenario, speed)."""
    front, rear, rear_in_rut = (_read(speeds, each, each.torque) for each in axles)
    rear += front
    rear_in_rut += front
    return rear, rear_in_rut


class AxleTables(NamedTuple):
    """Of one axle over the slip, (scenario, node): rising speeds, torques, rim speeds; and its share (scenario,).

    Nodes are the slips, the largest first, between two that hold the first and last values half a reach from zero.
    What lies further out matters to no tabulated speed in scenarios that `fits` (scenario,).
    """

    speed_m_s: Array
    torque: Array
    rim_m_s: Array
    share: Array
    fits: npt.NDArray[np.bool_]

    def of(self, scenarios: Index) -> AxleTables:
        """Those of some scenarios."""
        speed, torque, rim, share, fits = self
        return AxleTables(speed[scenarios], torque[scenarios], rim[scenarios], share[scenarios], fits[scenarios])


def _axle_tables(curve: TractionCurve, share: Array, load_kg: Array, ratio: Array, rim_speed: float) -> AxleTables:
    """One axle, tabulated over the slip: no equation needs solving.

    At slip s the motors' law gives the rim speed u = rim_speed (1 - n phi(s)/(2 q)), and the rover moves at u (1 - s).
    Arguments have shape (scenario,).
    """
    slip, nodes = SLIP[::-1], (len(share), len(SLIP) + 2)
    speed, torque, rim = np.empty(nodes), np.empty(nodes), np.empty(nodes)
    most, inside = 2.0 * ratio[:, None], np.s_[:, 1:-1]
    demand = share[:, None] * curve(slip, load_kg[:, None])
    turning = demand / most
    np.subtract(1.0, turning, out=turning)
    turning *= rim_speed
    np.maximum(turning, 0.0, out=rim[inside])
    found = rim[inside] * (1.0 - slip)
    if len(falling := np.flatnonzero((found[:, 1:] < found[:, :-1]).any(axis=1))):
        some = found[falling]
        # Backwards, a wheel that spins and a standing one can both balance: take the spinning one while there is one.
        backwards = some[:, :_FORWARD][:, ::-1]
        np.minimum.accumulate(backwards, axis=1, out=backwards)
        found[falling] = np.maximum.accumulate(some, axis=1)
    reach = _reach(rim_speed)
    speed[inside] = _rounded(found, reach)
    np.minimum(demand, most, out=torque[inside])
    speed[:, 0], speed[:, -1] = -0.5 * reach, 0.5 * reach
    for values in (torque, rim):
        values[:, 0], values[:, -1] = values[:, 1], values[:, -2]
    within = (found <= 0.5 * reach).sum(axis=1)
    past = within > (found <= _HIGHEST_SPEED * rim_speed).sum(axis=1)
    fits = (past | (within == found.shape[1])) & (found[:, 0] > -0.5 * reach)
    return AxleTables(speed, torque, rim, share, fits)


def _reach(rim_speed: float) -> float:
    """A power of two, of which half is far more than any speed at which laws are tabulated."""
    return float(2.0 ** np.ceil(np.log2(16.0 * rim_speed)))


def _rounded(speeds_m_s: Array, reach: float) -> Array:
    """Speeds to 46 binary digits of the reach, some 1e-13 m/s: sums with 64 times the reach are exact."""
    unit = reach * 2.0**-46
    return np.asarray(np.rint(speeds_m_s * (1.0 / unit)) * unit)


def _read(speeds: Array, axle: AxleTables, values: Array) -> Array:
    """Values (scenario, node) of an axle, read at the same speeds for all; (scenario, speed).

    All scenarios are laid end to end, one reach apart, so that it is one interpolation.
    """
    if not axle.fits.all():  # hardly any torque holds the wheels: they can be turned as fast as one likes
        found = interpolate_each(speeds, axle.speed_m_s[:, 1:-1], values[:, 1:-1])
        if axle.fits.any():
            found[axle.fits] = _read(speeds, axle.of(np.flatnonzero(axle.fits)), values[axle.fits])
        return found
    reach = 2.0 * float(axle.speed_m_s[0, -1])
    ends = reach * np.arange(len(values))[:, None]
    tables = np.minimum(axle.speed_m_s, 0.5 * reach)
    tables += ends
    found = np.interp((_rounded(speeds, reach) + ends).ravel(), tables.ravel(), values.ravel())
    return np.asarray(found.reshape(len(values), len(speeds)))


def _sticking(hyper: Hyperparameters, speeds: Array, axles: Sequence[AxleTables], resistance: Array) -> list[Array]:
    """What turns the resistance of standing wheels around where the motors cannot climb, per axle; (scenario, speed).

    `resistance` has shape (scenario,).
    """
    direction = resistance[:, None] * _one_minus_tanh(speeds / hyper.sticking_speed_m_s)
    rims = [_read(speeds, each, each.rim_m_s) for each in axles]
    return [
        each.share[:, None] * _one_minus_tanh((rim / hyper.sticking_wheel_m_s) ** 2) * direction
        for rim, each in zip(rims, axles, strict=True)
    ]


def _one_minus_tanh(angle: Array) -> Array:
    """1 - tanh, which an exponential gives several times faster."""
    return np.asarray(2.0 / (1.0 + np.exp(np.minimum(2.0 * angle, 700.0))))
