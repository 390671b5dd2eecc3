"""The map of outcomes: each cell is a prediction's, and the steepest slope is where the climb ends."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import model_store
from model_store import ModelStore
from service.errors import InvalidValueError
from service.learning.band import Band
from service.learning.domain import Domain
from service.learning.doubt.outcomes import LATE_SPEED_M_S
from service.learning.trajectory_model import motion_by_difference
from service.physics.prior import Prior
from service.physics.scenario import Array, Motion, Positions, Scenarios
from service.twin import NonFiniteError, Outcome, Scenario, Twin, sample_times
from service.twin.load import load_twin
from service.twin.mobility import STEEPEST_STEP_DEG, MobilityMap, mobility_map
from service.twin.summary import LAST_PART, outcome_of
from tests.learning.synthetic import synthetic_runs
from tests.twin.published import network_model, publish

SLOPES = np.linspace(0.0, 40.0, 21)
TORQUES = (20.0, 60.0, 120.0)


@pytest.fixture(scope="module")
def twin() -> Twin:
    store = ModelStore.open("memory://")
    publish(store)
    return load_twin(store, "unit", 1)


@pytest.fixture(scope="module")
def sure_twin(twin: Twin) -> Twin:
    """The same with a real band, from left-out predictions that are off by 2 to 7 % of the way."""
    runs = synthetic_runs()
    left_out = {
        run.name: Positions(run.x_m[None] * (1.02 + 0.005 * at), run.y_m[None] + 1e-4 * run.time_s)
        for at, run in enumerate(runs)
    }
    return replace(twin, band=Band.calibrate(runs, left_out, twin.domain))


@dataclass(frozen=True)
class Gliding:
    """A model that moves evenly at a speed that `speeds_m_s` gives for each whole degree of slope."""

    prior: Prior
    speeds_m_s: tuple[float, ...]
    quick: ClassVar[bool] = True
    knows_wheel_speeds: ClassVar[bool] = False

    def positions(self, scenarios: Scenarios, time_s: Array) -> Positions:
        slopes = np.degrees(scenarios.slope_angle_rad)
        speeds = np.interp(slopes, np.arange(len(self.speeds_m_s)), self.speeds_m_s)
        return Positions(speeds[:, None] * time_s, self.prior.positions(scenarios, time_s).y_m)

    def motion(self, scenarios: Scenarios, time_s: Array) -> Motion:
        return motion_by_difference(self.positions, scenarios, time_s)


def gliding(twin: Twin, *speeds_m_s: float) -> Twin:
    return replace(everywhere(twin), model=Gliding(twin.model.prior, speeds_m_s))


def everywhere(twin: Twin) -> Twin:
    """The same, at home wherever these tests ask."""
    wide = {"slope_deg": (-90.0, 90.0), "mass_kg": (1.0, 1e4), "torque_nm": (0.0, 1e4), "torque_ratio": (0.0, 1e4)}
    domain = Domain(wide | {"horizon_s": (0.0, 1e3)}, twin.domain.rover, twin.domain.regolith)
    return replace(twin, domain=domain)


def steepest(found: MobilityMap) -> list[float | None]:
    return list(found.steepest_climb_slope_deg)


@pytest.fixture(scope="module")
def champion() -> Twin:
    store = ModelStore.open(next(iter(model_store.__path__)))
    resolved = store.resolve("viper-lunar")
    return load_twin(store, resolved.name, resolved.version)


@pytest.mark.slow
@given(st.floats(200, 900), st.sampled_from([0.5, 4.0, 10.0]), st.booleans())
@settings(max_examples=8)
def test_every_cell_is_the_prediction_of_its_scenario(twin, mass_kg, horizon_s, learned):
    asked = replace(twin, model=network_model()) if learned else twin
    found = mobility_map(asked, mass_kg, TORQUES, SLOPES, horizon_s, 0.9)

    assert found.confidence is None
    for row, torque in enumerate(TORQUES):
        for column in range(0, len(SLOPES), 4):
            scenario = Scenario(SLOPES[column], mass_kg, torque, horizon_s)
            prediction = asked.predict(scenario, sample_times(horizon_s, 0.1))
            assert found.outcome[row][column] is prediction.summary.outcome
            assert found.mean_speed_m_s[row, column] == pytest.approx(prediction.summary.mean_speed_m_s, abs=1e-5)
            assert found.slip_ratio[row][column] == pytest.approx(prediction.summary.slip_ratio, abs=1e-4)
            assert found.inside_domain[row, column] == prediction.domain.inside


@pytest.mark.slow
@given(st.floats(300, 900), st.integers(2, 30), st.floats(0.75, 0.995), st.booleans())
@settings(max_examples=20)
def test_the_steepest_slope_is_where_the_sure_climb_ends(twin, sure_twin, mass_kg, steps, confidence, with_band):
    asked = sure_twin if with_band else twin
    slopes = np.linspace(0.0, 44.0, steps)
    found = mobility_map(asked, mass_kg, TORQUES, slopes, 4.0, confidence)

    assert found.confidence == (confidence if with_band else None)
    for torque, slope in zip(TORQUES, steepest(found), strict=True):
        if slope is None:
            row = found.inside_domain[list(TORQUES).index(torque)]
            assert not row.any() or not surely_climbs(asked, slopes[0], mass_kg, torque, confidence)
            continue
        assert surely_climbs(asked, slope, mass_kg, torque, confidence)
        assert all(surely_climbs(asked, each, mass_kg, torque, confidence) for each in slopes[slopes <= slope])
        assert slope == slopes[-1] or not surely_climbs(asked, slope + STEEPEST_STEP_DEG, mass_kg, torque, confidence)


def surely_climbs(twin: Twin, slope_deg: float, mass_kg: float, torque_nm: float, confidence: float) -> bool:
    """The rule, from the twin's own predictions."""
    horizon_s = 4.0
    times = np.array([0.0, (1.0 - LAST_PART) * horizon_s, horizon_s])
    level = None if twin.band is None else 2.0 * confidence - 1.0
    answer = twin.predict(Scenario(slope_deg, mass_kg, torque_nm, horizon_s), times, band_level=level)
    x_m = answer.trajectory["x_m"]
    end = x_m[2] if answer.band is None else answer.band.x_lower_m[2]
    return outcome_of(float(end - x_m[1]) / (LAST_PART * horizon_s)) is Outcome.CLIMBS


def test_more_confidence_never_allows_more(twin, sure_twin):
    by_confidence = [
        steepest(mobility_map(sure_twin, 430.0, TORQUES, SLOPES, 4.0, confidence))
        for confidence in (0.75, 0.9, 0.95, 0.995)
    ]
    central = steepest(mobility_map(twin, 430.0, TORQUES, SLOPES, 4.0, 0.9))

    for bolder, surer in zip([central, *by_confidence], by_confidence, strict=False):
        for bold, sure in zip(bolder, surer, strict=True):
            assert sure is None or (bold is not None and sure <= bold)
    assert by_confidence[-1] != central


def test_a_gap_in_the_climb_ends_it(twin):
    asked = gliding(twin, 0.1, 0.1, 0.1, 0.0, 0.1, 0.1, -0.1)
    found = mobility_map(asked, 430.0, [60.0], np.arange(7.0), 10.0, 0.9)

    assert [outcome.value for outcome in found.outcome[0]] == ["climbs"] * 3 + ["stalls"] + ["climbs"] * 2 + ["slides"]
    exact = 3.0 - LATE_SPEED_M_S / 0.1
    assert exact - STEEPEST_STEP_DEG <= steepest(found)[0] <= exact


def test_the_ends_of_the_map_are_its_answers(twin):
    climbing, parked = gliding(twin, 0.1, 0.1), gliding(twin, 0.0, 0.1)

    assert steepest(mobility_map(climbing, 430.0, TORQUES, SLOPES, 10.0, 0.9)) == [40.0] * 3
    assert steepest(mobility_map(climbing, 430.0, [60.0], [7.0], 10.0, 0.9)) == [7.0]
    assert steepest(mobility_map(parked, 430.0, [60.0], SLOPES, 10.0, 0.9)) == [None]


def test_wheels_that_nobody_knows_have_no_slip(twin):
    found = mobility_map(replace(twin, wheel_motion_resistance=None), 430.0, TORQUES, SLOPES, 4.0, 0.9)

    assert found.slip_ratio == ((None,) * len(SLOPES),) * len(TORQUES)


@pytest.mark.parametrize(
    ("field", "change"),
    [
        ("torque_nm", {"torques_nm": [60.0, 30.0]}),
        ("torque_nm", {"torques_nm": [-1.0, 30.0]}),
        ("torque_nm", {"torques_nm": np.arange(65.0)}),
        ("slope_deg", {"slopes_deg": []}),
        ("slope_deg", {"slopes_deg": [0.0, 90.0]}),
        ("slope_deg", {"slopes_deg": [0.0, float("nan")]}),
        ("mass_kg", {"mass_kg": 0.0}),
        ("horizon_s", {"horizon_s": float("inf")}),
        ("confidence", {"confidence": 0.5}),
        ("confidence", {"confidence": float("nan")}),
    ],
)
def test_what_cannot_be_mapped_is_refused(twin, field, change):
    asked = {"mass_kg": 430.0, "torques_nm": [60.0], "slopes_deg": [20.0], "horizon_s": 4.0, "confidence": 0.9}
    with pytest.raises(InvalidValueError) as refused:
        mobility_map(twin, **(asked | change))
    assert refused.value.field == field


def test_infinity_is_never_an_answer(twin):
    with pytest.raises(NonFiniteError):
        mobility_map(gliding(twin, 1e308), 430.0, [60.0], [0.0], 100.0, 0.9)


def test_a_map_that_would_hold_a_worker_for_long_is_refused(twin):
    slopes, torques = np.linspace(0, 30, 64), np.linspace(30, 90, 64)
    with pytest.raises(
        InvalidValueError, match=r"torques x slopes x horizon_s is 53248\.0, allowed is at most 50000 s"
    ):
        mobility_map(twin, 430.0, torques, slopes, 13.0, 0.9)
    assert len(mobility_map(twin, 430.0, torques, slopes, 10.0, 0.9).outcome) == 64
