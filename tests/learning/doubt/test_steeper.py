"""Steps after which a rover gets further are counted where they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from service.learning.domain import Domain
from service.learning.doubt.steeper import ALLOWED_M, measure_steeper
from service.physics.scenario import Array, Positions, Scenarios
from service.training.doubt_report import doubt_report
from tests.learning.doubt.pushed import MODEL, Pushed
from tests.learning.doubt.test_doubt import DOUBT, RUNS

DOMAIN = Domain.of_runs([run for run in RUNS if not run.varies], MODEL.prior.rover, MODEL.prior.regolith)


@dataclass(frozen=True)
class Jumping(Pushed):
    """Gets two centimetres further beyond 12.1 deg."""

    def positions_with(self, scenarios: Scenarios, time_s: Array, offset: Array | float) -> Positions:
        plain = Pushed.positions_with(self, scenarios, time_s, offset)
        steeper = (scenarios.slope_angle_rad > np.radians(12.1))[:, None]
        fall = 2.0 * np.sin(scenarios.slope_angle_rad)[:, None]  # steep enough to make up for what it gets less far
        return Positions(0.0 * plain.x_m - fall + (fall + 0.02) * steeper, plain.y_m)


def test_a_model_that_falls_behind_with_the_slope_has_none():
    found = measure_steeper(MODEL, DOUBT, DOMAIN)

    assert found["steps"] > 1000
    assert (found["further"], found["sure"], found["columns_with_one"], found["between_deg"]) == (0, 0, 0, None)


def test_a_jump_is_found_in_every_column_that_has_it():
    found = measure_steeper(Jumping(), DOUBT, DOMAIN)

    assert 0 < found["further"] == found["columns_with_one"] <= found["columns"]
    assert found["between_deg"][0] <= 12.1 <= found["between_deg"][1]
    assert found["between_deg"][1] - found["between_deg"][0] == 0.25
    assert found["most_m"] > ALLOWED_M
    page = doubt_report(DOUBT.measured, found)["report/doubt.md"].decode()
    assert f"{found['further']} of {found['steps']} steps of 0.25 ° more" in page
