"""Which drives to simulate next: those whose outcome is open, each unlike the others.

Candidates fill the domain evenly: a rover meets one change of slope, or of torque, or stops and goes on, as the runs of
the shipped set `steps` do. Wherever it drives, its motors outweigh the slope: else it rolls back or coasts. Each is
worth the error to expect of its force balance times the entropy of its outcome; what is near to one that was picked is
worth less.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from service.errors import InvalidValueError
from service.learning.doubt.doubt import Doubt
from service.learning.doubt.meeting import Meeting
from service.learning.drive.inputs import Controls, Route, Track
from service.learning.drive.model import DriveModel
from service.learning.suggest import MOST_SUGGESTIONS
from service.physics.scenario import Array, Positions
from service.physics.similarity import motors_outweigh_slope

DURATION_S = 20.0
_CANDIDATES, _TIMES = 256, 201
_CHANGES_AT_M, _OVER_M, _CHANGES_AT_S, _STOPS_FOR_S = 2.0, 0.3, 8.0, 3.0
# Roberts' additive recurrence in six dimensions: powers of 1/g, g**7 = g + 1, fill the cube evenly and never repeat.
_STEPS: Array = np.power(1.1127756842787055, -np.arange(1.0, 7.0))


class Change(StrEnum):
    """What happens on the way."""

    SLOPE = "slope"
    TORQUE = "torque"
    STOP = "stop"


@dataclass(frozen=True, slots=True)
class SuggestedDrive:
    """A drive to simulate from rest, `DURATION_S` long; `chances` are those of passing, sticking and sliding."""

    change: Change
    mass_kg: float
    slope_deg: tuple[float, float]
    torque_nm: tuple[float, float]
    chances: tuple[float, float, float]

    def track(self) -> Track:
        """Its slope along the way: from the first to the second after two metres, or the first all along."""
        first, second = np.radians(self.slope_deg)
        if self.change is not Change.SLOPE:
            return Track.constant(float(first))
        return Track(np.array([_CHANGES_AT_M, _CHANGES_AT_M + _OVER_M]), np.array([first, second]))

    def controls(self) -> Controls:
        """Its torques over time."""
        first, second = self.torque_nm
        if self.change is Change.SLOPE:
            return Controls.constant(first)
        if self.change is Change.TORQUE:
            return Controls(np.array([0.0, _CHANGES_AT_S]), np.array([first, second]))
        times = np.array([0.0, _CHANGES_AT_S, _CHANGES_AT_S + _STOPS_FOR_S])
        return Controls(times, np.array([first, 0.0, second]), np.array([False, True, False]))


def suggest_drives(
    model: DriveModel, doubt: Doubt, spans: Mapping[str, tuple[float, float]], count: int
) -> tuple[SuggestedDrive, ...]:
    """`count` drives, the most useful first; the first ones do not depend on how many are asked for.

    `spans` bounds slope_deg, mass_kg and torque_nm. Raises InvalidValueError for a count outside 1 to 64, or above
    that of the drives on which the motors outweigh the slope.
    """
    if not 1 <= count <= MOST_SUGGESTIONS:
        raise InvalidValueError("n", count, f"1 to {MOST_SUGGESTIONS}")
    found = [_judged(model, doubt, each) for each in _candidates(spans) if _is_driven(model, each)]
    if len(found) < count:
        raise InvalidValueError("n", count, f"at most {len(found)}: on other drives the slope outweighs the motors")
    places = np.stack([place for _, place, _ in found])
    worth = np.array([each for _, _, each in found])
    picked = []
    for _ in range(count):
        best = int(worth.argmax())
        picked.append(found[best][0])
        worth = worth * (1.0 - np.exp(-0.5 * np.square(places - places[best]).sum(axis=1)))
    return tuple(picked)


def meeting_of(model: DriveModel, drive: SuggestedDrive) -> tuple[Meeting, Positions]:
    """What a rover meets on such a drive, as the model has it, and where it is."""
    times = np.linspace(0.0, DURATION_S, _TIMES)
    track, controls = drive.track(), drive.controls()
    motion, _ = model.engine.drive(model.start(drive.mass_kg, float(track.slope_rad[0])), track, controls, times)
    acts = np.searchsorted(controls.time_s, times, side="right") - 1
    braked = np.asarray(controls.brake)[acts] > 0
    meeting = Meeting(drive.mass_kg, times, motion.x_m, motion.slope_rad, controls.torque_nm[acts], braked)
    return meeting, Positions(motion.x_m[None], motion.y_m[None])


def _is_driven(model: DriveModel, drive: SuggestedDrive) -> bool:
    """Whether the motors outweigh both slopes, or do so with both torques."""
    track, controls = drive.track(), drive.controls()
    slope, torque = np.meshgrid(track.slope_rad, controls.torque_nm[np.asarray(controls.brake) == 0])
    prior, mass = model.prior, np.full(slope.shape, drive.mass_kg)
    return bool(motors_outweigh_slope(prior.rover, prior.regolith, slope, mass, torque).all())


def _judged(model: DriveModel, doubt: Doubt, drive: SuggestedDrive) -> tuple[SuggestedDrive, Array, float]:
    """With its chances, its mean place, and what it is worth."""
    meeting, _ = meeting_of(model, drive)
    track, controls = drive.track(), drive.controls()
    start = model.start(drive.mass_kg, float(track.slope_rad[0]))

    def driven(offsets: Sequence[float], time_s: Array) -> Array:
        return model.engine.ways_along([Route(start, track, controls, each) for each in offsets], time_s)

    chances = doubt.drive_probabilities(driven, meeting)
    worth = float(doubt.worth(doubt.drive_scales(meeting)[0], chances)[0])
    passes, sticks, slides = (float(each) for each in chances)
    said = SuggestedDrive(drive.change, drive.mass_kg, drive.slope_deg, drive.torque_nm, (passes, sticks, slides))
    return said, meeting.places(doubt.rover, doubt.regolith).mean(axis=0), worth


def _candidates(spans: Mapping[str, tuple[float, float]]) -> list[SuggestedDrive]:
    cube = np.mod(0.5 + np.arange(1, _CANDIDATES + 1)[:, None] * _STEPS, 1.0)
    fields = ("mass_kg", "slope_deg", "slope_deg", "torque_nm", "torque_nm")
    lowest, highest = np.array([spans[field] for field in fields]).T
    columns = (lowest + cube[:, :5] * (highest - lowest)).round(1).tolist()
    kinds = [tuple(Change)[int(3.0 * each)] for each in cube[:, 5]]
    return [
        SuggestedDrive(kind, mass, (first, second), (torque, later), (0.0, 0.0, 0.0))
        for kind, (mass, first, second, torque, later) in zip(kinds, columns, strict=True)
    ]
