"""A twin that knows the errors of its force balance: bands, likely outcomes, and maps that agree across horizons."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import safetensors.numpy

import model_store
from model_store import WEIGHTS, ModelStore
from service.errors import CheckpointError
from service.learning.band import BAND_FILE
from service.learning.checkpoint import weights_bytes
from service.learning.domain import Domain
from service.learning.doubt.doubt import Doubt
from service.learning.doubt.outcomes import Class, entropy
from service.learning.doubt.stored import describe_doubt, doubt_bytes
from service.physics.scenario import Scenarios
from service.twin import Outcome, Scenario, Twin, sample_times
from service.twin.load import load_twin
from service.twin.mobility import MobilityMap, mobility_map
from service.twin.suggestions import suggestions
from tests.learning.doubt.pushed import MODEL, many, models
from tests.learning.synthetic import synthetic_runs
from tests.twin.published import draft, publish, zero_model

RUNS = many(60, seed=1)
DOUBT = Doubt.calibrate(RUNS, models(RUNS))
TORQUES, SLOPES = [50.0, 80.0, 110.0], np.linspace(0.0, 35.0, 36)


@pytest.fixture(scope="module")
def twin() -> Twin:
    store = ModelStore.open("memory://")
    publish(store)
    domain = Domain.of_runs(RUNS, MODEL.prior.rover, MODEL.prior.regolith)
    return replace(load_twin(store, "unit", 1), model=MODEL, domain=domain, band=DOUBT)


def map_of(twin: Twin, horizon_s: float, confidence: float = 0.9, mass_kg: float = 430.0) -> MobilityMap:
    return mobility_map(twin, mass_kg, TORQUES, SLOPES, horizon_s, confidence)


def test_a_prediction_has_a_band_around_it(twin):
    found = twin.predict(Scenario(12, 500, 70, 20), sample_times(20, 0.5), band_level=0.9)

    assert (found.band.x_lower_m <= found.trajectory["x_m"]).all()
    assert (found.trajectory["x_m"] <= found.band.x_upper_m).all()
    assert found.band.x_upper_m[-1] > found.band.x_lower_m[-1]


def test_the_band_depends_on_neither_sampling_nor_horizon(twin):
    long = twin.predict(Scenario(12, 500, 60, 8), sample_times(8, 0.1), band_level=0.9).band
    short = twin.predict(Scenario(12, 500, 60, 4), sample_times(4, 0.5), band_level=0.9).band

    np.testing.assert_allclose(long.x_upper_m[:41:5], short.x_upper_m)


def test_the_outcome_is_the_most_probable_one_and_asking_for_a_band_does_not_change_it(twin):
    asked = [Scenario(slope, 430, 60, 10) for slope in np.linspace(0, 35, 36)]
    chances = twin.chances(asked)

    for scenario, row in zip(asked, chances, strict=True):
        plain = twin.predict(scenario, sample_times(10, 1)).summary
        banded = twin.predict(scenario, sample_times(10, 1), band_level=0.9).summary
        assert plain == banded
        assert row[Class[plain.outcome.name]] == pytest.approx(row.max(), abs=5e-3)
    assert {twin.predict(each, sample_times(10, 1)).summary.outcome for each in asked} >= {
        Outcome.CLIMBS,
        Outcome.SLIDES,
    }


def test_one_by_one_or_all_together_outcomes_are_the_same(twin):
    asked = [Scenario(slope, 500, 60, horizon) for slope in np.linspace(5, 33, 8) for horizon in (3, 10)]
    times = np.stack([np.linspace(0.0, scenario.horizon_s, 5) for scenario in asked])
    together = twin.predict_many(asked, times)

    for row, scenario in enumerate(asked):
        assert together.summaries.outcome[row] is twin.predict(scenario, times[row]).summary.outcome


@pytest.mark.parametrize("confidence", [0.75, 0.9, 0.95])
def test_a_longer_horizon_never_makes_a_steeper_slope_climbable(twin, confidence):
    wide = replace(twin, domain=replace(twin.domain, spans=dict(twin.domain.spans) | {"horizon_s": (0.0, 1000.0)}))
    for asked in (twin, wide):
        maps = [map_of(asked, horizon_s, confidence).steepest_climb_slope_deg for horizon_s in (1.0, 5.0, 10.0, 20.0)]
        for shorter, longer in pairwise(maps):
            for one, other in zip(shorter, longer, strict=True):
                assert other is None or (one is not None and other <= one)
    assert (
        map_of(twin, 1.0, confidence).steepest_climb_slope_deg
        == map_of(twin, 10.0, confidence).steepest_climb_slope_deg
    )


def test_more_confidence_never_allows_more(twin):
    maps = [map_of(twin, 10.0, confidence).steepest_climb_slope_deg for confidence in (0.75, 0.9, 0.97)]

    assert all(sure <= bold for bolder, surer in pairwise(maps) for bold, sure in zip(bolder, surer, strict=True))
    assert maps[0] != maps[-1]


def test_the_steepest_slope_is_the_one_that_still_climbs_with_that_probability(twin):
    found = map_of(twin, twin.settled_horizon_s)
    for torque, slope in zip(TORQUES, found.steepest_climb_slope_deg, strict=True):
        near, beyond = twin.chances(
            [Scenario(each, 430, torque, twin.settled_horizon_s) for each in (slope, slope + 0.02)]
        )
        assert near[0] >= 0.9 - 0.01
        assert beyond[0] < 0.9 + 0.01


def test_where_nothing_is_inside_the_domain_nothing_is_said(twin):
    strange = map_of(twin, 10.0, mass_kg=2000.0)
    usual = map_of(twin, 10.0)

    assert strange.steepest_climb_slope_deg == (None,) * 3
    assert strange.steepest_inside_domain == (None,) * 3
    for torque, slope, inside in zip(
        TORQUES, usual.steepest_climb_slope_deg, usual.steepest_inside_domain, strict=True
    ):
        assert inside == twin.domain.judge(slope, 430.0, torque, 10.0).inside


def test_a_model_without_a_force_balance_cannot_have_one():
    store = ModelStore.open("memory://")
    files = {WEIGHTS: weights_bytes(zero_model()), BAND_FILE: doubt_bytes(DOUBT)}
    described = {"domain": Domain.of_runs(synthetic_runs(), MODEL.prior.rover, MODEL.prior.regolith).describe()}
    changed = draft(zero_model()).model_copy(update=described | {"band": describe_doubt(DOUBT)})
    version = store.publish("unit", files, changed).version

    with pytest.raises(CheckpointError, match="the band is one of force balances, of which the model has none"):
        load_twin(store, "unit", version)


def test_the_file_holds_plain_arrays():
    assert set(safetensors.numpy.load(doubt_bytes(DOUBT))) == {"places", "sizes", "multipliers"}


@pytest.mark.slow
def test_the_shipped_champion_keeps_the_laws():
    store = ModelStore.open(next(iter(model_store.__path__)))
    twin = load_twin(store, "viper-lunar", store.alias("viper-lunar", "champion").version)
    random = np.random.default_rng(3)
    slope, mass = np.radians(random.uniform(-25, 34, 60)), random.uniform(300, 900, 60)
    asked, times = Scenarios(slope, mass, random.uniform(0, 130, 60)), np.linspace(0, 30, 61)
    centre, seen = twin.model.positions(asked, times), twin.model.positions(asked, twin.doubt.look_s).x_m
    bands = [twin.doubt.edges(twin.offset_model, asked, times, level, centre, seen) for level in (0.5, 0.7, 0.9, 0.99)]

    for narrow, wide in pairwise(bands):
        assert (wide.x_low_m <= narrow.x_low_m + 1e-9).all()
        assert (narrow.x_high_m <= wide.x_high_m + 1e-9).all()
    rover, gravity = twin.model.prior.rover, twin.model.prior.regolith.gravity_m_s2
    fall = 0.5 * gravity * np.sin(slope)[:, None] * times**2
    fastest = rover.no_load_speed_rad_s * rover.wheel_radius_m * times + np.maximum(-fall, 0.0)
    assert (bands[-1].x_high_m <= np.maximum(fastest, centre.x_m) + 1e-9).all()
    assert (bands[-1].x_low_m >= np.minimum(-np.maximum(fall, 0.0), centre.x_m) - 1e-9).all()


@pytest.mark.slow
def test_the_shipped_champion_asks_for_runs_whose_outcome_is_open():
    store = ModelStore.open(next(iter(model_store.__path__)))
    twin = load_twin(store, "viper-lunar", store.alias("viper-lunar", "champion").version)
    asked = suggestions(store, twin.manifest, 8)
    chances = twin.chances([Scenario(run.slope_deg, run.mass_kg, run.torque_nm, run.horizon_s) for run in asked])
    random = np.random.default_rng(4)
    slopes, masses, torques = random.uniform(-25, 32, 200), random.uniform(300, 900, 200), random.uniform(0, 130, 200)
    others = twin.chances([Scenario(*each, 10.0) for each in zip(slopes, masses, torques, strict=True)])

    assert entropy(chances).mean() > 4.0 * entropy(others).mean()
    rover, gravity = twin.model.prior.rover, twin.model.prior.regolith.gravity_m_s2
    for run in asked:  # the motors outweigh the slope: else the rover is sure to roll back or to coast
        pull = run.mass_kg * gravity * abs(np.sin(np.radians(run.slope_deg)))
        assert rover.wheels * run.torque_nm / rover.wheel_radius_m > pull
    assert suggestions(store, twin.manifest, 3) == asked[:3]
