"""Where on its way a drive is among the training runs: stretch by stretch, what is outside and how far."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import islice, pairwise

import numpy as np
import numpy.typing as npt

from service.learning.domain import FIELDS, JOINT, Domain, DomainReason, DomainVerdict
from service.learning.neighbourhood import Neighbourhood
from service.physics.scenario import Array
from service.physics.similarity import torque_ratio_of
from service.twin.drives.question import Told
from service.twin.drives.way import Way

MOST_STRETCHES = 100
_JOINT_EVERY = 10  # own times: half a second


@dataclass(frozen=True, slots=True)
class Stretch:
    """A part of the way, from one place of the rear wheel and time to another one, and what is outside on it.

    Of each reason the value that is furthest outside. Without reasons it is inside.
    """

    from_m: float
    to_m: float
    from_s: float
    to_s: float
    reasons: tuple[DomainReason, ...]

    @property
    def inside(self) -> bool:
        """Whether nothing is outside on it."""
        return not self.reasons


@dataclass(frozen=True, slots=True)
class DriveDomain:
    """All stretches of a drive, in order; at most a hundred are told, `left_out` says of how many more nothing is."""

    inside: bool
    stretches: tuple[Stretch, ...]
    left_out: int

    def verdict(self) -> DomainVerdict:
        """That on the whole drive: of each field that is ever outside the furthest value."""
        worst: dict[str, DomainReason] = {}
        for reason in (reason for stretch in self.stretches for reason in stretch.reasons):
            known = worst.get(reason.field)
            if known is None or _beyond(reason) > _beyond(known):
                worst[reason.field] = reason
        return DomainVerdict(self.inside, tuple(worst.values()))


def domain_of(domain: Domain, mass_kg: float, way: Way, told: Told, slope_deg: Array) -> DriveDomain:
    """The verdict on a way at its own times; `slope_deg` (time,) is that under the middle, `told` holds from each on.

    Slope, mass, torque and horizon are judged as those of a scenario are, each by itself, and together as long as all
    wheels are free to turn.
    """
    if _all_inside(domain, mass_kg, way, told, slope_deg):
        whole = Stretch(float(way.motion.x_m[0]), float(way.motion.x_m[-1]), 0.0, float(way.time_s[-1]), ())
        return DriveDomain(True, (whole,), 0)
    values = _values(domain, mass_kg, way, told, slope_deg)
    names = (*FIELDS, JOINT)
    limit = domain.neighbourhood.limit if domain.neighbourhood is not None else np.inf
    lowest, highest = np.array([*(domain.spans[field] for field in FIELDS), (0.0, limit)]).T[:, :, None]
    outside = (values < lowest) | (values > highest)
    if len(way.time_s) > 1:
        outside[:, -1] = outside[:, -2]  # nothing begins at the end
    changes = np.flatnonzero((outside[:, 1:] != outside[:, :-1]).any(axis=0)) + 1
    ends = [0, *changes.tolist(), len(way.time_s) - 1]
    found = []
    for first, last in islice(pairwise(ends), MOST_STRETCHES):
        reasons = []
        for row in np.flatnonzero(outside[:, first]).tolist():
            part = values[row, first : max(last, first + 1)]
            low, high = float(lowest[row, 0]), float(highest[row, 0])
            furthest = float(part[np.maximum(low - part, part - high).argmax()])
            reasons.append(DomainReason(names[row], furthest, low, high))
        x, time = way.motion.x_m, way.time_s
        found.append(Stretch(float(x[first]), float(x[last]), float(time[first]), float(time[last]), tuple(reasons)))
    return DriveDomain(False, tuple(found), max(len(ends) - 1 - MOST_STRETCHES, 0))


def _all_inside(domain: Domain, mass_kg: float, way: Way, told: Told, slope_deg: Array) -> bool:
    """Whether nothing is ever outside: mostly so, and seen from the extremes."""
    free = told.torque_nm[~told.brake] if told.brake.any() else told.torque_nm
    lowest, highest, end = float(slope_deg.min()), float(slope_deg.max()), float(way.time_s[-1])
    seen = [("slope_deg", lowest, highest), ("mass_kg", mass_kg, mass_kg), ("horizon_s", end, end)]
    same = False
    if free.size:
        least, most = float(free.min()), float(free.max())
        low, high = (torque_ratio_of(domain.rover, domain.regolith, mass_kg, each) for each in (least, most))
        seen += [("torque_nm", least, most), ("torque_ratio", low, high)]
        same = lowest == highest and least == most and free is told.torque_nm
    if any(low < domain.spans[field][0] or high > domain.spans[field][1] for field, low, high in seen):
        return False
    known = domain.neighbourhood
    if known is None:
        return True
    if same:  # all the way: one place tells all
        here = known.places_of(slope_deg[:1], np.array([mass_kg]), told.torque_nm[:1])
        return bool(known.least_distances(here)[0] <= known.limit)
    return bool((_joint(known, mass_kg, told, slope_deg)[1] <= known.limit).all())


def _values(domain: Domain, mass_kg: float, way: Way, told: Told, slope_deg: Array) -> Array:
    """What is judged, (field, time) in the order of FIELDS, then the joint distance; locked wheels are inside."""
    count = len(way.time_s)
    mass = np.full(count, mass_kg)
    ratio = torque_ratio_of(domain.rover, domain.regolith, mass, told.torque_nm)
    values = np.stack([slope_deg, mass, told.torque_nm, ratio, way.time_s, np.zeros(count)])
    for row, field in enumerate(FIELDS):
        if field.startswith("torque"):
            values[row, told.brake] = domain.spans[field][0]
    if domain.neighbourhood is not None:
        rows, distances = _joint(domain.neighbourhood, mass_kg, told, slope_deg)
        values[-1] = distances[np.searchsorted(rows, np.arange(count), side="right") - 1]
    return values


def _joint(known: Neighbourhood, mass_kg: float, told: Told, slope_deg: Array) -> tuple[npt.NDArray[np.intp], Array]:
    """Joint distances at some of the times, and which: each holds until the next; 0 under the brake."""
    rows = np.flatnonzero(_looked_at(told))
    distances = known.least_distances(
        known.places_of(slope_deg[rows], np.full(len(rows), mass_kg), told.torque_nm[rows])
    )
    distances[told.brake[rows]] = 0.0
    return rows, distances


def _looked_at(told: Told) -> npt.NDArray[np.bool_]:
    """Where the joint distance is looked up: every few times, and where torque or brake change."""
    looked = np.zeros(len(told.torque_nm), dtype=np.bool_)
    looked[::_JOINT_EVERY] = True
    looked[1:] |= (told.torque_nm[1:] != told.torque_nm[:-1]) | (told.brake[1:] != told.brake[:-1])
    return looked


def _beyond(reason: DomainReason) -> float:
    return max(reason.lowest - reason.value, reason.value - reason.highest)
