"""Every number of the resistance process that is chosen rather than fitted.

Source, unless a line says otherwise: chosen by leave-one-run-out on the shipped runs and rounded, see the decision
record. Freely optimised values were tried and do worse on left-out runs.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

Lengths = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class KernelHyperparameters:
    """Scales of one Gaussian process over (scenario, travel, time).

    Deviations `*_deviation` are in the unit of the target: 1 (fraction of the weight) for the resistance, m for the
    height. Lengths are in units of the scaled features of `service.learning.resistance.features`.
    """

    level_deviation: float  # constant over a run
    travel_deviation: float  # depends on the travel x
    release_deviation: float  # depends on the time since release and dies out
    rut_deviation: float  # step after the rear wheels have entered the front wheels' ruts
    stall_level_deviation: float  # near stall: constant over a run
    stall_travel_deviation: float  # near stall: depends on the travel
    stall_time_deviation: float  # near stall: depends on the time since release, does not die out
    run_level_deviation: float  # the same five, but each run for itself: not predictable from the scenario
    run_travel_deviation: float
    run_release_deviation: float
    run_rut_deviation: float
    run_stall_deviation: float
    level_lengths: Lengths
    travel_lengths: Lengths
    release_lengths: Lengths
    rut_lengths: Lengths
    stall_lengths: Lengths
    noise_deviation: float  # of a mean over 0.1 s
    stall_noise_ratio: float  # how much larger the noise gets near stall
    speed_noise_m_s: float  # of the speeds at the ends of a segment; 0 where the target is no difference of speeds
    release_decay_s: float  # time constant of the release part
    travel_length: float = 0.5  # in units of warped travel (kernels.warped_travel)
    release_length: float = 1.8  # in ln(1 + t / 0.1 s)
    stall_time_length: float = 1.5  # in ln(1 + t / 0.5 s)

    def __post_init__(self) -> None:
        for each in fields(self):
            value = getattr(self, each.name)
            numbers = value if each.name.endswith("_lengths") else (value,)
            if len(numbers) != (3 if each.name.endswith("_lengths") else 1):
                raise ValueError(f"{each.name} must have three values, got {value!r}")
            positive = each.name.endswith(("length", "lengths", "decay_s"))
            if not all(math.isfinite(n) and (n > 0 if positive else n >= 0) for n in numbers):
                raise ValueError(f"{each.name} is {value!r}, allowed are finite numbers that are not negative")

    @classmethod
    def restore(cls, description: Mapping[str, Any]) -> KernelHyperparameters:
        """Inverse of `dataclasses.asdict` after JSON. Raises TypeError or ValueError for what does not fit."""
        values: dict[str, Any] = {
            name: tuple(float(n) for n in value) if isinstance(value, list | tuple) else float(value)
            for name, value in description.items()
        }
        return cls(**values)


RESISTANCE_KERNEL = KernelHyperparameters(
    level_deviation=0.05,
    travel_deviation=0.05,
    release_deviation=3.0,
    rut_deviation=0.016,
    stall_level_deviation=0.034,
    stall_travel_deviation=0.08,
    stall_time_deviation=0.14,
    run_level_deviation=0.0003,
    run_travel_deviation=0.0003,
    run_release_deviation=0.0075,
    run_rut_deviation=0.0002,
    run_stall_deviation=0.004,
    level_lengths=(2.0, 2.0, 3.0),
    travel_lengths=(1.2, 1.8, 4.5),
    release_lengths=(2.0, 2.0, 10.0),
    rut_lengths=(2.5, 4.0, 2.0),
    stall_lengths=(0.55, 0.55, 1.5),
    noise_deviation=0.004,
    stall_noise_ratio=3.0,
    speed_noise_m_s=0.003,
    release_decay_s=0.4,
)

HEIGHT_KERNEL = KernelHyperparameters(
    level_deviation=0.004,
    travel_deviation=0.003,
    release_deviation=0.01,
    rut_deviation=0.003,
    stall_level_deviation=0.005,
    stall_travel_deviation=0.006,
    stall_time_deviation=0.006,
    run_level_deviation=0.0002,
    run_travel_deviation=0.0003,
    run_release_deviation=0.0003,
    run_rut_deviation=0.0002,
    run_stall_deviation=0.001,
    level_lengths=(2.0, 2.0, 3.0),
    travel_lengths=(1.0, 1.5, 5.0),
    release_lengths=(2.0, 2.0, 10.0),
    rut_lengths=(2.5, 4.0, 1.5),
    stall_lengths=(0.55, 0.55, 1.7),
    noise_deviation=0.0012,
    stall_noise_ratio=3.0,
    speed_noise_m_s=0.0,
    release_decay_s=0.6,
)


# What versions do whose description was stored before these numbers were there.
_BEFORE = {"backing_loss": 0.0, "backing_slip": 1.0, "share_shift": 0.0}


@dataclass(frozen=True, slots=True)
class Hyperparameters:
    """The two kernels and what they share."""

    resistance: KernelHyperparameters = RESISTANCE_KERNEL
    height: KernelHyperparameters = HEIGHT_KERNEL
    mean_resistance: float = 0.15  # fraction of the weight, prior mean of the resistance at the reference mass
    reference_mass_kg: float = 550.0  # geometric middle of the shipped runs
    mass_exponent: float = 0.25  # of the resistance; 0.1 to 0.3 do alike, 0.25 suits 860 kg from 430 kg runs best
    share_shift: float = 0.01  # part of the weight that rolling shifts from the front to the rear axle
    height_rise_m: float = 0.076  # rise of the centre of mass per unladen mass of payload (the shipped runs' loads)
    unladen_mass_kg: float = 430.0  # mass for which the rover's centre-of-mass height is stated (IAC-23-A3.IP.204)
    rut_start_m: float = 1.0  # travel at which the rear wheels begin to enter the front wheels' ruts
    rut_end_m: float = 1.45  # travel at which they run in them altogether
    gate_margin: float = 0.26  # drive margin at which the near-stall part is half on
    gate_torque: float = 0.08  # its shift per ln(torque ratio / 0.32)
    gate_mass: float = 0.02  # its shift per ln(mass / reference mass)
    gate_width: float = 0.013  # scale of the sigmoid, in units of the drive margin
    sticking_margin: float = 0.67  # drive margin below which the resistance turns round where the rover slides back
    sticking_width: float = 0.03  # scale of that sigmoid
    sticking_wheel_m_s: float = 0.0  # rim speed above which a wheel no longer sticks; 0: however fast it turns
    sticking_speed_m_s: float = 0.05  # speed over which the resistance changes its sign
    # Share of their torque that rear wheels lose where the rover slides back. 0.4 suits left-out runs better, but makes
    # sliding feed on itself and maps turn round past the steepest runs: docs/decisions/0008-resistance-process.md.
    backing_loss: float = 0.1
    backing_slip: float = 1.5  # slip past 1 at which all of it is lost
    margin_speed_m_s: float = 0.02  # speed at which the drive margin is taken
    mass_reach: float = 3.0  # factor past the training masses up to which laws of traction and resistance are scaled
    feature_margin: float = 0.25  # how far scenarios may leave the training ranges before their features are held

    def __post_init__(self) -> None:
        for each in fields(self):
            value = getattr(self, each.name)
            if isinstance(value, float) and not math.isfinite(value):
                raise ValueError(f"{each.name} must be finite, got {value!r}")
        for name in ("reference_mass_kg", "unladen_mass_kg", "gate_width", "sticking_width", "backing_slip"):
            if getattr(self, name) <= 0:
                raise ValueError(f"{name} must be positive, got {getattr(self, name)!r}")
        if self.sticking_speed_m_s <= 0 or self.sticking_wheel_m_s < 0 or self.rut_end_m <= self.rut_start_m:
            raise ValueError("sticking speeds must be positive (the wheel's may be 0), rut_end_m lie past rut_start_m")
        if not 0 <= self.backing_loss <= 1:
            raise ValueError(f"backing_loss must be 0 to 1, got {self.backing_loss!r}")

    def describe(self) -> dict[str, Any]:
        """As JSON values: tuples become lists."""
        return {
            name: {key: list(each) if isinstance(each, tuple) else each for key, each in value.items()}
            if isinstance(value, dict)
            else value
            for name, value in asdict(self).items()
        }

    @classmethod
    def restore(cls, description: Mapping[str, Any]) -> Hyperparameters:
        """Inverse of `describe`. Raises KeyError, TypeError or ValueError for what does not fit."""
        rest = {name: float(value) for name, value in description.items() if name not in ("resistance", "height")}
        rest = _BEFORE | rest
        return cls(
            KernelHyperparameters.restore(description["resistance"]),
            KernelHyperparameters.restore(description["height"]),
            **rest,
        )
