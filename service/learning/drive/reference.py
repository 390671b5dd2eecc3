"""The equation of motion in plain Python: what `native/` computes, as short as it can be said. For tests.

dv/dt = g (F - sin(slope) - resistance). Time is cut into cells; in each the equation is linear in the speed, made so at
the cell's start with positions, ways and digging at its middle.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from service.learning.drive.inputs import Controls, Track
from service.learning.drive.law import Law, scaled_features
from service.physics.scenario import Array

RUT_CELL_M, SAME_TIME_S, FULL_SLIP = 0.04, 1e-10, 1 + 1e-9
SHORT_CELL_S, CELL_S, SHORT_UNTIL_S, BRAKE_CELLS = 0.02, 0.05, 0.3, 8


def held(number: float, low: float, high: float) -> float:
    """The number within two others."""
    return min(max(number, low), high)


def smooth(fraction: float) -> float:
    """From 0 at 0 to 1 at 1."""
    f = held(fraction, 0.0, 1.0)
    return f * f * (3 - 2 * f)


def mean_shear(d: float) -> tuple[float, float]:
    """J(d) = 1 - (1 - exp(-d))/d, continued as an odd function, and its slope."""
    size = abs(d)
    if size < 1e-3:
        return d * (0.5 - size / 6), 0.5 - size / 3
    mean = -math.expm1(-size) / size
    return math.copysign(1 - mean, d), (mean - math.exp(-size)) / size


def compacted_shear(d: float, left: float) -> tuple[float, float]:
    """1 - left (1 - exp(-d))/d and its slope: soil that is sheared already."""
    d = held(d, -6.0, 60.0)
    if abs(d) < 1e-3:
        return 1 - left * (1 - d * (0.5 - d / 6)), left * (0.5 - d / 3)
    mean = -math.expm1(-d) / d
    return 1 - left * mean, left * (mean - math.exp(-d)) / d


def without_repeats(controls: Controls) -> Controls:
    """Only those that change something."""
    torques = np.where(np.asarray(controls.brake) != 0, -1.0, controls.torque_nm)
    kept = np.concatenate([[True], np.diff(torques) != 0])
    return Controls(controls.time_s[kept], controls.torque_nm[kept], np.asarray(controls.brake)[kept])


@dataclass
class Moment:
    """State of a rover; names as in `rover_state`."""

    x: float = 0.0
    speed: float = 0.0
    event_s: float = 0.0
    slip_path: float = 0.0
    path: float = 0.0
    dig: float = 0.0
    furthest: float = 0.0
    lowest: float = 0.0
    front_slip: float = 0.0
    frontier: float | None = None
    height: float = 0.0
    ruts: dict[int, float] = field(default_factory=dict)  # by number of the ground's cell


@dataclass
class Cell:
    """One cell of time from a moment on: speed and rim speeds over it."""

    acceleration: float
    rate: float
    rims: tuple[float, float] = (0.0, 0.0)
    by_speed: tuple[float, float] = (0.0, 0.0)

    def moved(self, at: Moment, within: float) -> tuple[float, float]:
        """Position and speed after a time."""
        lost, reach = -math.expm1(-self.rate * within), self.acceleration / self.rate
        return at.x + at.speed * within + reach * (within - lost / self.rate), at.speed + reach * lost


class Reference:
    """One rover of a mass under a law."""

    def __init__(self, law: Law, mass_kg: float) -> None:
        self.law, self.mass = law, mass_kg
        self.p, self.rover, self.gravity = law.named, law.rover, law.regolith.gravity_m_s2
        self.top = law.rover.no_load_speed_rad_s * law.rover.wheel_radius_m

    def drive(self, start_speed: float, track: Track, controls: Controls, time_s: Array) -> Array:
        """Position, speed and height at rising times, (3, time)."""
        controls = without_repeats(controls)
        at, now, told, rows = Moment(speed=start_speed), 0.0, 0, []
        slope = self._slope(track, at.x)
        at.height = self._height(at, slope, self._torque(controls, 0))
        ends = [*controls.time_s[1:], math.inf]
        asked = list(time_s)
        while asked and asked[0] <= SAME_TIME_S:
            rows.append((at.x, at.speed, at.height))
            asked.pop(0)
        while asked:
            while ends[told] <= now + SAME_TIME_S:
                told += 1
                at.event_s = 0.0
            torque, brake = self._inputs(controls, told)
            length = SHORT_CELL_S if at.event_s < SHORT_UNTIL_S - SAME_TIME_S else CELL_S
            length /= BRAKE_CELLS if brake else 1
            slope = self._slope(track, at.x + at.speed * length / 2)
            cell = self._braked(at, slope, length) if brake else self._driven(at, slope, torque, length)
            end = self._after(at, cell, length, brake)
            next_height = self._height(end, slope, torque, before=at)
            until = min(now + length, ends[told], asked[-1])
            within = length if until > now + length - SAME_TIME_S else until - now
            while asked and asked[0] <= now + within + SAME_TIME_S:
                t = asked.pop(0) - now
                t = length if t > length - SAME_TIME_S else t
                rows.append((*cell.moved(at, t), at.height + t / length * (next_height - at.height)))
            height = at.height + within / length * (next_height - at.height)
            at = end if within == length else self._after(at, cell, within, brake)
            at.height = height
            now += within
        return np.array(rows).T

    def _inputs(self, controls: Controls, i: int) -> tuple[float, bool]:
        brake = bool(np.asarray(controls.brake)[i])
        return 0.0 if brake else float(controls.torque_nm[i]), brake

    def _torque(self, controls: Controls, i: int) -> float:
        return self._inputs(controls, i)[0]

    def _slope(self, track: Track, x: float) -> float:
        return float(np.interp(x + self.rover.wheelbase_m / 2, track.distance_m, track.slope_rad))

    def _scaled(self, slope: float, torque: float) -> tuple[float, Array]:
        ratio = min(torque / (self.mass * self.gravity * self.rover.wheel_radius_m), 1e3)
        scaled = scaled_features(np.array(slope), np.array(ratio), np.array(self.mass))
        return ratio, np.clip(scaled, *self.law.reach.T)

    def _ruts(self, at: Moment, x: float) -> float:
        p = self.p
        again = smooth((at.furthest - x - 0.05) / 0.3) * smooth((x - at.lowest + 0.1) / 0.2)
        return max(smooth((x - p["rut_begin_m"]) / (p["rut_end_m"] - p["rut_begin_m"])), again)

    def _rut_slip(self, at: Moment, x: float) -> float:
        if at.frontier is None:
            return 1.0
        newest = math.floor(at.frontier / RUT_CELL_M) + 1
        place = held(x / RUT_CELL_M, newest - 63, newest - 1)
        whole = math.floor(place)
        here, after = at.ruts.get(whole, 1.0), at.ruts.get(whole + 1, 1.0)
        return here + (place - whole) * (after - here)

    def _height(self, at: Moment, slope: float, torque: float, before: Moment | None = None) -> float:
        """`before` is the moment whose ruts and reach hold, where `at` is the end of its cell."""
        _, (f0, f1, f2) = self._scaled(slope, torque)
        seen, m = before or at, self.mass / 550
        ruts, z = self._ruts(seen, at.x), at.dig / (1 + at.dig)
        slip, back = held(self._rut_slip(seen, at.x), 0.0, 1.0), smooth(-at.x / 0.3)
        near, far = math.exp(-at.path / 0.1), math.exp(-at.path / 0.4)
        base = [1.0, f0, m, f2**2, f0 * f2, f0**2]
        terms = [*base, *(ruts * each for each in base)]
        terms += [near * each for each in (1, f0, f2, f1)] + [far * each for each in (1, f0, f2, f1)]
        terms += [z * each for each in (1, m, f0)] + [z * ruts * each for each in (1, m, f0)] + [z * z, z * z * m]
        terms += [slip * ruts * each for each in (1, m, f0)] + [back * each for each in (1, m, z, f0)] + [f1, f1 * ruts]
        return float(np.dot(self.law.heights, terms))

    def _bounded(
        self, at: Moment, slope: float, power: float, top: float, resistance: float, rate: float, length: float
    ) -> Cell:
        power = held(power, -4.0, 4.0)
        resistance = held(resistance, -4.0 if at.speed < 0 else -max(power, 0.0), 4.0)
        rate = held(rate, 0.05, 1e4)
        gain = self.gravity / rate * -math.expm1(-rate * length)
        sine = math.sin(slope)
        least = -max(sine, 0.0, at.speed / gain)
        most = max(-sine, 0.0, (top - at.speed) / gain)
        return Cell(self.gravity * held(power - sine - resistance, least, most), rate)

    def _braked(self, at: Moment, slope: float, length: float) -> Cell:
        friction, width = self.p["brake_friction"], self.p["brake_speed_m_s"]
        sliding = math.tanh(at.speed / width)
        rate = self.gravity * friction * (1 - sliding**2) / width
        return self._bounded(at, slope, 0.0, 0.0, friction * sliding, rate, length)

    def _balance(
        self, share: float, adhesion: float, torque: float, speed: float, shear: Callable[[float], tuple[float, float]]
    ) -> tuple[float, float, float, float]:
        """Rim speed, its slope over the rover's speed, what the motors give, and its slope."""

        def excess(rim: float) -> tuple[float, float, float]:
            faster = max(abs(rim) if rim >= abs(speed) else abs(speed), 0.02)
            slow = max(rim, abs(speed)) < 0.02
            slip, by_rim, by_speed = (rim - speed) / faster, 1 / faster, -1 / faster
            if not slow and rim >= abs(speed):
                by_rim = speed / faster**2
            elif not slow:
                by_speed -= slip / faster * (-1 if speed < 0 else 1)
            if abs(slip) > FULL_SLIP:
                slip, by_rim, by_speed = math.copysign(1, slip), 0.0, 0.0
            soil, slope = shear(slip)
            turning = math.tanh(rim / 0.03)
            motors = torque * held(1 - rim / self.top, 0.0, 1.0)
            motors_by_rim = -torque / self.top if 0 <= rim < self.top else 0.0
            soil_by_rim = slope * by_rim + adhesion * (1 - turning**2) / 0.03
            return (
                motors - share * (soil + adhesion * turning) - 1e-6 * rim,
                motors_by_rim - share * soil_by_rim - 1e-6,
                -share * slope * by_speed,
            )

        reach = 1.6 * abs(speed) + 0.3
        low, high = -reach, max(reach, self.top)
        for _ in range(54):  # the one root where the motors begin to give too little
            middle = (low + high) / 2
            low, high = (middle, high) if excess(middle)[0] > 0 else (low, middle)
        rim = (low + high) / 2
        _, by_rim, by_speed = excess(rim)
        turning = 0 <= rim < self.top
        slope = torque / self.top * by_speed / by_rim if turning else 0.0
        return rim, held(-by_speed / by_rim, -2.0, 2.0), torque * held(1 - rim / self.top, 0.0, 1.0), slope

    def _driven(self, at: Moment, slope: float, torque: float, length: float) -> Cell:  # noqa: PLR0915 - the law in one piece
        p, rover, speed = self.p, self.rover, at.speed
        ratio, scaled = self._scaled(slope, torque)
        f0, f1, f2 = (float(each) for each in scaled)
        heavier, x, backed = self.mass / 550, at.x + speed * length / 2, at.furthest - at.x
        ruts, slip = self._ruts(at, x), held(self._rut_slip(at, x), 0.0, 0.95)
        slip /= 1 - p["compaction_bend"] * slip
        front_ruts = 0.0
        if at.frontier is not None:
            front_ruts = smooth((at.frontier - (x + rover.wheelbase_m) - 0.05) / 0.3)
        height = rover.centre_of_mass_height_m + p["height_rise_m"] * (self.mass - 430) / 430
        front_share = rover.centre_of_mass_ahead_of_rear_axle_m * math.cos(slope) - height * math.sin(slope)
        front_share = held(front_share / rover.wheelbase_m - p["share_shift"] * math.cos(slope), 0.02, 0.98)
        rear_share = held(math.cos(slope) - front_share, 0.02, 1.0)
        load = rear_share * self.mass / 275

        def virgin(axle: str, slip: float, per_slip: float) -> tuple[float, float]:
            shear, slope = mean_shear(slip * per_slip)
            plateau, linear = p[f"{axle}_plateau"], p[f"{axle}_linear"]
            inside = linear if -0.5 < slip < FULL_SLIP else 0.0
            return plateau * shear + linear * held(slip, -0.5, 1.0), plateau * slope * per_slip + inside

        front_scale = heavier ** p["front_load_exponent"] / p["front_slip_scale"] * (1 + p["front_in_rut"] * front_ruts)
        rear_scale = load ** p["rear_load_exponent"] / p["rear_slip_scale"]
        rut_scale = load ** p["rut_load_exponent"] / p["rut_slip_scale"]
        left = math.exp(-held(p["compaction"] * load ** p["compaction_exponent"] * slip, 0.0, 30.0))
        grip = 1.0
        if speed < 0.02:
            relief = p["backing_relief"] * (1 - math.exp(-backed / p["backing_length_m"]))
            grip -= relief * smooth((0.02 - speed) / 0.04)

        def rear(s: float) -> tuple[float, float]:
            soil, slope = virgin("rear", s, rear_scale)
            rut, rut_slope = compacted_shear((s - p["rut_slip_shift"]) * rut_scale, left)
            rut = p["rut_adhesion"] + p["compaction_adhesion"] * slip - p["rear_adhesion"] + p["rut_plateau"] * rut
            rut_slope *= p["rut_plateau"] * rut_scale
            return grip * (soil + ruts * (rut - soil)), grip * (slope + ruts * (rut_slope - slope))

        def front(s: float) -> tuple[float, float]:
            return virgin("front", s, front_scale)

        axles = (
            self._balance(front_share, p["front_adhesion"], 2 * ratio, speed, front),
            self._balance(rear_share, p["rear_adhesion"], 2 * ratio, speed, rear),
        )
        rims = axles[0][0], axles[1][0]
        rim, half = sum(rims) / 2, length / 2
        way, slid = abs(speed) * half, max(rim - speed, 0.0) * half
        path, dig = at.path + way, held(at.dig + (slid - at.dig * way) / p["dig_length_m"], 0.0, 1e3)
        sheared = 1 - p["shear_lack"] * math.exp(-(at.slip_path + slid) / p["shear_slip_m"])
        traction, traction_slope = sheared * (axles[0][2] + axles[1][2]), sheared * (axles[0][3] + axles[1][3])
        slipping = held(1 - speed / rim, 0.0, 1.0) if rim > 1e-3 else 0.0
        motion, rut, stall = self._bumps(scaled)
        share, scale = ratio**2 / (ratio**2 + p["free_ratio"] ** 2), heavier ** p["mass_exponent"]
        terms = np.array([1.0, f0, f1, f2, f0 * f0, f1 * f1, f0 * f1])
        if speed >= 0:
            early = [np.dot(terms, [p[f"early_{7 * knot + i}"] for i in range(7)]) for knot in range(4)]
            along = [np.dot(terms, [p[f"along_{7 * knot + i}"] for i in range(7)]) for knot in range(3)]
            virgin_level = p["resistance"] - p["front_rut_resistance"] * front_ruts
            rut_level = p["rut_resistance"] + p["compaction_resistance"] * (slip - 0.5) - p["resistance"]
            digging = p["dig_0"] + p["dig_1"] * f0 + p["dig_2"] * f1 + p["dig_3"] * f2
            level = scale * (virgin_level + ruts * rut_level) + p["speed_resistance"] * speed + motion + ruts * rut
            level += digging * (dig / (1 + dig) - slipping)
            level += p["near"] * math.exp(-path / p["near_length_m"]) + p["far"] * math.exp(-path / p["far_length_m"])
            level += float(np.interp(path, [0.02, 0.08, 0.22, 0.5, 0.95], [*early, 0.0]))
            level += float(np.interp(x, [0.85, 1.05, 1.3, 1.7, 2.4], [0.0, *along, 0.0]))
            free = scale * p["free_resistance"] * (1 - p["free_rut_relief"] * ruts)
            level = share * level + (1 - share) * free
        else:
            level = p["back_resistance"] * (1 - p["back_rut_relief"] * smooth(x / 0.3))
            level -= p["back_spin_relief"] * math.tanh(max(rims[1], 0.0) / p["back_spin_m_s"])
            level = scale * (level - p["back_hold_relief"] * math.exp(-backed / p["back_hold_length_m"]))
            level += share * float(np.dot(terms, [p[f"back_{i}"] for i in range(7)]))
        stuck = share * stall / (1 + math.exp((speed - p["gate_speed_m_s"]) / p["gate_width_m_s"]))
        turning = math.tanh(speed / p["turning_speed_m_s"])
        level_slope = level * (1 - turning**2) / p["turning_speed_m_s"] + (p["speed_resistance"] if speed > 0 else 0.0)
        rate = -self.gravity * (traction_slope - level_slope)
        cell = self._bounded(at, slope, traction - stuck, self.top, level * turning, rate, length)
        cell.rims, cell.by_speed = rims, (axles[0][1], axles[1][1])
        return cell

    def _bumps(self, scaled: Array) -> tuple[float, float, float]:
        n, weights = len(self.law.motion), self.law.weights
        near = [
            np.exp(-0.5 * np.square((scaled - basis.centres) / basis.lengths).sum(axis=1))
            for basis in (self.law.motion, self.law.stall)
        ]
        return (
            float(near[0] @ weights[:n]),
            float(near[0] @ weights[n : 2 * n]),
            float(near[1] @ weights[2 * n :]),
        )

    def _after(self, at: Moment, cell: Cell, within: float, brake: bool) -> Moment:
        p, base = self.p, self.rover.wheelbase_m
        x, speed = cell.moved(at, within)
        end = Moment(x, held(speed, -20.0, 20.0), at.event_s + within, at.slip_path, at.path, at.dig)
        end.furthest, end.lowest = max(at.furthest, x), min(at.lowest, x)
        end.front_slip, end.frontier, end.ruts = at.front_slip, at.frontier, at.ruts
        way, faster = abs(x - at.x), (end.speed - at.speed) / 2
        if brake:
            if abs(end.speed) < 0.03:
                end.path = end.slip_path = 0.0
                end.dig *= math.exp(-within / 0.2)
            return end
        rim = (sum(cell.rims) + sum(cell.by_speed) * faster) / 2
        slipped = max((rim - at.speed - faster) * within, 0.0)
        end.path += way
        end.slip_path += slipped
        kept = math.exp(-way / p["dig_length_m"])
        dug = slipped / way * (1 - kept) if way > 1e-7 else slipped / p["dig_length_m"]
        end.dig = held(at.dig * kept + dug, 0.0, 1e3)
        front = cell.rims[0] + cell.by_speed[0] * faster
        slip = held((front - at.speed - faster) / front, -0.2, 1.0) if front > 1e-3 else 0.0
        end.front_slip += (slip - at.front_slip) * -math.expm1(-way / p["slip_lag_m"])
        if at.frontier is None or x + base > at.frontier:
            first = at.x + base - 0.3 if at.frontier is None else at.frontier
            newest = math.floor((x + base) / RUT_CELL_M) + 1
            end.ruts = at.ruts | dict.fromkeys(range(math.ceil(first / RUT_CELL_M), newest + 1), end.front_slip)
            end.frontier = x + base
        return end
