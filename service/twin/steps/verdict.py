"""Whether rovers underway are where training runs were: the domain's verdict, field by field, for many at once."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from service.learning.domain import FIELDS, JOINT, Domain
from service.physics.scenario import Array
from service.physics.similarity import torque_ratio_of

_SAME_TIME_S = 1e-6  # what summing up many steps may add to a time
_OF_TORQUE = frozenset({"torque_nm", "torque_ratio"})


@dataclass(frozen=True, slots=True, eq=False)
class StepDomain:
    """A domain that is asked by the step."""

    domain: Domain
    _bounds: Array = field(init=False, repr=False)
    _of_torque: npt.NDArray[np.bool_] = field(init=False, repr=False)
    _spans: tuple[tuple[str, float, float, bool], ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_bounds", np.array([self.domain.spans[name] for name in FIELDS]).T[:, :, None])
        object.__setattr__(self, "_of_torque", np.array([name in _OF_TORQUE for name in FIELDS])[:, None])
        spans = tuple((name, *self.domain.spans[name], name in _OF_TORQUE) for name in FIELDS)
        object.__setattr__(self, "_spans", spans)

    def outside_of(
        self, slope_deg: Array, mass_kg: Array, torque_nm: Array, brake: npt.NDArray[np.bool_], time_s: Array
    ) -> list[list[str]]:
        """Of each rover the inputs that are outside, as verdicts name them; columns (rover,).

        The time since the start is the horizon. Braked wheels are driven by no torque: there neither torque nor its
        combination with others is judged.
        """
        domain, lowest, highest = self.domain, *self._bounds
        ratio = torque_ratio_of(domain.rover, domain.regolith, mass_kg, torque_nm)
        values = np.array([slope_deg, mass_kg, torque_nm, ratio, time_s - _SAME_TIME_S])
        outside = (values < lowest) | (values > highest)
        if brake.any():
            outside &= ~(self._of_torque & brake)
        found: list[list[str]] = [[] for _ in range(len(brake))]
        for row, at in np.argwhere(outside.T).tolist():
            found[row].append(FIELDS[at])
        near = domain.neighbourhood
        if near is not None:
            gaps = near.least_distances(near.places_of(slope_deg, mass_kg, torque_nm))
            for row in np.flatnonzero((gaps > near.limit) & ~brake).tolist():
                found[row].append(JOINT)
        return found

    def outside_of_one(
        self, slope_deg: float, mass_kg: float, torque_nm: float, time_s: float, *, brake: bool
    ) -> list[str]:
        """Those of one rover, in plain numbers: several times faster than arrays."""
        domain = self.domain
        ratio = torque_ratio_of(domain.rover, domain.regolith, mass_kg, torque_nm)
        values = (slope_deg, mass_kg, torque_nm, ratio, time_s - _SAME_TIME_S)
        found = [
            name
            for (name, lowest, highest, of_torque), value in zip(self._spans, values, strict=True)
            if not (lowest <= value <= highest or (brake and of_torque))
        ]
        near = domain.neighbourhood
        if near is not None and not brake and near.least_distance(slope_deg, mass_kg, torque_nm) > near.limit:
            found.append(JOINT)
        return found
